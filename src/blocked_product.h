#pragma once
#include <vector>

#include "exact_rows.h"
#include "petsc.h"

namespace fretwave {

/// y += (A (x) I_m) x of a sparse matrix, m coefficients of a dof side by side: each entry of A is read once
/// for all of them. Coefficients of other ranks' dofs stand behind this rank's.
class BlockedProduct {
 public:
  /// Coefficients for which A is read once, in as many registers as stay in the machine's.
  static constexpr int most = 32;
  /// A of PETSc's AIJ types, which stays as it is. Collective.
  BlockedProduct(Mat A, int m);
  /// Where x is to be put before a product: coefficients of this rank's dofs.
  double* columns() { return columns_.data(); }
  /// y += A x. Collective.
  void multiply_add(Vec y);
  /// y + low += A x to twice the digits (`exact_rows.h`). Collective.
  void multiply_exactly(Vec y, Vec low);
  /// y += A^T x. Collective.
  void transposed_multiply_add(Vec y);

 private:
  /// Rows of one of the two parts that PETSc keeps, with its own arrays.
  struct Part {
    Mat A = nullptr;
    PetscInt first_column = 0;  ///< in `columns_`
  };
  template <class Visit>
  void with_rows(Part const&, Visit visit) const;
  template <class Visit>
  void with_parts(Visit visit);

  int m_;
  PetscInt local_, others_ = 0;
  std::vector<Part> parts_;
  std::vector<double> columns_;  ///< of this rank's dofs, of others', and room for a whole vector register
  VecHandle mine_, ghosts_;      ///< those two, as PETSc sees them
  ScatterHandle exchange_;
};

}  // namespace fretwave
