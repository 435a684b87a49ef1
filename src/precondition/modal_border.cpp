/// The fundamental's border in the basis of stuck pairs.
#include "lapack.h"
#include "precondition/modal_blocks.h"

namespace fretwave::precondition {

using lapack::Dense;
using lapack::multiply;

/// What the border's columns move of the rows through the higher modes, c = U_h z^-1 C_h, what forces on the
/// rows move of its rows, R_h z^-1 U_h^T, and its corner without them, S - R_h z^-1 C_h. Vectors by scalar
/// and part.
void ModalBlocks::set_border(std::vector<double> const& U) {
  const int n = modes_, k = low_, r = rows(), s = border_.scalars;
  auto const& flexible = flexible_[border_harmonic_];
  moved_.assign(size_t(2) * s * n, 0.0), columns_.assign(size_t(2) * s * r, 0.0), rows_of_forces_ = columns_;
  schur_ = border_.corner;
  std::vector<double> pulled(moved_.size());
  for (int j = 0; j < s; ++j) {
    double const* C = border_.columns.data() + size_t(2) * j * n;
    double const* R = border_.rows.data() + size_t(2) * j * n;
    double *to = moved_.data() + size_t(2) * j * n, *from = pulled.data() + size_t(2) * j * n;
    for (int l = k; l < n; ++l) {
      const Rotation a = Rotation::of(flexible[l]);
      to[l] = a.cc * C[l] + a.cs * C[n + l], to[n + l] = a.sc * C[l] + a.ss * C[n + l];
      from[l] = R[l] * a.cc + R[n + l] * a.sc, from[n + l] = R[l] * a.cs + R[n + l] * a.ss;
    }
  }
  for (int i = 0; i < s; ++i)
    for (int j = 0; j < s; ++j)
      for (int l = 0; l < 2 * n; ++l)
        schur_[size_t(j) * s + i] -= border_.rows[size_t(2) * i * n + l] * moved_[size_t(2) * j * n + l];
  for (int v = 0; v < 2 * s; ++v)
    for (int l = k; l < n; ++l) {
      double const* u = U.data() + size_t(l) * r;
      for (int i = 0; i < r; ++i) {
        columns_[size_t(v) * r + i] += u[i] * moved_[size_t(v) * n + l];
        rows_of_forces_[size_t(v) * r + i] += u[i] * pulled[size_t(v) * n + l];
      }
    }
}

/// X c, c - G X c, rho X and rho (1 + T G)^-1, with X = T - T g T, (1 + T G)^-1 = 1 - T g, g = G (1 + T
/// G)^-1.
void ModalBlocks::couple_border(std::vector<double> const& transposed_g) {
  const int r = rows(), two = 2 * border_.scalars;
  const Dense<double> g{transposed_g.data(), r};
  const auto Tc = times_T(columns_, false), rho_T = times_T(rows_of_forces_, true);
  left_columns_ = columns_, right_rows_ = rows_of_forces_;
  multiply("TN", {r, two, r}, -1.0, g, {Tc.data(), r}, 1.0, left_columns_.data(), r);
  X_columns_ = times_T(left_columns_, false);
  multiply("NN", {r, two, r}, -1.0, g, {rho_T.data(), r}, 1.0, right_rows_.data(), r);
  rows_X_ = times_T(right_rows_, true);
}

/// Columns C_l - U_l^T X c, rows R_l - rho X U_l, corner S - R_h z^-1 C_h + rho X c.
void ModalBlocks::add_border(Small const& small, std::vector<double>& N) const {
  const int n = modes_, k = low_, r = rows(), s = small.scalars;
  const auto at = [&](int row, int col) -> double& { return N[size_t(col) * small.size + row]; };
  const auto dot = [r](double const* a, double const* b) {
    double sum = 0;
    for (int i = 0; i < r; ++i) sum += a[i] * b[i];
    return sum;
  };
  for (int j = 0; j < s; ++j) {
    for (int part = 0; part < 2; ++part) {
      const size_t v = size_t(2) * j + part;
      for (int l = 0; l < k; ++l) {
        double const* u = U_low_.data() + size_t(l) * r;
        at(part * k + l, 2 * k + j) = border_.columns[v * n + l] - dot(u, X_columns_.data() + v * r);
        at(2 * k + j, part * k + l) = border_.rows[v * n + l] - dot(rows_X_.data() + v * r, u);
      }
    }
    for (int i = 0; i < s; ++i) {
      double& corner = at(2 * k + i, 2 * k + j) = schur_[size_t(j) * s + i];
      for (int part = 0; part < 2; ++part)
        corner +=
            dot(rows_X_.data() + (size_t(2) * i + part) * r, columns_.data() + (size_t(2) * j + part) * r);
    }
  }
}

}  // namespace fretwave::precondition
