#include "wheel/wave_inverses.h"

#include <algorithm>

#include "error.h"
#include "fault.h"
#include "lapack.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::wheel {

namespace {

const Tuned far("wheel_far", 1e-2, "relative change of the exponents that makes the blocks stale");

}  // namespace

WaveInverses::WaveInverses(HarmonicProblem& problem, MeanSector const& mean,
                           std::vector<Circulant<SparseBlock>> terms, WheelContact& contact,
                           std::vector<Wave> const& waves)
    : problem_(problem),
      mean_(mean),
      terms_(std::move(terms)),
      contact_(contact),
      waves_(waves),
      n_(mean.dofs()),
      symmetric_(
          std::ranges::all_of(terms_, [&](auto const& term) { return symmetric(term, mean.sectors()); })) {
  size_t next = 0;  // a wave's mirror follows it
  for (size_t w = 0; w < waves_.size(); ++w) {
    at_.push_back(transposed(w) ? at_.back() : next);
    if (!transposed(w)) next += size_t(n_) * n_;
    B_.push_back(mean.rows_of(waves_[w].diameter, contact));
  }
  inverses_.resize(next);
}

bool WaveInverses::moved(Exponents const& e) const {
  if (!made_at_ || made_in_ != problem_.stiffness_scale()) return true;
  double change = std::abs(e.inertia_damping - made_at_->inertia_damping), size = 0;
  for (size_t i = 0; i < e.s.size(); ++i) {
    change = std::max(change, std::abs(e.s[i] - made_at_->s[i]));
    size = std::max(size, std::abs(e.s[i]));
  }
  return change > far * size;
}

/// Structure and contact of a harmonic, by sectors ahead.
Circulant<std::vector<complex>> WaveInverses::blocks(int harmonic, Exponents const& e) const {
  Circulant<std::vector<complex>> out;
  const int N = mean_.sectors();
  const auto block = [&](int k) -> std::vector<complex>& {
    auto& A = out[k];
    A.resize(size_t(n_) * n_);
    return A;
  };
  for (size_t j = 0; j < terms_.size(); ++j) {
    const complex c = problem_.terms().stiffness().coefficients(problem_.model().terms()[j], e)[harmonic] /
                      problem_.stiffness_scale();
    for (auto const& [k, A] : terms_[j]) {
      auto& sum = block(k);
      for_entries(A, [&](int row, int column, double a) { sum[size_t(column) * n_ + row] += c * a; });
    }
  }
  std::vector<std::vector<WheelContact::Entry>> by_row(contact_.rows());
  for (auto const& b : contact_.entries()) by_row[b.row].push_back(b);
  contact_.for_tangents(harmonic, [&](int r, int c, complex t) {
    for (auto const& a : by_row[r])
      for (auto const& b : by_row[c])
        block((b.ahead - a.ahead + N) % N)[size_t(mean_.place(b.dof)) * n_ + mean_.place(a.dof)] +=
            a.value * b.value * t;
  });
  return out;
}

void WaveInverses::invert(size_t wave, Circulant<std::vector<complex>> const& blocks) {
  auto P = mean_.of_wave(blocks, waves_[wave].diameter);
  fault::point("wave block");
  const int info = lapack::invert(P, n_);
  if (info != 0 || fault::value("wave block"))
    throw SingularBlock("the block of nodal diameter " + std::to_string(waves_[wave].diameter) +
                        " of the wheel's preconditioner is singular (LAPACK info " + std::to_string(info) +
                        "): a free motion at this harmonic");
  std::copy(P.begin(), P.end(), inverses_.begin() + at_[wave]);
}

/// Those that are selected, a wave and its mirror together.
template <class Select>
void WaveInverses::invert(Select select, Exponents const& e) {
  for (int harmonic = 0; harmonic < problem_.harmonics().count(); ++harmonic) {
    Circulant<std::vector<complex>> A;
    for (size_t w = 0; w < waves_.size(); ++w) {
      if (waves_[w].harmonic != harmonic || transposed(w) || !select(waves_[w])) continue;
      if (A.empty()) A = blocks(harmonic, e);
      invert(w, A);
    }
  }
}

void WaveInverses::make(Point const& point) {
  Exponents const& e = point.exponents;
  const int first = problem_.harmonics().fundamental();
  const bool all = moved(e);
  const Exponents kept = made_at_.value_or(e);
  made_at_.reset();  // until every rank has its blocks
  if (all) contact_.average(symmetric_);
  const auto moves = [&](Wave const& wave) {
    return point.moving[wave.diameter] || point.moving[(mean_.sectors() - wave.diameter) % mean_.sectors()];
  };
  together(problem_.comm(), "inverting the waves' blocks", [&] {
    if (all) invert([&](Wave const& wave) { return wave.harmonic != first; }, e);
    invert([&](Wave const& wave) { return wave.harmonic == first && !moves(wave); }, e);
    invert([&](Wave const& wave) { return wave.harmonic == first && moves(wave); }, beside(e, first));
    set_compliances();
  });
  made_at_ = all ? e : kept, made_in_ = problem_.stiffness_scale();
}

void WaveInverses::set_compliances() {
  const int c = contact_.rows(), k = mean_.contact_dofs();
  compliances_.assign(B_.size() * c * c, 0.0);
  std::vector<complex> VB(size_t(k) * c);
  for (size_t w = 0; w < B_.size(); ++w) {
    std::ranges::fill(VB, 0);
    for (int r = 0; r < c; ++r)
      for (int j = 0; j < k; ++j)
        if (const complex b = B_[w][size_t(r) * k + j]; b != 0.0)
          for (int i = 0; i < k; ++i) VB[size_t(r) * k + i] += complex(entry(w, i, j)) * std::conj(b);
    for (int a = 0; a < c; ++a)
      for (int i = 0; i < k; ++i)
        if (const complex b = B_[w][size_t(a) * k + i]; b != 0.0)
          for (int r = 0; r < c; ++r) compliances_[(w * c + a) * c + r] += b * VB[size_t(r) * k + i];
  }
}

std::vector<scomplex> WaveInverses::multiply(size_t wave, int columns, complex const* x) const {
  std::vector<scomplex> in(x, x + columns);
  if (!transposed(wave)) return lapack::product(n_, columns, place(wave), std::move(in));
  const int step = 1;
  const scomplex one = 1, zero = 0;
  std::vector<scomplex> out(n_);  // rows of the mirror's inverse
  cgemv_("T", &columns, &n_, &one, place(wave), &n_, in.data(), &step, &zero, out.data(), &step);
  return out;
}

std::vector<complex> WaveInverses::solve(std::vector<complex> const& x, Forces const& forces) const {
  const int c = contact_.rows(), k = mean_.contact_dofs();
  std::vector<complex> q(x.size()), u(B_.size() * c), g(k);
  for (size_t w = 0; w < B_.size(); ++w) {
    std::ranges::copy(multiply(w, n_, &x[w * n_]), &q[w * n_]);
    for (int r = 0; r < c; ++r)
      for (int i = 0; i < k; ++i) u[w * c + r] += B_[w][size_t(r) * k + i] * q[w * n_ + i];
  }
  if (c == 0) return q;
  const auto f = forces(u);
  for (size_t w = 0; w < B_.size(); ++w) {
    std::ranges::fill(g, 0);
    for (int r = 0; r < c; ++r)
      for (int i = 0; i < k; ++i) g[i] += std::conj(B_[w][size_t(r) * k + i]) * f[w * c + r];
    const auto added = multiply(w, k, g.data());
    for (int i = 0; i < n_; ++i) q[w * n_ + i] -= added[i];
  }
  return q;
}

/// The fundamental's, 8 n^3 each.
double WaveInverses::flops() const {
  const double n = n_, mine = double(std::ranges::count_if(waves_, [this](Wave const& wave) {
                         return wave.harmonic == problem_.harmonics().fundamental();
                       }));
  return 8 * n * n * n * (symmetric_ ? mine / 2 : mine);
}

}  // namespace fretwave::wheel
