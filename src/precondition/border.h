#pragma once
#include <functional>

#include "petsc.h"

namespace fretwave::precondition {

/// Inverse of [A, C; R, S] from one of A, with a few scalars beside distributed vectors:
/// z = (S - R A^-1 C)^-1 (x_z - R A^-1 x), q = A^-1 (x - C z). A is taken where it is regular; the border
/// holds the directions in which it nearly is not. The scalars stand behind the last rank's entries.
class Border {
 public:
  using Local = std::vector<double>;  ///< a rank's entries of a vector
  using Solve = std::function<Local(double const*)>;
  /// columns, rows: as many as there are scalars; S: rows x columns, column-major, the same on every rank.
  /// `InputError` if singular. Collective.
  void make(Solve, std::vector<Local> const& columns, std::vector<Local> rows, std::vector<double> S,
            MPI_Comm);
  /// Collective.
  void apply(double const* x, double* z) const;

 private:
  std::vector<double> along_rows(Local const& q) const;

  MPI_Comm comm_ = MPI_COMM_NULL;
  Solve solve_;
  std::vector<Local> rows_, AC_;
  std::vector<double> inverse_S_;  ///< of the Schur complement, column-major
};

}  // namespace fretwave::precondition
