#pragma once
#include <functional>

#include "petsc.h"
#include "solve/guard.h"

namespace fretwave::precondition {

/// GMRES inside a preconditioner, in the contact's coefficients.
class ContactGmres {
 public:
  using Product = std::function<void(Vec in, Vec out)>;
  /// local: coefficients of this rank; tolerance: relative; `most`: iterations. Collective.
  ContactGmres(MPI_Comm, PetscInt local, Product, double tolerance, int most);
  ContactGmres(ContactGmres const&) = delete;
  /// To be filled before `solve`.
  Vec right() const { return right_; }
  /// Collective.
  Vec solve();

 private:
  static PetscErrorCode shell_product(Mat, Vec in, Vec out);

  Product product_;
  MatHandle A_;
  KspHandle ksp_;
  VecHandle right_, x_;
  solve::Guard guard_;
};

}  // namespace fretwave::precondition
