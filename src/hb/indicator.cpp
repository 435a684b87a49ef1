#include "hb/indicator.h"

#include <numbers>

namespace fretwave::hb {

void Indicator::add(Arc const& arc, double weight) {
  for (size_t p = 0; p < G_.size(); ++p)
    G_[p] += weight / (2 * std::numbers::pi) * std::conj(arc.integral(int(p)));
}

/// y of orders 0 .. H from x of as many or fewer, in real arrays: G of orders -H .. 2H, of which several can
/// be taken at once.
std::vector<complex> Indicator::times(std::vector<complex> const& x) const {
  const int H = harmonics_.highest(), last = int(x.size()) - 1;
  std::vector<double> arrays(2 * size_t(3 * H + 1) + 2 * size_t(H + 1));
  double *re = arrays.data() + H, *im = re + 3 * H + 1, *a = im + 2 * H + 1, *b = a + H + 1;
  for (int n = -H; n <= 2 * H; ++n) re[n] = (*this)(n).real(), im[n] = (*this)(n).imag();
  for (int k = 1; k <= last; ++k) a[k] = x[k].real(), b[k] = x[k].imag();
  std::vector<complex> y(H + 1);
  for (int n : harmonics_.orders()) {
    double real = 0, imaginary = 0;
#pragma omp simd reduction(+ : real, imaginary)
    for (int k = 1; k <= last; ++k) {
      real += (re[n - k] + re[n + k]) * a[k] - (im[n - k] - im[n + k]) * b[k];
      imaginary += (re[n - k] - re[n + k]) * b[k] + (im[n - k] + im[n + k]) * a[k];
    }
    y[n] = {real, imaginary};
  }
  return y;
}

/// i n f_n = y_n of x_k = i k p_k, Fc_n - i Fs_n = f_n
void Indicator::add_force(Series const& p, double weight, double* F) const {
  std::vector<complex> rate(p.q);
  for (size_t k = 0; k < rate.size(); ++k) rate[k] *= complex(0, double(k));
  const std::vector<complex> y = times(rate);
  for (int i = 0; i < harmonics_.count(); ++i)
    if (const int n = harmonics_.orders()[i]) {
      F[harmonics_.offset(i)] += weight * y[n].imag() / n;
      F[harmonics_.offset(i) + 1] += weight * y[n].real() / n;
    }
}

void Indicator::add_product(Series const& p, double weight, double* F) const {
  const std::vector<complex> y = times(p.q);
  for (int i = 0; i < harmonics_.count(); ++i)
    if (const int n = harmonics_.orders()[i]) {
      const complex f = y[n] + 2.0 * G_[n] * p.q[0].real();
      F[harmonics_.offset(i)] += weight * f.real();
      F[harmonics_.offset(i) + 1] -= weight * f.imag();
    }
}

/// f_n = 2 G_n x_0 + sum_k G_{n-k} x_k + G_{n+k} conj(x_k)
void Indicator::add_multiplication(double weight, double* D, size_t ld) const {
  auto const& orders = harmonics_.orders();
  for (int i = 0; i < harmonics_.count(); ++i)
    for (int j = 0; j < harmonics_.count(); ++j) {
      const int n = orders[i], k = orders[j];
      double* b = D + size_t(harmonics_.offset(i)) * ld + harmonics_.offset(j);
      const complex minus = weight * (*this)(n - k), plus = weight * (*this)(n + k);
      if (n && k) {
        b[0] += minus.real() + plus.real(), b[1] += minus.imag() - plus.imag();
        b[ld] += -minus.imag() - plus.imag(), b[ld + 1] += minus.real() - plus.real();
      } else if (n) {
        b[0] += 2 * minus.real(), b[ld] -= 2 * minus.imag();
      } else if (k) {
        b[0] += plus.real(), b[1] -= plus.imag();
      } else {
        b[0] += minus.real();
      }
    }
}

void Indicator::add_coefficients(double weight, double* F) const {
  for (int i = 0; i < harmonics_.count(); ++i) {
    const int n = harmonics_.orders()[i];
    F[harmonics_.offset(i)] += (n ? 2 : 1) * weight * G_[n].real();
    if (n) F[harmonics_.offset(i) + 1] -= 2 * weight * G_[n].imag();
  }
}

}  // namespace fretwave::hb
