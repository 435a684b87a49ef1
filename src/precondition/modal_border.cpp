/// The fundamental's border in the basis of stuck pairs.
#include "precondition/modal_blocks.h"

namespace fretwave::precondition {

/// What the border's columns move of the higher modes, z^-1 C_h, what these move of its rows, R_h z^-1, and
/// its corner without them, S - R_h z^-1 C_h. Vectors by scalar and part.
void ModalBlocks::set_border() {
  const int n = modes_, k = low_, s = border_.scalars;
  auto const& flexible = flexible_[border_harmonic_];
  moved_.assign(size_t(2) * s * n, 0.0), pulled_ = moved_;
  schur_ = border_.corner;
  for (int j = 0; j < s; ++j) {
    double const* C = border_.columns.data() + size_t(2) * j * n;
    double const* R = border_.rows.data() + size_t(2) * j * n;
    double *to = moved_.data() + size_t(2) * j * n, *from = pulled_.data() + size_t(2) * j * n;
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
}

namespace {

/// Entries of further rows behind those of the others, vector by vector.
void append(std::vector<double>& to, std::vector<double> const& more, int vectors) {
  std::vector<double> all;
  const size_t before = to.size() / vectors, added = more.size() / vectors;
  for (size_t v = 0; v < size_t(vectors); ++v) {
    all.insert(all.end(), to.begin() + v * before, to.begin() + (v + 1) * before);
    all.insert(all.end(), more.begin() + v * added, more.begin() + (v + 1) * added);
  }
  to = std::move(all);
}

}  // namespace

/// What the border's columns move of further rows through the higher modes, c = U_h z^-1 C_h, and what forces
/// on these move of its rows, R_h z^-1 U_h^T.
void ModalBlocks::border_rows(std::vector<int> const& rows) {
  const size_t n = modes_, all = basis_.rows(), r = rows.size(), vectors = size_t(2) * border_.scalars;
  if (vectors == 0) return;
  std::vector<double> columns(vectors * r), forces(vectors * r), u(r);
  for (size_t l = low_; l < n; ++l) {
    for (size_t i = 0; i < r; ++i) u[i] = basis_.motions()[l * all + rows[i]];
    for (size_t v = 0; v < vectors; ++v)
      for (size_t i = 0; i < r; ++i) {
        columns[v * r + i] += u[i] * moved_[v * n + l];
        forces[v * r + i] += u[i] * pulled_[v * n + l];
      }
  }
  append(columns_, columns, int(vectors)), append(rows_of_forces_, forces, int(vectors));
}

/// X c, c - G X c, rho X and rho (1 + T G)^-1, with X = T - T g T, (1 + T G)^-1 = 1 - T g, g = G (1 + T
/// G)^-1.
template <class Real>
void ModalBlocks::couple_border(std::vector<Real> const& transposed_g) {
  const size_t r = rows_.size(), vectors = size_t(2) * border_.scalars;
  const auto Tc = times_T(columns_, false), rho_T = times_T(rows_of_forces_, true);
  left_columns_ = columns_, right_rows_ = rows_of_forces_;
  for (size_t j = 0; j < r; ++j) {
    Real const* g = transposed_g.data() + j * r;
    for (size_t v = 0; v < vectors; ++v) {
      double const *in = Tc.data() + v * r, from = rho_T[v * r + j];
      double *to = right_rows_.data() + v * r, sum = 0;
      for (size_t i = 0; i < r; ++i) sum += g[i] * in[i], to[i] -= g[i] * from;
      left_columns_[v * r + j] -= sum;
    }
  }
  X_columns_ = times_T(left_columns_, false), rows_X_ = times_T(right_rows_, true);
}

template void ModalBlocks::couple_border(std::vector<double> const&);
template void ModalBlocks::couple_border(std::vector<float> const&);

/// Columns C_l - U_l^T X c, rows R_l - rho X U_l, corner S - R_h z^-1 C_h + rho X c.
void ModalBlocks::add_border(Small const& small, std::vector<double>& N) const {
  const int n = modes_, k = low_, r = rows(), s = small.scalars, all = basis_.rows();
  const auto at = [&](int row, int col) -> double& { return N[size_t(col) * small.size + row]; };
  const auto dot = [r](double const* a, double const* b) {
    double sum = 0;
    for (int i = 0; i < r; ++i) sum += a[i] * b[i];
    return sum;
  };
  std::vector<double> u(r);
  for (int l = 0; l < k; ++l) {
    for (int i = 0; i < r; ++i) u[i] = basis_.motions()[size_t(l) * all + rows_[i]];
    for (int v = 0; v < 2 * s; ++v) {
      const int mode = v % 2 * k + l, scalar = 2 * k + v / 2;
      at(mode, scalar) =
          border_.columns[size_t(v) * n + l] - dot(u.data(), X_columns_.data() + size_t(v) * r);
      at(scalar, mode) = border_.rows[size_t(v) * n + l] - dot(rows_X_.data() + size_t(v) * r, u.data());
    }
  }
  for (int j = 0; j < s; ++j)
    for (int i = 0; i < s; ++i) {
      double& corner = at(2 * k + i, 2 * k + j) = schur_[size_t(j) * s + i];
      for (int part = 0; part < 2; ++part)
        corner +=
            dot(rows_X_.data() + (size_t(2) * i + part) * r, columns_.data() + (size_t(2) * j + part) * r);
    }
}

}  // namespace fretwave::precondition
