#include "hb/aft.h"

#include <algorithm>
#include <numbers>

namespace fretwave::hb {

namespace {

int tangent_columns(contact::Law const& law) { return law.components() * law.components() * law.pairs(); }

/// The fundamental's Im s: the angular frequency that turns sample numbers into time.
double angular_frequency(Harmonics const& h, Exponents const& e) {
  return h.fundamental() < 0 ? 1.0 : e.s[h.fundamental()].imag();
}

}  // namespace

Aft::Aft(Harmonics const& h, std::shared_ptr<contact::Law const> law)
    : harmonics_(h),
      law_(std::move(law)),
      pairs_(law_->pairs()),
      columns_(law_->components() * pairs_),
      law_samples_(h.odd_only() && law_->odd() && !law_->hereditary() ? h.samples() / 2 : h.samples()),
      transform_(h, columns_, law_->components()),
      tangent_transform_(h, law_->hereditary() ? 0 : tangent_columns(*law_)),
      velocity_(size_t(columns_) * h.block_size()) {
  const size_t n = size_t(h.samples()) * columns_;
  for (auto* samples : {&f_, &df_}) samples->resize(n);
  if (law_->uses_displacement()) u_.resize(n), du_.resize(n);
  if (law_->uses_velocity()) v_.resize(n), dv_.resize(n);
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
  if (law_->uses_displacement()) transform_.to_time(U, u_.data());
  if (law_->uses_velocity()) {
    multiply(harmonics_, e.s, U, velocity_.data(), columns_);
    transform_.to_time(velocity_.data(), v_.data());
  }
  law_->force(motion(angular_frequency(harmonics_, e)), f_.data(), record_);
  mirror(f_, -1, columns_);
  transform_.to_harmonics(f_.data(), F);
}

void Aft::product(double const* dU, double const* dV, double* dF) {
  if (columns_ == 0) return;
  if (law_->uses_displacement()) transform_.to_time(dU, du_.data());
  if (law_->uses_velocity()) transform_.to_time(dV, dv_.data());
  law_->product(motion(1), record_, du_.empty() ? nullptr : du_.data(), dv_.empty() ? nullptr : dv_.data(),
                df_.data());
  mirror(df_, -1, columns_);
  transform_.to_harmonics(df_.data(), dF);
}

/// T[pair][row][col] (m x m each): f_n = 2 G_n x_0 + sum_k G_{n-k} x_k + G_{n+k} conj(x_k) for f(t) = g(t)
/// x(t), from the FFT of g alone.
void Aft::toeplitz_hankel(std::vector<double> const& tangent, std::vector<double>& T) const {
  const int m = harmonics_.block_size(), d = law_->components(), columns = d * d * pairs_,
            N = harmonics_.samples();
  std::vector<double> samples(size_t(N) * columns), unused(size_t(columns) * m);
  std::copy_n(tangent.data(), size_t(law_samples_) * columns, samples.data());
  mirror(samples, +1, columns);
  tangent_transform_.to_harmonics(samples.data(), unused.data());
  const double scale = 1.0 / N;
  for (int c = 0; c < columns; ++c) {
    const auto G = [&](int k) {  // periodic in N, conjugate symmetric
      k = ((k % N) + N) % N;
      const complex g = tangent_transform_.spectrum()[size_t(k <= N / 2 ? k : N - k) * columns + c] * scale;
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

/// Column by column for a law with memory: one linearised march for each coefficient, of all pairs at once.
void Aft::columnwise(Exponents const& e, double* D) {
  const size_t m = harmonics_.block_size(), d = law_->components(), ld = d * m;
  std::vector<double> dU(size_t(columns_) * m), dV(dU.size()), dF(dU.size());
  for (size_t col = 0; col < ld; ++col) {
    for (int pair = 0; pair < pairs_; ++pair) dU[pair * ld + col] = 1;
    multiply(harmonics_, e.s, dU.data(), dV.data(), columns_);
    product(dU.data(), dV.data(), dF.data());
    for (int pair = 0; pair < pairs_; ++pair) {
      dU[pair * ld + col] = 0;
      for (size_t row = 0; row < ld; ++row) D[(pair * ld + row) * ld + col] = dF[pair * ld + row];
    }
  }
}

void Aft::blocks(Exponents const& e, double* D) {
  if (columns_ == 0) return;
  const int m = harmonics_.block_size(), d = law_->components();
  const size_t size = size_t(pairs_) * d * m * d * m;
  std::fill_n(D, size, 0.0);
  if (law_->hereditary()) return columnwise(e, D);
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

ContactPeriod Aft::period(double const* U, Exponents const& e) const {
  ContactPeriod out;
  for (auto* samples : {&out.u, &out.v, &out.f}) samples->resize(f_.size());
  std::vector<double> V(size_t(columns_) * harmonics_.block_size());
  multiply(harmonics_, e.s, U, V.data(), columns_);
  transform_.to_time(U, out.u.data());
  transform_.to_time(V.data(), out.v.data());
  contact::Motion whole = motion(angular_frequency(harmonics_, e));
  whole.samples = harmonics_.samples();
  whole.u = out.u.data(), whole.v = out.v.data();
  contact::Record record;
  if (columns_) law_->force(whole, out.f.data(), record);
  return out;
}

namespace {

void count(contact::Diagnosis const& diagnosis, ContactSummary& summary) {
  for (auto s : diagnosis.status)
    (s == contact::Status::stick  ? summary.stick
     : s == contact::Status::slip ? summary.slip
                                  : summary.open) += 1;
  for (double w : diagnosis.work) summary.work += w;
}

}  // namespace

ContactSummary Aft::summarise(double const* U, Exponents const& e) {
  ContactSummary summary;
  if (columns_ == 0) return summary;
  const size_t n = size_t(columns_) * harmonics_.block_size();
  std::vector<double> F(n), finer(n);
  const ContactPeriod now = period(U, e);
  transform_.to_harmonics(now.f.data(), F.data());
  std::tie(summary.truncated, summary.total) = transform_.truncated_energy();

  contact::Motion whole = motion(angular_frequency(harmonics_, e));
  whole.samples = harmonics_.samples(), whole.u = now.u.data(), whole.v = now.v.data();
  contact::Diagnosis diagnosis{std::vector<contact::Status>(size_t(whole.samples) * pairs_),
                               std::vector<double>(pairs_), std::vector<double>(pairs_)};
  law_->diagnose(whole, now.f.data(), diagnosis);
  count(diagnosis, summary);

  Aft doubled(Harmonics(harmonics_.orders(), 2 * harmonics_.samples()), law_);
  doubled.force(U, e, finer.data());
  for (size_t k = 0; k < n; ++k) {
    summary.aliased += (finer[k] - F[k]) * (finer[k] - F[k]);
    summary.retained += F[k] * F[k];
  }
  return summary;
}

}  // namespace fretwave::hb
