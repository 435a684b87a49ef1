/// The blocks' inverse applied: forces on modes and rows in, motions out.
#include <algorithm>

#include "lapack.h"
#include "log.h"
#include "precondition/modal_blocks.h"

namespace fretwave::precondition {

using lapack::multiply;

/// Of right sides one after the other, each by parts and scalars: qc - i qs where the block is complex.
std::vector<double> ModalBlocks::small_solutions(Small const& small, std::vector<double> const& right) const {
  const int k = low_, n = small.size, columns = int(right.size()) / std::max(n, 1);
  std::vector<double> x(right.size());
  if (small.complex_inverse.empty()) {
    if (columns == 1) {  // a product of matrices packs the block for it
      const int step = 1;
      const double one = 1, zero = 0;
      dgemv_("N", &n, &n, &one, small.real_inverse.data(), &n, right.data(), &step, &zero, x.data(), &step);
    } else {
      multiply("NN", {n, columns, n}, 1.0, {small.real_inverse.data(), n}, {right.data(), n}, 0.0, x.data(),
               n);
    }
    return x;
  }
  std::vector<std::complex<float>> q(size_t(k) * columns);
  for (int col = 0; col < columns; ++col)
    for (int l = 0; l < k; ++l) {
      double const* part = right.data() + size_t(col) * n + l;
      q[size_t(col) * k + l] = {float(part[0]), -float(part[k])};
    }
  if (columns == 1) {
    q = lapack::product(k, k, small.complex_inverse.data(), std::move(q));
  } else {
    const auto given = q;
    multiply("NN", {k, columns, k}, 1.0f, {small.complex_inverse.data(), k}, {given.data(), k}, 0.0f,
             q.data(), k);
  }
  for (int col = 0; col < columns; ++col)
    for (int l = 0; l < k; ++l) {
      double* part = x.data() + size_t(col) * n + l;
      part[0] = q[size_t(col) * k + l].real(), part[k] = -q[size_t(col) * k + l].imag();
    }
  return x;
}

/// A block's coefficients of the lower modes, by parts, and room for its scalars; and back.
std::vector<double> ModalBlocks::of_parts(Small const& small, std::vector<float> const& low) const {
  std::vector<double> out(small.size);
  for (int part = 0; part < small.parts; ++part)
    for (int l = 0; l < low_; ++l) out[part * low_ + l] = low[size_t(l) * lead_ + small.at + part];
  return out;
}

void ModalBlocks::put_parts(Small const& small, std::vector<double> const& x, std::vector<float>& low) const {
  for (int part = 0; part < small.parts; ++part)
    for (int l = 0; l < low_; ++l) low[size_t(l) * lead_ + small.at + part] = float(x[part * low_ + l]);
}

/// to += T u
void ModalBlocks::add_T(std::vector<float> const& u, std::vector<float>& to) const {
  for (Entry const& t : T_)
    for (int i = 0; i < lead_; ++i)
      to[size_t(t.row) * lead_ + i] += float(t.value) * u[size_t(t.col) * lead_ + i];
}

/// X u
std::vector<float> ModalBlocks::pull(std::vector<float> u) const {
  const int r = rows(), c = lead_;
  std::vector<float> Tu(u.size(), 0.0f), f(u.size(), 0.0f);
  add_T(u, Tu);
  multiply("NN", {c, r, r}, -1.0f, {Tu.data(), c}, {G_.data(), r}, 1.0f, u.data(), c);
  add_T(u, f);
  return f;
}

// eta_h = z^-1 (g_h - U_h^T f - C_h zeta), f = X (U_h z^-1 g_h + U_l eta_l - c zeta)
ModalBlocks::Solution ModalBlocks::solve(std::vector<float> const& forces,
                                         std::vector<double> const& closing) const {
  static const log::Event inverse("FwBlocks");
  const log::Span span(inverse);
  const int n = modes_, k = low_, r = rows(), c = lead_;
  Solution out{std::vector<float>(size_t(c) * n), {}};
  auto& eta = out.modes;
  const auto relax = [&](std::vector<float> const& g) {
    for (size_t i = 0; i < small_.size(); ++i)
      for (int l = k; l < n; ++l) {
        const size_t at = size_t(l) * c + offsets_[i];
        const complex y = complex(g[at], parts_[i] == 2 ? -g[at + 1] : 0.0f) * flexible_[i][l];
        eta[at] = float(y.real());
        if (parts_[i] == 2) eta[at + 1] = float(-y.imag());
      }
  };
  relax(forces);
  std::vector<float> b(size_t(c) * r), t, low(forces.begin(), forces.begin() + size_t(c) * k);
  if (r)
    multiply("NN", {c, r, n - k}, 1.0f, {eta.data() + size_t(c) * k, c}, {motions_.data() + k, n}, 0.0f,
             b.data(), c);
  t = pull(b);
  multiply("NT", {c, k, r}, -1.0f, {t.data(), c}, {motions_.data(), n}, 1.0f, low.data(), c);
  for (Small const& small : small_) {
    auto right = of_parts(small, low);
    for (int j = 0; j < small.scalars; ++j) {
      double& row = right[2 * k + j] = closing[j];
      for (int part = 0; part < 2; ++part) {
        const size_t v = size_t(2) * j + part;
        for (int l = k; l < n; ++l) row -= border_.rows[v * n + l] * eta[size_t(l) * c + small.at + part];
        for (int i = 0; i < r; ++i) row += rows_X_[v * r + i] * b[size_t(i) * c + small.at + part];
      }
    }
    const auto x = small_solutions(small, right);
    put_parts(small, x, eta);
    if (!small.scalars) continue;
    out.scalars.assign(x.begin() + 2 * k, x.end());
    for (int j = 0; j < small.scalars; ++j)
      for (int part = 0; part < 2; ++part)
        for (int i = 0; i < r; ++i)
          t[size_t(i) * c + small.at + part] -=
              float(out.scalars[j] * X_columns_[(size_t(2) * j + part) * r + i]);
  }
  std::vector<float> v(size_t(c) * r);  // X U_l = T (U_l - g T U_l)
  multiply("NT", {c, r, k}, 1.0f, {eta.data(), c}, {left_.data(), r}, 0.0f, v.data(), c);
  add_T(v, t);
  if (r) {
    std::vector<float> g(forces.begin(), forces.end());
    multiply("NT", {c, n - k, r}, -1.0f, {t.data(), c}, {motions_.data() + k, n}, 1.0f,
             g.data() + size_t(c) * k, c);
    relax(g);
  }
  for (size_t j = 0; j < out.scalars.size(); ++j)
    for (int part = 0; part < 2; ++part)
      for (int l = k; l < n; ++l)
        eta[size_t(l) * c + offsets_[border_harmonic_] + part] -=
            float(out.scalars[j] * moved_[(2 * j + part) * n + l]);
  return out;
}

std::vector<float> ModalBlocks::motion(std::vector<float> const& modes) const {
  const int r = rows(), c = lead_;
  std::vector<float> u(size_t(c) * r);
  multiply("NN", {c, r, modes_}, 1.0f, {modes.data(), c}, {motions_.data(), modes_}, 0.0f, u.data(), c);
  return u;
}

void ModalBlocks::subtract(std::vector<float> const& f, std::vector<float>& forces) const {
  const int r = rows(), c = lead_;
  multiply("NT", {c, modes_, r}, -1.0f, {f.data(), c}, {motions_.data(), modes_}, 1.0f, forces.data(), c);
}

// G (1 + T G)^-1 f + (U_l - G X U_l) eta_l - (c - G X c) zeta, N (eta_l, zeta) = (U_l^T, -rho) (1 + T G)^-1 f
std::vector<float> ModalBlocks::compliance(std::vector<float> const& f) const {
  static const log::Event compliances("FwCompliance");
  const log::Span span(compliances);
  const int k = low_, r = rows(), c = lead_;
  std::vector<float> u(size_t(c) * r), low(size_t(c) * k);
  multiply("NN", {c, r, r}, 1.0f, {f.data(), c}, {G_.data(), r}, 0.0f, u.data(), c);
  multiply("NT", {c, k, r}, 1.0f, {f.data(), c}, {right_.data(), k}, 0.0f, low.data(), c);
  for (Small const& small : small_) {
    auto right = of_parts(small, low);
    for (int j = 0; j < small.scalars; ++j)
      for (int part = 0; part < 2; ++part)
        for (int i = 0; i < r; ++i)
          right[2 * k + j] -=
              right_rows_[(size_t(2) * j + part) * r + i] * f[size_t(i) * c + small.at + part];
    const auto x = small_solutions(small, right);
    put_parts(small, x, low);
    for (int j = 0; j < small.scalars; ++j)
      for (int part = 0; part < 2; ++part)
        for (int i = 0; i < r; ++i)
          u[size_t(i) * c + small.at + part] -=
              float(x[2 * k + j] * left_columns_[(size_t(2) * j + part) * r + i]);
  }
  multiply("NT", {c, r, k}, 1.0f, {low.data(), c}, {left_.data(), r}, 1.0f, u.data(), c);
  return u;
}

/// The same by columns: N^-1 of what the force on each row is on the lower modes and the border. Without a
/// border the sine's column is the cosine's, turned.
std::vector<Rotation> ModalBlocks::compliance(int harmonic, std::vector<Group> const& groups) const {
  static const log::Event compliances("FwPairMotion");
  const log::Span span(compliances);
  const int k = low_, r = rows();
  Small const& small = small_[harmonic - first_];
  const int of_row = small.scalars ? 2 : 1, columns = of_row * r;
  std::vector<double> right(size_t(small.size) * columns);
  for (int row = 0; row < r; ++row)
    for (int part = 0; part < of_row; ++part) {
      double* to = right.data() + (size_t(row) * of_row + part) * small.size;
      std::copy_n(right_.data() + size_t(row) * k, k, to + part * k);
      for (int j = 0; j < small.scalars; ++j) to[2 * k + j] = -right_rows_[(size_t(2) * j + part) * r + row];
    }
  const auto x = small_solutions(small, right);
  const auto entry = [&](int a, int b, int to, int part) {
    double const* of_b = x.data() + (size_t(b) * of_row + part) * small.size;
    double u = to == part ? G_[size_t(a) * r + b] : 0;
    for (int l = 0; l < k; ++l) u += left_[size_t(l) * r + a] * of_b[to * k + l];
    for (int j = 0; j < small.scalars; ++j)
      u -= left_columns_[(size_t(2) * j + to) * r + a] * of_b[2 * k + j];
    return u;
  };
  std::vector<Rotation> out;
  for (auto const& [first, count] : groups)
    for (int a = first; a < first + count; ++a)
      for (int b = first; b < first + count; ++b) {
        const double cc = entry(a, b, 0, 0), sc = small.parts == 2 ? entry(a, b, 1, 0) : 0;
        if (small.scalars)
          out.push_back({cc, entry(a, b, 0, 1), sc, entry(a, b, 1, 1)});
        else
          out.push_back({cc, -sc, sc, small.parts == 2 ? cc : 0});
      }
  return out;
}

}  // namespace fretwave::precondition
