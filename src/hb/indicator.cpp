#include "hb/indicator.h"

#include <numbers>

namespace fretwave::hb {

void Indicator::add(Arc const& arc, double weight) {
  for (size_t p = 0; p < G_.size(); ++p)
    G_[p] += weight / (2 * std::numbers::pi) * std::conj(arc.integral(int(p)));
}

/// i n f_n = sum_k G_{n-k} x_k + G_{n+k} conj(x_k), x_k = i k p_k
void Indicator::add_force(Series const& p, double weight, double* F) const {
  for (int i = 0; i < harmonics_.count(); ++i) {
    const int n = harmonics_.orders()[i];
    if (n == 0) continue;
    double re = 0, im = 0;
    for (size_t k = 1; k < p.q.size(); ++k) {
      const complex minus = (*this)(n - int(k)), plus = (*this)(n + int(k));
      const double x = -double(k) * p.q[k].imag(), y = double(k) * p.q[k].real();
      re += (minus.real() + plus.real()) * x - (minus.imag() - plus.imag()) * y;
      im += (minus.real() - plus.real()) * y + (minus.imag() + plus.imag()) * x;
    }
    F[harmonics_.offset(i)] += weight * im / n;  // Fc_n - i Fs_n = (re + i im) / (i n)
    F[harmonics_.offset(i) + 1] += weight * re / n;
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
