#include "hb/graded_panels.h"

#include <cmath>
#include <numbers>

#include "contact/vectorise.h"
#include "hb/legendre.h"

namespace fretwave::hb {

namespace {

constexpr int n = Panel::nodes;
/// (rho + 1 / rho) / 2 with rho = 2.38: rho^{-2n} = 9e-13, at worst.
constexpr double reach = 1.4;
/// k h of the highest order: the nodes integrate its wave to rounding, and that of twice the order to 1e-13.
constexpr double most_waves = 5;
/// (N - k) d of even nodes: e^{-32} = 1e-14.
constexpr double decay = 32;
/// Share of the width that v stays within for |Im tau| < d.
constexpr double inside = 0.8;

struct Rule {
  Panel::Values x{}, weight{};
};

Rule even_rule() {
  Rule out;
  for (int j = 0; j < n; ++j) out.x[j] = (2 * j + 1.0) / n - 1, out.weight[j] = 2.0 / n;
  return out;
}

/// Gauss and Legendre's, by Newton on P_n.
Rule gauss() {
  Rule out;
  for (int j = 0; j < n; ++j) {
    double x = -std::cos(std::numbers::pi * (j + 0.75) / (n + 0.5)), slope = 1;
    for (int step = 0; step < 8; ++step) {
      const auto [value, rate] = legendre(n, x);
      slope = rate, x -= value / slope;
    }
    out.x[j] = x, out.weight[j] = 2 / ((1 - x * x) * slope * slope);
  }
  return out;
}

Rule const& rule(Panel const& panel) {
  static const Rule graded = gauss(), even = even_rule();
  return panel.even ? even : graded;
}

/// (-1)^k / (2 k)! and (-1)^k / (2 k + 1)!
constexpr int terms = 12;
struct Taylor {
  double cosine[terms], sine[terms];
};
constexpr Taylor taylor = [] {
  Taylor out{};
  double factorial = 1;
  for (int k = 0; k < terms; ++k) {
    out.cosine[k] = (k % 2 ? -1 : 1) / factorial;
    out.sine[k] = out.cosine[k] / (2 * k + 1);
    factorial *= (2 * k + 1) * (2 * k + 2);
  }
  return out;
}();

/// e^{i half x} - 1 = 2 sin(z) (-sin(z) + i cos(z)), z = half x / 2 within +-pi / 2: Taylor's series, then
/// turned by the middle's.
FRETWAVE_VECTORISE
void node_waves(double const* x, double half, double mx, double my, double* re, double* im) {
#pragma omp simd
  for (int j = 0; j < n; ++j) {
    const double z = half * x[j] / 2, q = z * z;
    double sine = taylor.sine[terms - 1], cosine = taylor.cosine[terms - 1];
#pragma GCC unroll 12
    for (int k = terms - 2; k >= 0; --k) {
      sine = sine * q + taylor.sine[k];
      cosine = cosine * q + taylor.cosine[k];
    }
    sine *= z;
    const double a = -2 * sine * sine, b = 2 * sine * cosine;
    re[j] = mx + a + (mx * a - my * b);
    im[j] = my + b + (mx * b + my * a);
  }
}

/// d_{k+1} = d_k + d_1 + d_k d_1 of d_k = e^{i k s} - 1
FRETWAVE_INLINE void next(double x, double y, double& a, double& b) {
  const double re = a + x + (a * x - b * y);
  b = b + y + (a * y + b * x);
  a = re;
}

FRETWAVE_VECTORISE
void sum_waves(int highest, double const* re, double const* im, double const* x, double const* y, double* v) {
  double a[n], b[n];
  for (int j = 0; j < n; ++j) a[j] = x[j], b[j] = y[j];
  for (int k = 1; k <= highest; ++k) {
    const double p = re[k], q = im[k];
#pragma omp simd
    for (int j = 0; j < n; ++j) {
      v[j] += p * a[j] - q * b[j];
      next(x[j], y[j], a[j], b[j]);
    }
  }
}

FRETWAVE_VECTORISE
void integrate(int highest, double const* x, double const* y, double const* w, complex* sum) {
  double a[n], b[n];
  for (int j = 0; j < n; ++j) a[j] = 0, b[j] = 0;
  for (int k = 0; k <= highest; ++k) {
    double re = 0, im = 0;
#pragma omp simd reduction(+ : re, im)
    for (int j = 0; j < n; ++j) {
      re += w[j] * (1 + a[j]);
      im += w[j] * b[j];
      next(x[j], y[j], a[j], b[j]);
    }
    sum[k] += complex(re, im);
  }
}

/// e^{i s} - 1
std::pair<double, double> wave(double s) {
  const double sine = std::sin(s / 2);
  return {-2 * sine * sine, 2 * sine * std::cos(s / 2)};
}

/// e^x - 1 - x - x^2 / 2
double third_remainder(double x) {
  if (x > 0.5) return std::expm1(x) - x - x * x / 2;
  return x * x * x / 6 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6 * (1 + x / 7))));
}

}  // namespace

SeriesFrom::SeriesFrom(Series const& p, double time, double known)
    : at(time), value(known), re(p.q.size()), im(p.q.size()) {
  const complex turn = std::polar(1.0, time);
  complex turned = 1;
  for (size_t k = 0; k < p.q.size(); ++k, turned *= turn) {
    const complex here = p.q[k] * turned;
    re[k] = here.real(), im[k] = here.imag();
  }
}

Series::Jet SeriesFrom::jet(double s) const {
  const auto [x, y] = wave(s);
  double a = x, b = y;
  Series::Jet out{{value, 0, 0}};
  for (size_t k = 1; k < re.size(); ++k) {
    const double order = double(k), p = re[k], q = im[k];
    out.d[0] += p * a - q * b;
    out.d[1] -= order * (p * b + q * (1 + a));
    out.d[2] -= order * order * (p * (1 + a) - q * b);
    next(x, y, a, b);
  }
  return out;
}

Panel::Waves Panel::waves() const {
  Waves out;
  const auto [x, y] = wave(middle);
  node_waves(rule(*this).x.data(), half, x, y, out.x.data(), out.y.data());
  return out;
}

void Panel::at_nodes(SeriesFrom const& p, Waves const& w, Values& v) const {
  v.fill(p.value);
  sum_waves(int(p.re.size()) - 1, p.re.data(), p.im.data(), w.x.data(), w.y.data(), v.data());
}

double Panel::integral(Values const& f) const {
  double sum = 0;
  for (int j = 0; j < n; ++j) sum += half * rule(*this).weight[j] * f[j];
  return sum;
}

void Panel::add_integral(Waves const& w, Values const& f, std::vector<complex>& sum) const {
  Values weighted;
  for (int j = 0; j < n; ++j) weighted[j] = half * rule(*this).weight[j] * f[j];
  integrate(int(sum.size()) - 1, w.x.data(), w.y.data(), weighted.data(), sum.data());
}

Grading::Grading(int highest)
    : longest_(std::min(std::numbers::pi, most_waves / std::max(highest, 1))), sizes_(highest + 1) {
  for (int i = 0; i < radii; ++i)
    for (int k = 0; k <= highest; ++k)
      thirds_.push_back(third_remainder(k * reach * std::ldexp(longest_, -i)));
  for (int count = 2; count <= std::max(8, highest); count += 2 + count / 8 * 2) {
    if (n * count < 4 * highest) continue;
    counts_.push_back(count);
    for (int k = 0; k <= highest; ++k) strips_.push_back(std::sinh(k * decay / (n * count - highest)));
  }
}

void Grading::set(Series const& v, double width, double end) {
  width_ = width, end_ = end, third_ = 0;
  remainders_.fill(0);
  for (size_t k = 1; k < sizes_.size(); ++k) {
    const double order = double(k);
    sizes_[k] = std::abs(v.q[k]);
    third_ += order * order * order * sizes_[k];
    for (int i = 0; i < radii; ++i) remainders_[i] += sizes_[k] * thirds_[size_t(i) * sizes_.size() + k];
  }
}

int Grading::even() const {
  for (size_t i = 0; i < counts_.size(); ++i) {
    double rise = 0;
    for (size_t k = 1; k < sizes_.size(); ++k) rise += sizes_[k] * strips_[i * sizes_.size() + k];
    if (rise <= inside * width_) return counts_[i];
  }
  return 0;
}

/// At most that of the next larger radius, less by the cube of their ratio.
double Grading::remainder(double r) const {
  double larger = reach * longest_;
  int i = 0;
  while (i + 1 < radii && r <= larger / 2) larger /= 2, ++i;
  const double ratio = r / larger;
  return remainders_[i] * ratio * ratio * ratio;
}

bool Grading::smooth(Series::Jet const& v, double half) const {
  if (half > longest_ * (1 + 1e-12)) return false;
  const double r = reach * half;
  return std::abs(v.d[1]) * r + std::abs(v.d[2]) * r * r / 2 + remainder(r) <=
         std::sqrt(v.d[0] * v.d[0] + width_ * width_);
}

/// Length from here on, `rest` at most, over which |v| >= end: a + b x - c x^2 / 2 - (sum_k k^3 |v_k|) x^3 /
/// 6 is concave, so that its end decides.
double Grading::constant(Series::Jet const& v, double direction, double rest) const {
  const double sign = v.d[0] < 0 ? -1 : 1, excess = sign * v.d[0] - end_;
  if (!(excess > 0)) return 0;
  const double b = sign * direction * v.d[1], c = std::min(0.0, sign * v.d[2]);
  const auto left = [&](double x) { return excess + x * (b + x * (c / 2 - x * third_ / 6)); };
  double length = rest;
  while (left(length) < 0) length *= 0.75;
  return length;
}

/// Half length from here on, if v went straight: |a + x -+ i width| = reach x at its middle, x = |v'| h.
double Grading::guess(Series::Jet const& v, double direction) const {
  const double a = std::abs(v.d[0]), slope = std::abs(v.d[1]);
  const double leaves = v.d[0] * v.d[1] * direction >= 0 ? a : -a, more = reach * reach - 1;
  const double x = (leaves + std::sqrt(a * a + more * (a * a + width_ * width_))) / more;
  return 0.95 * x < longest_ * slope ? 0.95 * x / slope : longest_;
}

void Grading::divide(SeriesFrom const& v, double length, std::vector<Panel>& out) const {
  const double direction = length < 0 ? -1 : 1, all = std::abs(length);
  const size_t first = out.size();
  for (double s = 0; s < all;) {
    const Series::Jet here = v.jet(direction * s);
    const double rest = (all - s) / 2, flat = constant(here, direction, 2 * rest) / 2, least = 1e-15 * s;
    double half = guess(here, direction);
    half = 2 * half < rest ? half : half < rest ? rest / 2 : rest;
    Panel panel{0, half};
    // by what the parabola from here says, then by what is there
    const auto middle = [&](double x) {
      return Series::Jet{
          {here.d[0] + x * (here.d[1] + x * here.d[2] / 2), here.d[1] + x * here.d[2], here.d[2]}};
    };
    const double enough = std::max(flat, least);
    while (half > enough && !smooth(middle(direction * half), half)) half *= 0.9;
    while (half > enough && !smooth(v.jet(direction * (s + half)), half)) half *= 0.85;
    half = std::min(std::max(half, least), rest);  // beside a v of 1e47 no panel is short enough
    if (!(half > 0)) half = rest;
    if (flat >= half) half = flat, panel.side = here.d[0] > 0 ? 1 : -1;
    panel.middle = direction * (s + half), panel.half = half;
    s = half < rest ? s + 2 * half : all;
    if (out.size() > first && panel.side && out.back().side == panel.side) {
      half += out.back().half;
      out.back() = {direction * (s - half), half, panel.side};
    } else {
      out.push_back(panel);
    }
  }
}

}  // namespace fretwave::hb
