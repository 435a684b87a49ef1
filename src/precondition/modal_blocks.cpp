#include "precondition/modal_blocks.h"

#include <algorithm>
#include <cmath>
#include <optional>

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
const Tuned most("modes_most", 512, "modes that move with inertia, at the most");
const Tuned single("modes_single", 256, "slipping rows from which they are inverted in single precision");
constexpr float regular = 1e-3f;  // least over largest pivot, down to which that is exact enough

using lapack::multiply;

std::vector<float> rounded(std::vector<double> const& x) { return {x.begin(), x.end()}; }
std::vector<float> rounded(std::vector<float> x) { return x; }

log::Event const& slipping() {
  static const log::Event event("FwSlipInverse");
  return event;
}

SingularBlock singular() {
  return SingularBlock("the slipping pairs' block of the preconditioner is singular: a free motion");
}

/// A^-1 G in single precision; none where A is too near a singular one.
std::optional<std::vector<float>> solved_quickly(std::vector<double> const& A, int n,
                                                 std::vector<double> const& G) {
  auto factor = rounded(A), found = rounded(G);
  if (lapack::solve(factor, n, found, n)) return {};
  float least = INFINITY, largest = 0;
  for (int i = 0; i < n; ++i) {
    const float pivot = std::abs(factor[size_t(i) * n + i]);
    least = std::min(least, pivot), largest = std::max(largest, pivot);
  }
  if (!(least >= regular * largest)) return {};
  return found;
}

template <class T>
void invert(std::vector<T>& N, int n) {
  if (lapack::invert(N, n))
    throw SingularBlock("a harmonic block of the preconditioner is singular: a free motion at this harmonic");
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
  low_ = std::min(fewest.count(), modes_);
  for (auto const& of_modes : z_)
    for (int j = low_; j < modes_; ++j)
      if (std::abs(of_modes[j] / at_rest - 1.0) > nearly_static) low_ = j + 1;
  low_ = std::min(low_, most.count());
  flexible_ = z_;
  for (auto& of_modes : flexible_)
    for (int j = low_; j < modes_; ++j)
      of_modes[j] =
          1.0 / (std::abs(of_modes[j] / at_rest - 1.0) < far_from_resonance ? of_modes[j] : complex(at_rest));
  if (has_fundamental()) set_border();
}

/// G of all rows of B.
void ModalBlocks::set_static_compliance() {
  const int all = basis_.rows(), high = modes_ - low_;
  double const* U = basis_.motions().data() + size_t(low_) * all;
  static_.assign(size_t(all) * all, 0.0);
  lapack::add_squares(all, high, 1 / at_rest_, U, static_.data());
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

/// Of further rows, behind those that there are: their motions, and what the border moves of them.
void ModalBlocks::take_rows(std::vector<int> const& rows) {
  const size_t n = modes_, all = basis_.rows(), before = rows_.size();
  motions_.resize((before + rows.size()) * n);
  for (size_t l = 0; l < n; ++l) {
    double const* U = basis_.motions().data() + l * all;
    for (size_t i = 0; i < rows.size(); ++i) motions_[(before + i) * n + l] = float(U[rows[i]]);
  }
  if (has_fundamental()) border_rows(rows);
  rows_.insert(rows_.end(), rows.begin(), rows.end());
}

void ModalBlocks::set_contact(std::vector<int> const& rows, std::vector<Entry> T) {
  const log::Span span(slipping());
  fault::point("harmonic block");
  rows_.clear(), motions_.clear(), columns_.clear(), rows_of_forces_.clear();
  T_ = std::move(T);
  if (!rows.empty() && (static_low_ != low_ || static_at_rest_ != at_rest_)) set_static_compliance();
  take_rows(rows);
  const int r = int(rows_.size());
  auto G = static_compliance<double>(rows_, rows_);
  std::vector<double> A(G.size());
  for (int i = 0; i < r; ++i) A[size_t(i) * r + i] = 1;  // (1 + T G)^T
  for (Entry const& t : T_)
    for (int i = 0; i < r; ++i) A[size_t(t.row) * r + i] += G[size_t(t.col) * r + i] * t.value;
  const bool failed = fault::value("harmonic block");
  if (auto quickly = r >= single && !failed ? solved_quickly(A, r, G) : std::nullopt)
    return set_inverse(std::move(*quickly));
  if (failed || (r > 0 && lapack::solve(A, r, G, r))) throw singular();
  set_inverse(std::move(G));
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
  take_rows(rows);
  set_inverse(std::move(g));
}

/// What is made of the rows' inverse, (G (1 + T G)^-1)^T.
template <class Real>
void ModalBlocks::set_inverse(std::vector<Real> G) {
  const int k = low_, r = rows(), all = basis_.rows();
  std::vector<Real> left(size_t(r) * k), right(left.size());
  for (int l = 0; l < k; ++l)
    for (int i = 0; i < r; ++i)
      left[size_t(l) * r + i] = right[size_t(i) * k + l] = Real(basis_.motions()[size_t(l) * all + rows_[i]]);
  const auto TU = times_T(left, false), TtU = times_T(left, true);
  multiply("TN", {r, k, r}, Real(-1), {G.data(), r}, {TU.data(), r}, Real(1), left.data(), r);
  multiply("TT", {k, r, r}, Real(-1), {TtU.data(), r}, {G.data(), r}, Real(1), right.data(), k);
  const std::vector<double> U_T(TtU.begin(), TtU.end()), exactly(left.begin(), left.end());
  H_.assign(size_t(k) * k, 0.0);
  multiply("TN", {k, k, r}, 1.0, {U_T.data(), r}, {exactly.data(), r}, 0.0, H_.data(), k);
  if (has_fundamental()) couple_border(G);
  G_ = rounded(std::move(G)), left_ = rounded(std::move(left)), right_ = rounded(std::move(right));
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
  const int parts = parts_[i], s = i == border_harmonic_ ? border_.scalars : 0;
  Small small{offsets_[i], parts, s, parts * low_ + s, {}, {}};
  if (parts == 2 && s == 0)
    small.complex_inverse = inverse(z_[i]);
  else
    small.real_inverse = inverse(small, z_[i]);
  small_.push_back(std::move(small));
}

double ModalBlocks::small_flops() const {
  double flops = 0;
  for (Small const& small : small_)
    flops += small.complex_inverse.empty() ? 2 * std::pow(small.size, 3) : 8 * std::pow(low_, 3);
  return flops;
}

/// (z + H)^-1
std::vector<std::complex<float>> ModalBlocks::inverse(std::vector<complex> const& z) const {
  const int k = low_;
  std::vector<complex> N(H_.begin(), H_.end());
  for (int l = 0; l < k; ++l) N[size_t(l) * k + l] += z[l];
  invert(N, k);
  return {N.begin(), N.end()};
}

std::vector<double> ModalBlocks::inverse(Small const& small, std::vector<complex> const& z) const {
  const int k = low_, parts = small.parts;
  std::vector<double> N(size_t(small.size) * small.size, 0.0);
  const auto at = [&](int row, int col) -> double& { return N[size_t(col) * small.size + row]; };
  for (int part = 0; part < parts; ++part)
    for (int col = 0; col < k; ++col)
      for (int row = 0; row < k; ++row) at(part * k + row, part * k + col) = H_[size_t(col) * k + row];
  for (int l = 0; l < k; ++l) {
    const Rotation turn = Rotation::of(z[l]);
    at(l, l) += turn.cc;
    if (parts == 1) continue;
    at(l, k + l) += turn.cs, at(k + l, l) += turn.sc, at(k + l, k + l) += turn.ss;
  }
  if (small.scalars) add_border(small, N);
  invert(N, small.size);
  return N;
}

}  // namespace fretwave::precondition
