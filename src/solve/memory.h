#pragma once
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <limits>
#include <string>

#include "petsc.h"
#include "tuned.h"

namespace fretwave::solve {

inline const Tuned memory_share("linear_memory_share", 0.7,
                                "share of the free memory that a preconditioner may take");

/// Memory that all ranks may still take together [bytes], were they on one node; infinite where it is not
/// known. The same on every rank. Collective.
inline double available_bytes(MPI_Comm comm) {
  double bytes = std::numeric_limits<double>::infinity(), kilobytes;
  std::ifstream file("/proc/meminfo");
  for (std::string word; file >> word;)
    if (word == "MemAvailable:" && file >> kilobytes) bytes = 1024 * kilobytes;
  rlimit limit;
  if (!getrlimit(RLIMIT_AS, &limit) && limit.rlim_cur != RLIM_INFINITY)
    bytes = std::min(bytes, double(limit.rlim_cur));
  MPI_Allreduce(MPI_IN_PLACE, &bytes, 1, MPI_DOUBLE, MPI_MIN, comm);
  return bytes;
}

inline std::string gigabytes(double bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g GB", bytes / 1e9);
  return text;
}

/// What takes more memory than it may, in words; empty if it does not. Collective.
inline std::string beyond_memory(std::string const& what, double bytes, MPI_Comm comm) {
  const double available = available_bytes(comm);
  if (bytes <= memory_share * available) return "";
  return what + " takes " + gigabytes(bytes) + ", of " + gigabytes(available) + " free";
}

}  // namespace fretwave::solve
