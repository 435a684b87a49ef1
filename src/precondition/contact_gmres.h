#pragma once
#include <functional>
#include <span>
#include <vector>

#include "petsc.h"

namespace fretwave::precondition {

/// GMRES inside a preconditioner, in the contact's coefficients. Right-hand sides of one operator share their
/// directions: with A Z = C R, the columns of C orthonormal, what those so far can give is taken at once, and
/// the Krylov space of (1 - C C^T) A joins them (GCRO: de Sturler, J. Comput. Appl. Math. 67, 1996, 15-41).
/// The columns lie behind each other, for the BLAS: by VecMDot and VecMAXPY they took twice as long. Single
/// precision loses the columns' right angles: 730 solves for 528 on a ring at H = 15, each up to `most`.
class ContactGmres {
 public:
  using Product = std::function<void(std::span<double const> in, std::span<double> out)>;
  /// local: coefficients of this rank; tolerance: relative; `most`: products a right-hand side.
  ContactGmres(MPI_Comm, size_t local, Product, double tolerance, int most);
  ContactGmres(ContactGmres const&) = delete;
  /// x of a right-hand side, this rank's coefficients. Collective.
  std::vector<double> solve(std::vector<double> b);

 private:
  bool extend(std::span<double const> z, std::vector<double>& left, std::vector<double>& given);
  std::vector<double> taken_from(std::span<double> v) const;
  std::vector<double> transposed_product(int columns, std::vector<double> const& A,
                                         std::span<double const> v) const;
  double norm(std::span<double const> v) const;
  std::vector<double> combined(std::vector<double> y) const;
  void forget(size_t from);

  MPI_Comm comm_;
  int local_;
  Product product_;
  double tolerance_;
  int most_;
  std::vector<double> C_, starts_;      ///< column-major; of Z those that begin a Krylov space
  std::vector<bool> begins_;            ///< of Z: whether it is the next start, or the column of C before it
  std::vector<std::vector<double>> R_;  ///< upper triangle by columns
};

}  // namespace fretwave::precondition
