#include "hb/trigonometric.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fretwave::hb {

namespace {

/// e^{i k tau} for k = 1, 2, ...
struct Powers {
  explicit Powers(double tau) : cosine(std::cos(tau)), sine(std::sin(tau)) {}
  void next() {
    const double re = x * cosine - y * sine;
    y = x * sine + y * cosine, x = re;
  }
  double cosine, sine, x = 1, y = 0;
};

}  // namespace

Series::Jet Series::at(double tau) const {
  Powers e(tau);
  Jet out{{q[0].real(), 0, 0}};
  for (size_t n = 1; n < q.size(); ++n) {
    e.next();
    const double re = q[n].real(), im = q[n].imag(), k = double(n);
    const double a = re * e.x - im * e.y, b = k * (re * e.y + im * e.x);
    out.d[0] += a, out.d[1] -= b, out.d[2] -= k * k * a;
  }
  return out;
}

/// e^{i k (tau + s)} - e^{i k tau} = 2 i sin(k s / 2) e^{i k (tau + s / 2)}
std::pair<double, double> Series::difference(double tau, double s) const {
  Powers middle(tau + s / 2), half(s / 2);
  double value = 0, slope = 0;
  for (size_t n = 1; n < q.size(); ++n) {
    middle.next(), half.next();
    const double re = q[n].real() * middle.x - q[n].imag() * middle.y;
    const double im = q[n].real() * middle.y + q[n].imag() * middle.x;
    value -= 2 * half.y * im;
    slope -= double(n) * (im * half.x + re * half.y);
  }
  return {value, slope};
}

void Arc::set(int highest, double begin, double length) {
  half_ = length / 2;
  middle_.resize(highest + 1), sine_.resize(highest + 1), cosine_.resize(highest + 1);
  middle_[0] = 1, sine_[0] = 0, cosine_[0] = 1;
  Powers middle(begin + half_), half(half_);
  for (int k = 1; k <= highest; ++k) {
    middle.next(), half.next();
    middle_[k] = {middle.x, middle.y}, sine_[k] = half.y, cosine_[k] = half.x;
  }
}

double Arc::integral(Series const& p) const {
  double sum = p.q[0].real() * length();
  for (size_t k = 1; k < p.q.size(); ++k) sum += (p.q[k] * integral(int(k))).real();
  return sum;
}

/// Of e^{i k c} (e^{i k s} - e^{-i k h}), s from -h to h: 2 h e^{i k c} (sin(x) / x - cos(x) + i sin(x)), x =
/// k h.
double Arc::integral_from_begin(Series const& p) const {
  double sum = 0;
  for (size_t k = 1; k < p.q.size(); ++k) {
    const double x = double(k) * half_, x2 = x * x;
    const double even =
        x2 > 0.01 ? sine_[k] / x - cosine_[k] : x2 / 3 * (1 - x2 / 10 * (1 - x2 / 28 * (1 - x2 / 54)));
    const complex at = p.q[k] * middle_[k];
    sum += at.real() * even - at.imag() * sine_[k];
  }
  return length() * sum;
}

namespace {

/// Roots of one function, isolated by a bound on its second derivative.
struct Search {
  Series const& p;
  int derivative;
  std::vector<Root>& out;
  double bent = 0;

  /// Between two times at which the function has these values. None where both have one sign and are farther
  /// from zero than it can bend; one where they differ and it cannot turn between; else each half is asked.
  void between(double low, double high, double below, double above, int halvings = 10) {
    const double step = high - low, bend = step * step * bent;
    if ((below < 0) == (above < 0)) {
      if (halvings == 0 || std::min(std::abs(below), std::abs(above)) > bend / 8) return;
    } else if (halvings == 0 || std::abs(above - below) > bend) {
      return refine(low, high, below, above);
    }
    const double middle = low + step / 2, value = p.at(middle).d[derivative];
    between(low, middle, below, value, halvings - 1), between(middle, high, value, above, halvings - 1);
  }

  void refine(double low, double high, double below, double above) {
    const auto f = [this](double tau) {
      const Series::Jet jet = p.at(tau);
      return std::pair(jet.d[derivative], jet.d[derivative + 1]);
    };
    const double guess = low + (high - low) * (below / (below - above));
    out.push_back({root(f, low, high, guess, below < 0 ? 1 : -1, 1), below < 0});
  }
};

}  // namespace

void find_roots(Series const& p, int derivative, double const* samples, int count, std::vector<Root>& out) {
  out.clear();
  if (p.q.size() < 2) return;
  Search search{p, derivative, out};
  for (size_t k = 1; k < p.q.size(); ++k)
    search.bent += std::pow(double(k), derivative + 2) * std::abs(p.q[k]);
  const double step = 2 * std::numbers::pi / count;
  for (int t = 0; t < count; ++t)
    search.between(t * step, (t + 1) * step, samples[t], samples[t + 1 < count ? t + 1 : 0]);
  // the last one may lie at the period's end by a rounding
  if (out.size() && out.back().at >= 2 * std::numbers::pi) {
    out.back().at -= 2 * std::numbers::pi;
    std::rotate(out.begin(), out.end() - 1, out.end());
  }
}

}  // namespace fretwave::hb
