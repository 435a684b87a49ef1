#include "hb/harmonics.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "contact/vectorise.h"
#include "error.h"
#include "lapack.h"

namespace fretwave::hb {

Harmonics::Harmonics(std::vector<int> orders, int samples, int moving)
    : orders_(std::move(orders)), samples_(samples), moving_(moving) {
  const bool ascending =
      std::adjacent_find(orders_.begin(), orders_.end(), std::greater_equal<int>()) == orders_.end();
  const auto one = std::find(orders_.begin(), orders_.end(), 1);
  const bool statics = orders_ == std::vector<int>{0};
  if (!ascending || orders_.empty() || (one == orders_.end() && !statics) || orders_.front() < 0)
    throw InputError("retained harmonics are not usable", std::to_string(orders_.size()) + " orders",
                     "ascending orders >= 0, each once, with 1 among them", "give for example 0, 1, 2, 3");
  if (samples_ < 2 * highest() + 2 || samples_ % 2)
    throw InputError("too few time samples, or an odd number of them", std::to_string(samples_),
                     "an even number >= " + std::to_string(2 * highest() + 2),
                     "give samples = a power of two above 4 H");
  if (!moving_) moving_ = highest();
  if (!statics) fundamental_ = int(one - orders_.begin());
  for (int n : orders_) {
    offsets_.push_back(block_size_);
    block_size_ += n ? 2 : 1;
  }
}

bool Harmonics::odd_only() const {
  return std::all_of(orders_.begin(), orders_.end(), [](int n) { return n % 2 == 1; });
}

std::vector<complex> conjugate(std::vector<complex> factor) {
  for (complex& c : factor) c = std::conj(c);
  return factor;
}

void embed(Harmonics const& from, double const* x, Harmonics const& to, double* y, int columns) {
  std::fill_n(y, size_t(columns) * to.block_size(), 0.0);
  for (int i = 0; i < from.count(); ++i) {
    const int n = from.orders()[i];
    const auto at = std::find(to.orders().begin(), to.orders().end(), n);
    if (at == to.orders().end()) continue;
    const int a = from.offset(i), b = to.offset(int(at - to.orders().begin()));
    for (int c = 0; c < columns; ++c)
      std::copy_n(x + size_t(c) * from.block_size() + a, n ? 2 : 1, y + size_t(c) * to.block_size() + b);
  }
}

void multiply(Harmonics const& h, std::vector<complex> const& s, double const* x, double* y, int columns) {
  const int m = h.block_size();
  for (int c = 0; c < columns; ++c)
    for (int i = 0; i < h.count(); ++i) {
      const size_t k = size_t(c) * m + h.offset(i);
      if (h.orders()[i] == 0) {
        y[k] = s[i].real() * x[k];
        continue;
      }
      // (Qc - i Qs)(a + i b) = (a Qc + b Qs) - i (a Qs - b Qc): the real 2x2 block of nabla_n (Laxalde et al.
      // 2008, eq. 6)
      const double a = s[i].real(), b = s[i].imag(), cosine = x[k], sine = x[k + 1];
      y[k] = a * cosine + b * sine;
      y[k + 1] = a * sine - b * cosine;
    }
}

namespace {

/// A table costs 2 m flops a sample, an FFT 2.5 log2(N_t) at a small fraction of that speed: measured in
/// tiles of 32 and 64 pairs with N_t = 64 to 1024, they are even at m of 20 to 25 log2(N_t).
bool by_table(Harmonics const& h) { return h.block_size() <= 20 * std::log2(double(h.samples())); }

/// cos of p quarter turns / N, with the symmetries of the circle exact: zeros are zero.
double cosine(long p, int N) {
  p = (p % (4L * N) + 4L * N) % (4L * N);
  p = std::min(p, 4L * N - p);
  if (p > N) return -cosine(2L * N - p, N);
  return p == N ? 0.0 : std::cos(std::numbers::pi / 2 * double(p) / N);
}

/// (a, b) to (a + b, a - b).
FRETWAVE_VECTORISE void unfold(size_t size, double* a, double* b) {
#pragma omp simd
  for (size_t k = 0; k < size; ++k) {
    const double even = a[k], odd = b[k];
    a[k] = even + odd, b[k] = even - odd;
  }
}

/// Sums, then differences, of x less its middle and what stands half a period later.
FRETWAVE_VECTORISE void fold(int half, int columns, double const* x, double const* middle, double* y) {
  double const* later = x + size_t(half) * columns;
  double* difference = y + size_t(half) * columns;
  for (int t = 0; t < half; ++t, x += columns, later += columns, y += columns, difference += columns)
#pragma omp simd
    for (int c = 0; c < columns; ++c) {
      y[c] = (x[c] - middle[c]) + (later[c] - middle[c]);
      difference[c] = x[c] - later[c];
    }
}

}  // namespace

FourierTransform::FourierTransform(Harmonics const& h, int columns, int components)
    : harmonics_(h), columns_(columns), rows_(h.samples() / 2 + 1), table_(by_table(h)) {
  const int m = h.block_size(), pairs = columns / components;
  for (int c = 0; c < columns; ++c) block_.push_back((size_t(c % pairs) * components + c / pairs) * m);
  if (columns && table_) make_halves();
}

namespace {

/// visit(sample, place in the block, order, 1 or cosine or sine, its weight in to_harmonics) for the first
/// `count` samples: Laxalde et al. 2008, eq. 9a-c.
template <class Visit>
void each_entry(Harmonics const& h, int count, Visit visit) {
  const int N = h.samples();
  std::vector<double> circle[2];  // cos and sin of 2 pi k / N
  for (long k = 0; k < N; ++k)
    circle[0].push_back(cosine(4 * k, N)), circle[1].push_back(cosine(4 * k - N, N));
  for (int t = 0; t < count; ++t)
    for (int i = 0; i < h.count(); ++i) {
      const int n = h.orders()[i];
      for (int part = 0; part < (n ? 2 : 1); ++part) {
        const double value = circle[part][long(n) * t % N];
        visit(t, size_t(h.offset(i) + part), n, value, (n ? 2.0 : 1.0) / N * value);
      }
    }
}

}  // namespace

void FourierTransform::make_halves() {
  const int half = harmonics_.samples() / 2;
  for (int i = 0; i < harmonics_.count(); ++i)
    for (int part = 0; part < (harmonics_.orders()[i] ? 2 : 1); ++part)
      halves_[harmonics_.orders()[i] % 2].places.push_back(size_t(harmonics_.offset(i) + part));
  double *synthesis[2], *analysis[2];
  for (int parity = 0; parity < 2; ++parity) {
    Half& now = halves_[parity];
    now.synthesis.resize(now.places.size() * half), now.analysis.resize(now.synthesis.size());
    synthesis[parity] = now.synthesis.data(), analysis[parity] = now.analysis.data();
  }
  each_entry(harmonics_, half, [&](int, size_t, int n, double value, double weight) {
    *synthesis[n % 2]++ = value, *analysis[n % 2]++ = weight;
  });
}

void FourierTransform::make_tables() const {
  const size_t m = harmonics_.block_size();
  synthesis_.resize(harmonics_.samples() * m), analysis_.resize(synthesis_.size());
  each_entry(harmonics_, harmonics_.samples(), [&](int t, size_t place, int, double value, double weight) {
    synthesis_[t * m + place] = value, analysis_[t * m + place] = weight;
  });
}

/// ESTIMATE: the same plan, hence the same rounding, in every run and on every rank count.
void FourierTransform::plan(bool forward) const {
  auto& plan = forward ? forward_ : backward_;
  if (plan || columns_ == 0) return;
  int n = harmonics_.samples();
  std::unique_ptr<double, FreeMemory> time(fftw_alloc_real(size_t(n) * columns_));
  if (!spectrum_) spectrum_.reset(fftw_alloc_complex(size_t(rows_) * columns_));
  plan.reset(forward
                 ? fftw_plan_many_dft_r2c(1, &n, columns_, time.get(), nullptr, columns_, 1, spectrum_.get(),
                                          nullptr, columns_, 1,
                                          FFTW_ESTIMATE | FFTW_PRESERVE_INPUT | FFTW_UNALIGNED)
                 : fftw_plan_many_dft_c2r(1, &n, columns_, spectrum_.get(), nullptr, columns_, 1, time.get(),
                                          nullptr, columns_, 1, FFTW_ESTIMATE | FFTW_UNALIGNED));
}

/// Even orders repeat after half a period, odd ones change sign: x(t), x(t + T/2) = even(t) +- odd(t).
void FourierTransform::by_halves(double const* blocks, double* samples) const {
  const int half = harmonics_.samples() / 2;
  const size_t size = size_t(half) * columns_;
  const double one = 1, zero = 0;
  for (int parity = 0; parity < 2; ++parity) {
    Half const& part = halves_[parity];
    const int m = int(part.places.size()), ld = std::max(1, m);
    packed_.resize(size_t(m) * columns_);
    for (int k = 0; k < m; ++k)
      for (int c = 0; c < columns_; ++c)
        packed_[size_t(k) * columns_ + c] = blocks[block_[c] + part.places[k]];
    dgemm_("N", "N", &columns_, &half, &m, &one, packed_.data(), &columns_, part.synthesis.data(), &ld, &zero,
           samples + parity * size, &columns_);
  }
  unfold(size, samples, samples + size);
}

/// Less the middle of two samples half a period apart: a constant, however large, leaves nothing in the
/// orders above 0, and a half-wave symmetric x nothing in the even ones.
void FourierTransform::from_halves(double const* samples, double* blocks) const {
  const int half = harmonics_.samples() / 2;
  const size_t size = size_t(half) * columns_;
  const double one = 1, zero = 0;
  sums_.resize(2 * size), middle_.resize(columns_);
  for (int c = 0; c < columns_; ++c) middle_[c] = 0.5 * (samples[c] + samples[size + c]);
  fold(half, columns_, samples, middle_.data(), sums_.data());
  for (int parity = 0; parity < 2; ++parity) {
    Half const& part = halves_[parity];
    const int m = int(part.places.size()), ld = std::max(1, m);
    packed_.resize(size_t(m) * columns_);
    dgemm_("N", "T", &columns_, &m, &half, &one, sums_.data() + parity * size, &columns_,
           part.analysis.data(), &ld, &zero, packed_.data(), &columns_);
    for (int k = 0; k < m; ++k)
      for (int c = 0; c < columns_; ++c)
        blocks[block_[c] + part.places[k]] = packed_[size_t(k) * columns_ + c];
  }
  if (harmonics_.orders()[0] == 0)
    for (int c = 0; c < columns_; ++c) blocks[block_[c]] += middle_[c];
}

void FourierTransform::to_time(double const* blocks, double* samples) const {
  if (columns_ == 0) return;
  if (table_) return by_halves(blocks, samples);
  plan(false);
  auto* spectrum = reinterpret_cast<complex*>(spectrum_.get());
  std::fill_n(spectrum, size_t(rows_) * columns_, complex(0));
  for (int i = 0; i < harmonics_.count(); ++i) {
    const int n = harmonics_.orders()[i];
    complex* row = spectrum + size_t(n) * columns_;
    double const* x = blocks + harmonics_.offset(i);
    // x(t) = Re sum q_n e^{i n tau}: half of q_n at +n, the other half is implied by the real output.
    for (int c = 0; c < columns_; ++c)
      row[c] = n ? 0.5 * complex(x[block_[c]], -x[block_[c] + 1]) : complex(x[block_[c]]);
  }
  fftw_execute_dft_c2r(backward_.get(), spectrum_.get(), samples);
}

void FourierTransform::to_harmonics(double const* samples, double* blocks) const {
  if (columns_ == 0) return;
  if (table_) return from_halves(samples, blocks);
  const double scale = 1.0 / harmonics_.samples();
  complex const* found = spectrum(samples);
  for (int i = 0; i < harmonics_.count(); ++i) {
    const int n = harmonics_.orders()[i];
    complex const* row = found + size_t(n) * columns_;
    double* f = blocks + harmonics_.offset(i);
    for (int c = 0; c < columns_; ++c) {
      f[block_[c]] = (n ? 2 : 1) * scale * row[c].real();
      if (n) f[block_[c] + 1] = -2 * scale * row[c].imag();
    }
  }
}

complex const* FourierTransform::spectrum(double const* samples) const {
  plan(true);
  if (columns_) fftw_execute_dft_r2c(forward_.get(), const_cast<double*>(samples), spectrum_.get());
  return reinterpret_cast<complex const*>(spectrum_.get());
}

std::pair<double, double> FourierTransform::truncated_energy(double const* samples,
                                                             double const* blocks) const {
  const size_t n = size_t(columns_);
  std::vector<double> left(samples, samples + harmonics_.samples() * n), retained(left.size());
  to_time(blocks, retained.data());
  double outside = 0, total = 0;
  const auto varying = [&](std::vector<double> const& x, size_t c) {
    double mean = 0, square = 0;
    for (size_t k = c; k < x.size(); k += n) mean += x[k] / harmonics_.samples();
    for (size_t k = c; k < x.size(); k += n) square += (x[k] - mean) * (x[k] - mean);
    return square;
  };
  for (size_t c = 0; c < n; ++c) total += varying(left, c);
  for (size_t k = 0; k < left.size(); ++k) left[k] -= retained[k];
  for (size_t c = 0; c < n; ++c) outside += varying(left, c);
  return {outside, total};
}

}  // namespace fretwave::hb
