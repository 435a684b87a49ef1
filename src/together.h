#pragma once
#include <exception>

#include "error.h"
#include "petsc.h"

namespace fretwave {

/// What throws the core's own error in place of an exception of a language around it, where there is one (an
/// InputError, Interrupted), and else returns. For the whole process.
void read_foreign_errors_by(void (*)(std::exception const&));

/// Every rank throws what the first rank that failed has caught, in its words; returns if none has.
/// Collective.
void agree(MPI_Comm, char const* task, std::exception_ptr);

/// Does a rank's own share of a task, between two collective calls and without one in it: if it fails on any
/// rank it fails on all, with the same words, so that none is left waiting in the next collective call. On a
/// single rank the exception passes as it is. Collective.
template <class Work>
void together(MPI_Comm comm, char const* task, Work work) {
  if (comm_size(comm) == 1) return work();
  std::exception_ptr failure;
  try {
    work();
  } catch (...) {
    failure = std::current_exception();
  }
  agree(comm, task, failure);
}

}  // namespace fretwave
