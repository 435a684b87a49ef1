#pragma once
#include <exception>
#include <utility>

#include "petsc.h"

namespace fretwave {

/// Carries an exception across PETSc, which must not see one: kept in the callback, thrown again behind it.
class Guard {
 public:
  template <class Body>
  PetscErrorCode run(Body body) {
    try {
      body();
    } catch (...) {
      exception_ = std::current_exception();
      return PETSC_ERR_USER;
    }
    return PetscErrorCode(0);
  }
  void clear() { exception_ = nullptr; }
  void rethrow() {
    if (exception_) std::rethrow_exception(std::exchange(exception_, nullptr));
  }

 private:
  std::exception_ptr exception_;
};

}  // namespace fretwave
