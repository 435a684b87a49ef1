#include "hb/harmonics.h"

#include <algorithm>
#include <cstring>

#include "error.h"

namespace fretwave::hb {

Harmonics::Harmonics(std::vector<int> orders, int samples) : orders_(std::move(orders)), samples_(samples) {
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
  if (!statics) fundamental_ = int(one - orders_.begin());
  for (int n : orders_) {
    offsets_.push_back(block_size_);
    block_size_ += n ? 2 : 1;
  }
}

bool Harmonics::odd_only() const {
  return std::all_of(orders_.begin(), orders_.end(), [](int n) { return n % 2 == 1; });
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

FourierTransform::FourierTransform(Harmonics const& h, int columns, int components)
    : harmonics_(h), columns_(columns), rows_(h.samples() / 2 + 1) {
  if (columns == 0) return;
  const int pairs = columns / components;
  for (int c = 0; c < columns; ++c)
    block_.push_back(size_t(c % pairs * components + c / pairs) * h.block_size());
  int n = h.samples();
  time_.reset(fftw_alloc_real(size_t(n) * columns));
  spectrum_.reset(fftw_alloc_complex(size_t(rows_) * columns));
  // ESTIMATE: the same plan, hence the same rounding, in every run and on every rank count.
  backward_.reset(fftw_plan_many_dft_c2r(1, &n, columns, spectrum_.get(), nullptr, columns, 1, time_.get(),
                                         nullptr, columns, 1, FFTW_ESTIMATE | FFTW_UNALIGNED));
  forward_.reset(fftw_plan_many_dft_r2c(1, &n, columns, time_.get(), nullptr, columns, 1, spectrum_.get(),
                                        nullptr, columns, 1,
                                        FFTW_ESTIMATE | FFTW_PRESERVE_INPUT | FFTW_UNALIGNED));
}

void FourierTransform::to_time(double const* blocks, double* samples) const {
  if (columns_ == 0) return;
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
  fftw_execute_dft_r2c(forward_.get(), const_cast<double*>(samples), spectrum_.get());
  const double scale = 1.0 / harmonics_.samples();
  for (int i = 0; i < harmonics_.count(); ++i) {
    const int n = harmonics_.orders()[i];
    complex const* row = spectrum() + size_t(n) * columns_;
    double* f = blocks + harmonics_.offset(i);
    // Laxalde et al. 2008, eq. 9a-c
    for (int c = 0; c < columns_; ++c) {
      f[block_[c]] = (n ? 2 : 1) * scale * row[c].real();
      if (n) f[block_[c] + 1] = -2 * scale * row[c].imag();
    }
  }
}

std::pair<double, double> FourierTransform::truncated_energy() const {
  double outside = 0, total = 0;
  std::vector<bool> kept(rows_, false);
  for (int n : harmonics_.orders()) kept[n] = true;
  for (int n = 0; n < rows_ && columns_; ++n)
    for (int c = 0; c < columns_; ++c) {
      // Parseval: the mean and the Nyquist row have no partner at -n.
      const double energy =
          std::norm(spectrum()[size_t(n) * columns_ + c]) * (n == 0 || n == rows_ - 1 ? 1 : 2);
      total += energy;
      if (!kept[n]) outside += energy;
    }
  return {outside, total};
}

}  // namespace fretwave::hb
