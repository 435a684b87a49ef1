#include "model/mode_orientation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace fretwave::model {

namespace {

/// A dense weight in [-1, 1) of dof i, without pattern, the same on every number of ranks (splitmix64).
double weight(std::uint64_t i, std::uint64_t column) {
  std::uint64_t z = (i + 1) * 0x9e3779b97f4a7c15ULL + column * 0xd1b54a32d192ed03ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return double((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

VecHandle weights(Vec shape, PetscInt column) {
  VecHandle w = like(shape);
  PetscInt first;
  check(VecGetOwnershipRange(w, &first, nullptr));
  WriteArray out(w);
  for (PetscInt i = 0; i < local_size(w); ++i)
    out[i] = weight(std::uint64_t(first + i), std::uint64_t(column));
  return w;
}

/// Subtract from a row of coefficients its part along the rows before it, and scale it to length 1.
void orthonormalise(std::vector<std::vector<double>> const& before, std::vector<double>& row) {
  for (int pass = 0; pass < 2; ++pass)
    for (auto const& q : before) {
      double along = 0;
      for (size_t j = 0; j < row.size(); ++j) along += q[j] * row[j];
      for (size_t j = 0; j < row.size(); ++j) row[j] -= along * q[j];
    }
  double square = 0;
  for (double v : row) square += v * v;
  for (double& v : row) v /= std::sqrt(square);
}

/// Rotate modes of one frequency (for a single one: its sign) so that their products with the weights are
/// lower triangular with a positive diagonal. Without this a double mode is another pair of vectors on
/// another number of ranks.
void orient(ComponentMode* modes, size_t count) {
  std::vector<Vec> old(count);
  std::vector<VecHandle> rotated;
  std::vector<std::vector<double>> rows;
  for (size_t j = 0; j < count; ++j) old[j] = modes[j].shape;
  for (size_t c = 0; c < count; ++c) {
    std::vector<double> row(count);
    check(VecMDot(weights(old[0], PetscInt(c)), PetscInt(count), old.data(), row.data()));
    orthonormalise(rows, row);
    rotated.push_back(like(old[0]));
    check(VecSet(rotated.back(), 0));
    check(VecMAXPY(rotated.back(), PetscInt(count), row.data(), old.data()));
    rows.push_back(std::move(row));
  }
  for (size_t c = 0; c < count; ++c) modes[c].shape = std::move(rotated[c]);
}

}  // namespace

double rounding(Mat K, Mat M) {
  VecHandle k, m;
  double highest;
  check(MatCreateVecs(K, k.out(), m.out()));
  check(MatGetDiagonal(K, k));
  check(MatGetDiagonal(M, m));
  check(VecPointwiseDivide(k, k, m));  // zero where there is no mass
  check(VecMax(k, nullptr, &highest));
  return 30 * PETSC_MACHINE_EPSILON * highest;
}

double uncertainty(Mat K, Vec x) {
  constexpr double blur = 5e-13;  // measured: 5e-15 of printed matrices, 2e-13 of their reduction
  MatHandle products;
  check(MatDuplicate(K, MAT_COPY_VALUES, products.out()));
  check(MatDiagonalScale(products, x, x));
  VecHandle rows = like(x);
  {
    WriteArray sum(rows);
    PetscInt first, end, count;
    PetscScalar const* entries;
    check(MatGetOwnershipRange(products, &first, &end));
    for (PetscInt row = first; row < end; ++row) {
      check(MatGetRow(products, row, &count, nullptr, &entries));
      sum[row - first] = 0;
      for (PetscInt j = 0; j < count; ++j) sum[row - first] += std::abs(entries[j]);
      check(MatRestoreRow(products, row, &count, nullptr, &entries));
    }
  }
  double all;
  check(VecSum(rows, &all));
  return blur * all;
}

void sort_and_orient(std::vector<ComponentMode>& modes, double resolution) {
  const auto square = [&](size_t j) { return modes[j].omega * modes[j].omega; };
  std::sort(modes.begin(), modes.end(), [](auto const& a, auto const& b) { return a.omega < b.omega; });
  for (size_t begin = 0, end; begin < modes.size(); begin = end) {
    end = begin + 1;
    while (end < modes.size() && square(end) - square(end - 1) < resolution) ++end;
    orient(&modes[begin], end - begin);
  }
}

}  // namespace fretwave::model
