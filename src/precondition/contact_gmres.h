#pragma once
#include <functional>
#include <vector>

#include "petsc.h"

namespace fretwave::precondition {

/// GMRES inside a preconditioner, in the contact's coefficients. Right-hand sides of one operator share their
/// directions: with A Z = C R, the columns of C orthonormal, what those so far can give is taken at once, and
/// the Krylov space of (1 - C C^T) A joins them (GCRO: de Sturler, J. Comput. Appl. Math. 67, 1996, 15-41).
class ContactGmres {
 public:
  using Product = std::function<void(Vec in, Vec out)>;
  /// local: coefficients of this rank; tolerance: relative; `most`: products a right-hand side. Collective.
  ContactGmres(MPI_Comm, PetscInt local, Product, double tolerance, int most);
  ContactGmres(ContactGmres const&) = delete;
  /// To be filled before `solve`.
  Vec right() const { return right_; }
  /// Collective.
  Vec solve();

 private:
  bool extend(Vec z, Vec left, std::vector<double>& given);
  std::vector<double> taken_from(Vec v) const;
  void combine(std::vector<double> y);
  void forget(size_t from);

  Product product_;
  double tolerance_;
  int most_;
  VecHandle right_, x_;
  std::vector<VecHandle> images_, starts_;  // columns of C; of Z those that begin a Krylov space
  std::vector<Vec> C_, Z_;                  // Z: each is a start, or the column of C before it
  std::vector<std::vector<double>> R_;      // upper triangle by columns
};

}  // namespace fretwave::precondition
