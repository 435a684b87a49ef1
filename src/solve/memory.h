#pragma once
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <limits>
#include <string>
#include <utility>

#include "petsc.h"
#include "tuned.h"

namespace fretwave::solve {

inline const Tuned memory_share("linear_memory_share", 0.7,
                                "share of the free memory that a preconditioner may take");

/// Ranks of this rank's node, and of all nodes the most. Collective.
inline std::pair<int, int> ranks_of_node(MPI_Comm comm) {
  MPI_Comm node;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node);
  const int own = comm_size(node);
  MPI_Comm_free(&node);
  int most = own;
  MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPI_INT, MPI_MAX, comm);
  return {own, most};
}

/// Memory that all ranks may still take together [bytes]: on as many nodes as they fill at the least, that of
/// the poorest; infinite where it is not known. The same on every rank. Collective.
inline double available_bytes(MPI_Comm comm) {
  const auto [ranks, most] = ranks_of_node(comm);
  double bytes = std::numeric_limits<double>::infinity(), kilobytes;
  std::ifstream file("/proc/meminfo");
  for (std::string word; file >> word;)
    if (word == "MemAvailable:" && file >> kilobytes) bytes = 1024 * kilobytes;
  rlimit limit;
  if (!getrlimit(RLIMIT_AS, &limit) && limit.rlim_cur != RLIM_INFINITY)
    bytes = std::min(bytes, ranks * double(limit.rlim_cur));
  MPI_Allreduce(MPI_IN_PLACE, &bytes, 1, MPI_DOUBLE, MPI_MIN, comm);
  return bytes * std::max(1, comm_size(comm) / most);
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
