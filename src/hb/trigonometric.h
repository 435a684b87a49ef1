#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "hb/harmonics.h"

namespace fretwave::hb {

/// Of tau.
constexpr double period = 2 * std::numbers::pi;

/// A piece of the period.
struct Span {
  double begin, length;
};

/// p(tau) = Re sum_k q_k e^{i k tau}, k = 0 .. H: a motion known at every time of its period.
struct Series {
  std::vector<complex> q;
  /// p and its first two derivatives at tau.
  struct Jet {
    double d[3];
  };
  Jet at(double tau) const;
  /// p(tau + s) - p(tau) without the rounding of the two, and p'(tau + s).
  std::pair<double, double> difference(double tau, double s) const;
  /// Of the derivative of this order, p about its mean: sum_k k^order |q_k| over k > 0.
  double bound(int order = 0) const;
};

/// Of several series of as many terms each, at the price of the waves of one.
template <size_t count>
std::array<Series::Jet, count> jets(std::array<Series const*, count> const&, double tau);

/// q_k of a dof's block, k = 0 .. moving(), about its mean; the mean.
Series series(Harmonics const&, double const* block);
double mean(Harmonics const&, double const* block);
/// 1, cos n tau, sin n tau of the retained orders; their rates by tau.
void waves(Harmonics const&, double tau, double* out);
void rates(Harmonics const&, double const* waves, double* out);
/// F += factor x the coefficients of p but its mean; of a constant.
void add_series(Harmonics const&, Series const& p, double factor, double* F);
void add_mean(Harmonics const&, double value, double* F);

/// e^{i k tau} over an arc of the period, k = 0 .. highest, about its middle c with half its length h.
class Arc {
 public:
  Arc(int highest, double begin, double length) { set(highest, begin, length); }
  Arc() = default;
  void set(int highest, double begin, double length);
  double length() const { return 2 * half_; }
  /// Of e^{i k tau}.
  complex integral(int k) const { return k ? middle_[k] * (2 * sine_[k] / k) : complex(2 * half_); }
  /// Of p.
  double integral(Series const&) const;
  /// Of p - p(begin), without the rounding of the two.
  double integral_from_begin(Series const&) const;

 private:
  double half_ = 0;
  std::vector<complex> middle_;        ///< e^{i k c}
  std::vector<double> sine_, cosine_;  ///< of k h
};

/// Where a derivative of a series changes its sign, and the series itself there.
struct Root {
  double at;
  bool rising;
  double value;
};

/// Root of f, which gives value and slope, between `low` and `high`, where it rises (1) or falls (-1) through
/// zero: Newton from `x`, halved where that leaves what is left of the bracket. To the last digits of x, or
/// of `size` if that is larger: a last step of 1e-10 of it leaves an error of some 1e-20.
template <class Function>
double root(Function f, double low, double high, double x, int sign, double size = 0) {
  constexpr int most = 60;
  constexpr double last = 1e-10;
  for (int k = 0; k < most; ++k) {
    const auto [value, slope] = f(x);
    if (value == 0) return x;
    (sign * value < 0 ? low : high) = x;
    const double next = x - value / slope, allowed = last * std::max(std::abs(x), size);
    const bool inside = next >= low && next <= high;
    if (inside && std::abs(next - x) <= allowed) return next;
    x = inside && next != x ? next : low + (high - low) / 2;
    if (high - low <= 1e-6 * allowed) break;
  }
  return x;
}

/// Times at which roots are looked for first: 8 and more in the shortest wave, so that find_roots seldom has
/// to look between them. What is found does not depend on them.
Harmonics search_times(Harmonics const&);

/// All roots over [0, 2 pi) of the derivative of this order (0 or 1), in their order, from its samples at
/// 2 pi t / count. However close: a bound on how it bends says where two may hide between samples.
void find_roots(Series const&, int derivative, double const* samples, int count, std::vector<Root>& out);

/// When a series with these roots is positive: from each that rises to the next.
std::vector<Span> positive_spans(std::vector<Root> const&);

/// Runs body(t, tau) for the samples in a piece of the period, its ends counted in: t of 0 .. samples - 1,
/// tau in the piece, perhaps in another period. A sample where one piece ends and the next begins is in both,
/// however their ends are rounded: what is continuous there is the same in either.
template <class Body>
void for_samples(int samples, double begin, double length, Body body) {
  constexpr double rounding = 1e-13;  // of a period
  const double end = begin + length, slack = rounding * samples;
  const double last = std::floor(end * samples / period + slack);
  for (double t = std::ceil(begin * samples / period - slack); t <= last; ++t) {
    const int place = int(t) % samples;
    body(size_t(place < 0 ? place + samples : place), std::clamp(t * period / samples, begin, end));
  }
}

}  // namespace fretwave::hb
