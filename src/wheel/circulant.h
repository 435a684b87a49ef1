#pragma once
#include <complex>
#include <map>
#include <numbers>
#include <vector>

#include "petsc.h"

namespace fretwave::wheel {

using complex = std::complex<double>;

/// Blocks A_k of a block-circulant matrix by the sectors k ahead: (A x)_j = sum_k A_k x_{j+k}.
template <class Block>
using Circulant = std::map<int, Block>;

/// Rows of a sparse block, of ascending columns.
struct SparseBlock {
  std::vector<int> first = {0};  ///< of each row, and the end
  std::vector<int> columns;
  std::vector<double> values;
  int rows() const { return int(first.size()) - 1; }
};

/// visit(row, column, value)
template <class Visit>
void for_entries(SparseBlock const& A, Visit visit) {
  for (int row = 0; row < A.rows(); ++row)
    for (int k = A.first[row]; k < A.first[row + 1]; ++k) visit(row, A.columns[k], A.values[k]);
}

/// Mean over the `sectors` of a wheel, each of `unit` dofs, of the block that acts on the sector k ahead.
/// Rows and columns are by `place` of a sector's dof. Ranks hold whole sectors. Collective.
Circulant<SparseBlock> mean_blocks(Mat A, int unit, int sectors, std::vector<int> const& place);

/// A_-k = A_k^T, but for rounding: the blocks of the waves d and -d are each other's transposes.
bool symmetric(Circulant<SparseBlock> const&, int sectors);

/// e^{2 pi i k d / N}
inline complex turn(int ahead, int diameter, int sectors) {
  return std::polar(1.0, 2 * std::numbers::pi * double(size_t(ahead) * diameter % sectors) / sectors);
}

/// y = A_d x, A_d = sum_k A_k e^{2 pi i k d / N} (Thomas, Int. J. Numer. Methods Eng. 14, 1979).
std::vector<complex> multiply(Circulant<SparseBlock> const& A, int diameter, int sectors, complex const* x);

/// A + c B.
Circulant<SparseBlock> sum(Circulant<SparseBlock> const& A, double c, Circulant<SparseBlock> const& B);

}  // namespace fretwave::wheel
