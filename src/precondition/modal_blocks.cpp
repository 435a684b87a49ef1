#include "precondition/modal_blocks.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "fault.h"
#include "lapack.h"
#include "log.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

const Tuned follows("modes_follows", 0.05, "inertia over stiffness up to which a mode moves statically");
const Tuned resonant("modes_resonant", 0.3,
                     "inertia over stiffness from which a mode beyond the most is taken at rest");
const Tuned fewest("modes_fewest", 8, "modes that move with inertia, at the least");
const Tuned most("modes_most", 128, "modes that move with inertia, at the most");
const Tuned single("modes_single", 256, "slipping rows from which they are inverted in single precision");
constexpr float regular = 1e-3f;  // least over largest pivot, down to which that is exact enough

using lapack::Dense;
using lapack::multiply;

std::vector<float> rounded(std::vector<double> const& x) { return {x.begin(), x.end()}; }

log::Event const& slipping() {
  static const log::Event event("FwSlipInverse");
  return event;
}

SingularBlock singular() {
  return SingularBlock("the slipping pairs' block of the preconditioner is singular: a free motion");
}

/// G := A^-1 G in single precision; false, and G as it was, where A is too near a singular one.
bool solve_quickly(std::vector<double> const& A, int n, std::vector<double>& G) {
  auto factor = rounded(A), found = rounded(G);
  if (lapack::solve(factor, n, found, n)) return false;
  float least = INFINITY, largest = 0;
  for (int i = 0; i < n; ++i) {
    const float pivot = std::abs(factor[size_t(i) * n + i]);
    least = std::min(least, pivot), largest = std::max(largest, pivot);
  }
  if (!(least >= regular * largest)) return false;
  G.assign(found.begin(), found.end());
  return true;
}

}  // namespace

ModalBlocks::ModalBlocks(model::StuckBasis const& basis, Harmonics const& h, int first, int last)
    : basis_(basis), first_(first), modes_(basis.size()) {
  if (first < last) begin_ = h.offset(first);
  for (int i = first; i < last; ++i) {
    offsets_.push_back(h.offset(i) - begin_);
    parts_.push_back(h.orders()[i] == 0 ? 1 : 2);
    count_ += parts_.back();
    if (i == h.fundamental()) border_harmonic_ = i - first;
  }
  lead_ = lapack::filled_up(count_);
}

void ModalBlocks::set_structure(std::vector<std::vector<complex>> z, double at_rest, ModalBorder border) {
  z_ = std::move(z), at_rest_ = at_rest, border_ = std::move(border);
  const double nearly_static = follows, far_from_resonance = resonant;
  low_ = std::min(int(fewest), modes_);
  for (auto const& of_modes : z_)
    for (int j = low_; j < modes_; ++j)
      if (std::abs(of_modes[j] / at_rest - 1.0) > nearly_static) low_ = j + 1;
  low_ = std::min(low_, int(most));
  flexible_ = z_;
  for (auto& of_modes : flexible_)
    for (int j = low_; j < modes_; ++j)
      of_modes[j] =
          1.0 / (std::abs(of_modes[j] / at_rest - 1.0) < far_from_resonance ? of_modes[j] : complex(at_rest));
}

/// G of all rows of B.
void ModalBlocks::set_static_compliance() {
  const int all = basis_.rows(), high = modes_ - low_;
  double const* U = basis_.motions().data() + size_t(low_) * all;
  static_.assign(size_t(all) * all, 0.0);
  multiply("NT", {all, all, high}, 1 / at_rest_, {U, all}, {U, all}, 0.0, static_.data(), all);
  static_low_ = low_, static_at_rest_ = at_rest_;
}

/// G of rows for forces on some, column-major.
template <class Real>
std::vector<Real> ModalBlocks::static_compliance(std::vector<int> const& to,
                                                 std::vector<int> const& from) const {
  std::vector<Real> out;
  out.reserve(to.size() * from.size());
  for (const int col : from)
    for (const int row : to) out.push_back(Real(static_[size_t(col) * basis_.rows() + row]));
  return out;
}

void ModalBlocks::set_contact(std::vector<int> rows, std::vector<Entry> T) {
  const log::Span span(slipping());
  fault::point("harmonic block");
  rows_ = std::move(rows), T_ = std::move(T);
  if (!rows_.empty() && (static_low_ != low_ || static_at_rest_ != at_rest_)) set_static_compliance();
  const int r = int(rows_.size());
  auto G = static_compliance<double>(rows_, rows_);
  std::vector<double> A(G.size());
  for (int i = 0; i < r; ++i) A[size_t(i) * r + i] = 1;  // (1 + T G)^T
  for (Entry const& t : T_)
    for (int i = 0; i < r; ++i) A[size_t(t.row) * r + i] += G[size_t(t.col) * r + i] * t.value;
  const bool done = r == 0 || (r >= single && solve_quickly(A, r, G));
  if ((!done && lapack::solve(A, r, G, r)) || fault::value("harmonic block")) throw singular();
  set_inverse(G);
}

/// With R the rows so far, g = G (1 + T G)^-1 there, and S the further ones, what forces move before T of S
/// is taken is (Woodbury)
///
///     C_RS = G_RS - g T_R G_RS,  C_SR = G_SR - G_SR T_R g,  C_SS = G_SS - G_SR T_R C_RS,
///
/// and C_:R - C_:S (1 + T_S C_SS)^-1 T_S C_S: is g of all: 6 r^2 s operations instead of 8 / 3 (r + s)^3.
void ModalBlocks::add_contact(std::vector<int> const& rows, std::vector<Entry> const& T) {
  const log::Span span(slipping());
  fault::point("harmonic block");
  const int r = this->rows(), s = int(rows.size()), all = r + s;
  auto C_RS = static_compliance<float>(rows_, rows), C_SS = static_compliance<float>(rows, rows);
  auto C_SR = C_RS;  // transposed: G is symmetric
  const auto TG = times_T(C_RS, false), TtG = times_T(C_RS, true);
  const auto G_RS = C_RS;
  multiply("TN", {r, s, r}, -1.0f, {G_.data(), r}, {TG.data(), r}, 1.0f, C_RS.data(), r);
  multiply("NN", {r, s, r}, -1.0f, {G_.data(), r}, {TtG.data(), r}, 1.0f, C_SR.data(), r);
  const auto TC = times_T(C_RS, false);
  multiply("TN", {s, s, r}, -1.0f, {G_RS.data(), r}, {TC.data(), r}, 1.0f, C_SS.data(), s);
  std::vector<double> A(size_t(s) * s), W(A.size());
  for (int i = 0; i < s; ++i) A[size_t(i) * s + i] = 1;
  for (Entry const& t : T) {
    W[size_t(t.col) * s + t.row] += t.value;
    for (int j = 0; j < s; ++j) A[size_t(j) * s + t.row] += t.value * C_SS[size_t(j) * s + t.col];
  }
  if (lapack::solve(A, s, W, s) || fault::value("harmonic block")) throw singular();
  const auto W_rounded = rounded(W);
  // [C_SR C_SS]^T and [C_RS; C_SS] W of all rows, then both into the inverse
  std::vector<float> from(size_t(all) * s), onto(from.size()), moved(from.size()), g(size_t(all) * all);
  for (int j = 0; j < s; ++j) {
    std::copy_n(&C_SR[size_t(j) * r], r, &from[size_t(j) * all]);
    std::copy_n(&C_RS[size_t(j) * r], r, &onto[size_t(j) * all]);
    for (int i = 0; i < s; ++i) {
      from[size_t(j) * all + r + i] = C_SS[size_t(i) * s + j];
      onto[size_t(j) * all + r + i] = C_SS[size_t(j) * s + i];
    }
  }
  for (int a = 0; a < all; ++a) {  // column a: motion of row a, as G_ has it
    if (a < r) std::copy_n(&G_[size_t(a) * r], r, &g[size_t(a) * all]);
    for (int b = a < r ? r : 0; b < all; ++b)
      g[size_t(a) * all + b] = b < r ? from[size_t(a - r) * all + b] : onto[size_t(b - r) * all + a];
  }
  multiply("NN", {all, s, s}, 1.0f, {onto.data(), all}, {W_rounded.data(), s}, 0.0f, moved.data(), all);
  multiply("NT", {all, all, s}, -1.0f, {from.data(), all}, {moved.data(), all}, 1.0f, g.data(), all);
  for (Entry const& t : T) T_.push_back({r + t.row, r + t.col, t.value});
  rows_.insert(rows_.end(), rows.begin(), rows.end());
  set_inverse({g.begin(), g.end()});
}

/// What is made of the rows' inverse, (G (1 + T G)^-1)^T.
void ModalBlocks::set_inverse(std::vector<double> const& G) {
  const int n = modes_, k = low_, r = rows(), all = basis_.rows();
  std::vector<double> U(size_t(r) * n);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < r; ++i) U[size_t(j) * r + i] = basis_.motions()[size_t(j) * all + rows_[i]];
  std::vector<double> TU(size_t(r) * k), left(U.begin(), U.begin() + size_t(r) * k), TtU(TU.size()),
      right(size_t(k) * r);
  for (Entry const& t : T_)
    for (int l = 0; l < k; ++l) {
      TU[size_t(l) * r + t.row] += t.value * U[size_t(l) * r + t.col];
      TtU[size_t(l) * r + t.col] += t.value * U[size_t(l) * r + t.row];
    }
  for (int i = 0; i < r; ++i)
    for (int l = 0; l < k; ++l) right[size_t(i) * k + l] = U[size_t(l) * r + i];
  multiply("TN", {r, k, r}, -1.0, {G.data(), r}, {TU.data(), r}, 1.0, left.data(), r);
  multiply("TT", {k, r, r}, -1.0, {TtU.data(), r}, {G.data(), r}, 1.0, right.data(), k);
  H_.assign(size_t(k) * k, 0.0);
  multiply("TN", {k, k, r}, 1.0, {TtU.data(), r}, {left.data(), r}, 0.0, H_.data(), k);
  if (has_fundamental()) {
    U_low_.assign(U.begin(), U.begin() + size_t(r) * k);
    set_border(U);
    couple_border(G);
  }
  U_ = rounded(U), G_ = rounded(G), left_ = rounded(left), right_ = rounded(right);
  small_.clear();
  for (int i = 0; i < int(z_.size()); ++i) make_small(i);
}

/// T x, or its transpose: rows of x one after the other.
template <class Real>
std::vector<Real> ModalBlocks::times_T(std::vector<Real> const& x, bool transposed) const {
  const size_t r = rows_.size();
  std::vector<Real> out(x.size(), 0);
  for (size_t first = 0; first < x.size(); first += r)
    for (Entry const& t : T_)
      if (transposed)
        out[first + t.col] += Real(t.value) * x[first + t.row];
      else
        out[first + t.row] += Real(t.value) * x[first + t.col];
  return out;
}

template std::vector<double> ModalBlocks::times_T(std::vector<double> const&, bool) const;
template std::vector<float> ModalBlocks::times_T(std::vector<float> const&, bool) const;

void ModalBlocks::make_small(int i) {
  const int k = low_, parts = parts_[i], s = i == border_harmonic_ ? border_.scalars : 0;
  Small small{offsets_[i], parts, s, parts * k + s, {}};
  std::vector<double> N(size_t(small.size) * small.size, 0.0);
  const auto at = [&](int row, int col) -> double& { return N[size_t(col) * small.size + row]; };
  for (int part = 0; part < parts; ++part)
    for (int col = 0; col < k; ++col)
      for (int row = 0; row < k; ++row) at(part * k + row, part * k + col) = H_[size_t(col) * k + row];
  for (int l = 0; l < k; ++l) {
    const Rotation z = Rotation::of(z_[i][l]);
    at(l, l) += z.cc;
    if (parts == 1) continue;
    at(l, k + l) += z.cs, at(k + l, l) += z.sc, at(k + l, k + l) += z.ss;
  }
  if (s) add_border(small, N);
  if (lapack::invert(N, small.size))
    throw SingularBlock("a harmonic block of the preconditioner is singular: a free motion at this harmonic");
  small.inverse = std::move(N);
  small_.push_back(std::move(small));
}

std::vector<double> ModalBlocks::small_solution(Small const& small, std::vector<double> const& right) const {
  std::vector<double> x(small.size);
  const int step = 1;
  const double one = 1, zero = 0;
  dgemv_("N", &small.size, &small.size, &one, small.inverse.data(), &small.size, right.data(), &step, &zero,
         x.data(), &step);
  return x;
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
  multiply("NT", {c, r, n - k}, 1.0f, {eta.data() + size_t(c) * k, c}, {U_.data() + size_t(r) * k, r}, 0.0f,
           b.data(), c);
  t = pull(b);
  multiply("NN", {c, k, r}, -1.0f, {t.data(), c}, {U_.data(), r}, 1.0f, low.data(), c);
  for (Small const& small : small_) {
    std::vector<double> right(small.size);
    for (int part = 0; part < small.parts; ++part)
      for (int l = 0; l < k; ++l) right[part * k + l] = low[size_t(l) * c + small.at + part];
    for (int j = 0; j < small.scalars; ++j) {
      double& row = right[2 * k + j] = closing[j];
      for (int part = 0; part < 2; ++part) {
        const size_t v = size_t(2) * j + part;
        for (int l = k; l < n; ++l) row -= border_.rows[v * n + l] * eta[size_t(l) * c + small.at + part];
        for (int i = 0; i < r; ++i) row += rows_X_[v * r + i] * b[size_t(i) * c + small.at + part];
      }
    }
    const auto x = small_solution(small, right);
    for (int part = 0; part < small.parts; ++part)
      for (int l = 0; l < k; ++l) eta[size_t(l) * c + small.at + part] = float(x[part * k + l]);
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
    multiply("NN", {c, n - k, r}, -1.0f, {t.data(), c}, {U_.data() + size_t(r) * k, r}, 1.0f,
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
  multiply("NT", {c, r, modes_}, 1.0f, {modes.data(), c}, {U_.data(), r}, 0.0f, u.data(), c);
  return u;
}

void ModalBlocks::subtract(std::vector<float> const& f, std::vector<float>& forces) const {
  const int r = rows(), c = lead_;
  multiply("NN", {c, modes_, r}, -1.0f, {f.data(), c}, {U_.data(), r}, 1.0f, forces.data(), c);
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
    std::vector<double> right(small.size);
    for (int part = 0; part < small.parts; ++part)
      for (int l = 0; l < k; ++l) right[part * k + l] = low[size_t(l) * c + small.at + part];
    for (int j = 0; j < small.scalars; ++j)
      for (int part = 0; part < 2; ++part)
        for (int i = 0; i < r; ++i)
          right[2 * k + j] -=
              right_rows_[(size_t(2) * j + part) * r + i] * f[size_t(i) * c + small.at + part];
    const auto x = small_solution(small, right);
    for (int part = 0; part < small.parts; ++part)
      for (int l = 0; l < k; ++l) low[size_t(l) * c + small.at + part] = float(x[part * k + l]);
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
  std::vector<double> right(size_t(small.size) * columns), x(right.size());
  for (int row = 0; row < r; ++row)
    for (int part = 0; part < of_row; ++part) {
      double* to = right.data() + (size_t(row) * of_row + part) * small.size;
      std::copy_n(right_.data() + size_t(row) * k, k, to + part * k);
      for (int j = 0; j < small.scalars; ++j) to[2 * k + j] = -right_rows_[(size_t(2) * j + part) * r + row];
    }
  multiply("NN", {small.size, columns, small.size}, 1.0, {small.inverse.data(), small.size},
           {right.data(), small.size}, 0.0, x.data(), small.size);
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
