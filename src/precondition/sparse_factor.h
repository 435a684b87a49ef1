#pragma once
#include <complex>
#include <memory>
#include <vector>

#include "petsc.h"

namespace fretwave::precondition {

/// This rank's entries of a square matrix, rows and columns from 1; entries that repeat add up. A symmetric
/// one is given by one triangle.
struct SparsePattern {
  int size;
  bool symmetric;
  std::vector<int> rows, cols;
};

/// A complex sparse matrix, factorised over the communicator by MUMPS' own interface, which lives beside real
/// PETSc. Complex symmetric where the pattern says so: less than half the cost of a general one.
class SparseFactor {
 public:
  /// Analyses the pattern, with the ordering of `model` if given. The pattern must outlive the factor.
  /// Collective.
  SparseFactor(MPI_Comm, SparsePattern const&, SparseFactor const* model = nullptr);
  SparseFactor(SparseFactor&&) noexcept;
  ~SparseFactor();
  /// Values of the pattern's entries on this rank. `InputError` if singular. Collective.
  void factorise(std::vector<std::complex<double>> values);
  /// x = A^-1 x, or A^-T x, for size x columns, column-major, on rank 0. Collective.
  void solve(std::complex<double>* x, int columns, bool transposed = false);
  /// Memory over all ranks [MB], and entries of the factors.
  double megabytes() const;
  double entries() const;

 private:
  struct Instance;
  std::unique_ptr<Instance> mumps_;
};

}  // namespace fretwave::precondition
