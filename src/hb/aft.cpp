#include "hb/aft.h"

#include <algorithm>
#include <numbers>

#include "lapack.h"

namespace fretwave::hb {

namespace {

int tangent_columns(contact::Law const& law) { return law.components() * law.components() * law.pairs(); }

}  // namespace

Aft::Aft(Harmonics const& h, std::shared_ptr<contact::Law const> law)
    : harmonics_(h),
      law_(std::move(law)),
      pairs_(law_->pairs()),
      columns_(law_->components() * pairs_),
      law_samples_(h.odd_only() && law_->odd() ? h.samples() / 2 : h.samples()),
      continuous_(continuous_force(h, *law_)),
      transform_(h, continuous_ ? 0 : columns_, law_->components()),
      tangent_transform_(h, continuous_ ? 0 : tangent_columns(*law_)) {
  const size_t n = continuous_ ? 0 : size_t(h.samples()) * columns_;
  f_.resize(n);
  if (law_->uses_displacement()) u_.resize(n);
  if (law_->uses_velocity()) v_.resize(n), velocity_.resize(size_t(columns_) * h.block_size());
}

/// The fundamental's Im s turns sample numbers into time.
double Aft::angular_frequency(Exponents const& e) const {
  return harmonics_.fundamental() < 0 ? 1.0 : e.s[harmonics_.fundamental()].imag();
}

contact::Motion Aft::motion(double omega) const {
  return {.samples = law_samples_,
          .components = law_->components(),
          .pairs = pairs_,
          .u = u_.empty() ? nullptr : u_.data(),
          .v = v_.empty() ? nullptr : v_.data(),
          .step = 2 * std::numbers::pi / (omega * harmonics_.samples())};
}

/// Second half of a half-wave symmetric period from its first half.
void Aft::mirror(std::vector<double>& samples, double sign, int columns) const {
  if (law_samples_ == harmonics_.samples()) return;
  const size_t half = size_t(law_samples_) * columns;
  for (size_t k = 0; k < half; ++k) samples[half + k] = sign * samples[k];
}

void Aft::force(double const* U, Exponents const& e, double* F) {
  if (columns_ == 0) return;
  if (law_->uses_velocity()) multiply(harmonics_, e.s, U, velocity_.data(), columns_);
  if (continuous_) return continuous_->force(U, law_->uses_velocity() ? velocity_.data() : nullptr, F);
  if (law_->uses_displacement()) transform_.to_time(U, u_.data());
  if (law_->uses_velocity()) transform_.to_time(velocity_.data(), v_.data());
  law_->force(motion(angular_frequency(e)), f_.data(), record_);
  mirror(f_, -1, columns_);
  transform_.to_harmonics(f_.data(), F);
}

std::uint64_t Aft::piece(bool finely) const { return continuous_ ? continuous_->piece(finely) : 0; }

std::uint64_t Aft::piece_of(double const* U, Exponents const& e, bool finely) {
  if (columns_ == 0 || !continuous_) return 0;
  if (const auto known = continuous_->piece_of(U, finely)) return *known;
  std::vector<double> F(size_t(columns_) * harmonics_.block_size());
  force(U, e, F.data());
  return piece(finely);
}

void Aft::product(double const* dU, double const* dV, double* dF) {
  if (columns_ == 0) return;
  if (continuous_) return continuous_->product(dU, dV, dF);
  if (law_->uses_displacement()) transform_.to_time(dU, u_.data());
  if (law_->uses_velocity()) transform_.to_time(dV, v_.data());
  const contact::Motion motion = this->motion(1);
  law_->product(motion, record_, motion.u, motion.v, f_.data());
  mirror(f_, -1, columns_);
  transform_.to_harmonics(f_.data(), dF);
}

void Aft::gap_product(double const* dgap, double* dF) {
  if (columns_ == 0) return;
  if (continuous_) return continuous_->gap_product(dgap, dF);
  const int d = law_->components(), normal = std::max(law_->normal(), 0);
  const contact::Motion motion = this->motion(1);
  std::fill_n(u_.data(), motion.size(), 0.0);
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < pairs_; ++i) u_[(size_t(t) * d + normal) * pairs_ + i] = -dgap[i];
  law_->product(motion, record_, motion.u, nullptr, f_.data());
  transform_.to_harmonics(f_.data(), dF);
}

/// T[pair][row][col] (m x m each): f_n = 2 G_n x_0 + sum_k G_{n-k} x_k + G_{n+k} conj(x_k) for f(t) = g(t)
/// x(t), from the FFT of g alone.
void Aft::toeplitz_hankel(std::vector<double> const& tangent, std::vector<double>& T) const {
  const int m = harmonics_.block_size(), d = law_->components(), columns = d * d * pairs_,
            N = harmonics_.samples();
  std::vector<double> samples(size_t(N) * columns);
  std::copy_n(tangent.data(), size_t(law_samples_) * columns, samples.data());
  mirror(samples, +1, columns);
  complex const* spectrum = tangent_transform_.spectrum(samples.data());
  const double scale = 1.0 / N;
  for (int c = 0; c < columns; ++c) {
    const auto G = [&](int k) {  // periodic in N, conjugate symmetric
      k = ((k % N) + N) % N;
      const complex g = spectrum[size_t(k <= N / 2 ? k : N - k) * columns + c] * scale;
      return k <= N / 2 ? g : std::conj(g);
    };
    const int pair = c % pairs_, row = c / pairs_ / d, col = (c / pairs_) % d;
    double* block = T.data() + ((size_t(pair) * d + row) * m * d + col) * m;
    const size_t ld = size_t(d) * m;
    for (int i = 0; i < harmonics_.count(); ++i)
      for (int j = 0; j < harmonics_.count(); ++j) {
        const int n = harmonics_.orders()[i], k = harmonics_.orders()[j];
        double* b = block + size_t(harmonics_.offset(i)) * ld + harmonics_.offset(j);
        const complex minus = G(n - k), plus = G(n + k);
        if (n && k) {
          b[0] = minus.real() + plus.real(), b[1] = minus.imag() - plus.imag();
          b[ld] = -minus.imag() - plus.imag(), b[ld + 1] = minus.real() - plus.real();
        } else if (n) {
          b[0] = 2 * minus.real(), b[ld] = -2 * minus.imag();
        } else if (k) {
          b[0] = plus.real(), b[1] = -plus.imag();
        } else {
          b[0] = minus.real();
        }
      }
  }
}

void Aft::blocks(Exponents const& e, double* D) {
  if (columns_ == 0) return;
  if (continuous_) return continuous_->blocks(e, D);
  const int m = harmonics_.block_size(), d = law_->components();
  const size_t size = size_t(pairs_) * d * m * d * m;
  std::fill_n(D, size, 0.0);
  std::vector<double> T(size);
  if (!record_.df_du.empty()) {
    toeplitz_hankel(record_.df_du, T);
    std::copy(T.begin(), T.end(), D);
  }
  if (record_.df_dv.empty()) return;
  toeplitz_hankel(record_.df_dv, T);
  // D += T S: columns of the velocity's block recombined by the 2x2 of s_k
  for (size_t row = 0; row < size_t(pairs_) * d * m; ++row)
    for (int col = 0; col < d; ++col)
      for (int j = 0; j < harmonics_.count(); ++j) {
        const size_t k = (row * d + col) * m + harmonics_.offset(j);
        const double a = e.s[j].real(), b = e.s[j].imag();
        if (harmonics_.orders()[j] == 0) {
          D[k] += a * T[k];
          continue;
        }
        D[k] += a * T[k] - b * T[k + 1];
        D[k + 1] += b * T[k] + a * T[k + 1];
      }
}

}  // namespace fretwave::hb
