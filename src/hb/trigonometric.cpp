#include "hb/trigonometric.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "contact/vectorise.h"

namespace fretwave::hb {

namespace {

/// e^{i k tau} for k = 1, 2, ...
struct Powers {
  Powers(double re, double im, double step_re, double step_im)
      : cosine(step_re), sine(step_im), x(re), y(im) {}
  explicit Powers(double tau) : cosine(std::cos(tau)), sine(std::sin(tau)) {}
  void next() {
    const double re = x * cosine - y * sine;
    y = x * sine + y * cosine, x = re;
  }
  double cosine, sine, x = 1, y = 0;
};

}  // namespace

Series series(Harmonics const& h, double const* block) {
  Series out{std::vector<complex>(h.moving() + 1)};
  for (int i = 0; i < h.count() && h.orders()[i] <= h.moving(); ++i)
    if (h.orders()[i]) out.q[h.orders()[i]] = {block[h.offset(i)], -block[h.offset(i) + 1]};
  return out;
}

double mean(Harmonics const& h, double const* block) { return h.orders()[0] == 0 ? block[0] : 0.0; }

void add_series(Harmonics const& h, Series const& p, double factor, double* F) {
  for (int i = 0; i < h.count() && h.orders()[i] < int(p.q.size()); ++i)
    if (const int n = h.orders()[i]) {
      F[h.offset(i)] += factor * p.q[n].real();
      F[h.offset(i) + 1] -= factor * p.q[n].imag();
    }
}

void add_mean(Harmonics const& h, double value, double* F) {
  if (h.orders()[0] == 0) F[0] += value;
}

void waves(Harmonics const& h, double tau, double* out) {
  Powers e(tau);
  int n = 0;
  for (int i = 0; i < h.count(); ++i) {
    for (; n < h.orders()[i]; ++n) e.next();
    out[h.offset(i)] = n ? e.x : 1;
    if (n) out[h.offset(i) + 1] = e.y;
  }
}

void rates(Harmonics const& h, double const* waves, double* out) {
  for (int i = 0; i < h.count(); ++i) {
    const int n = h.orders()[i], at = h.offset(i);
    out[at] = n ? -n * waves[at + 1] : 0;
    if (n) out[at + 1] = n * waves[at];
  }
}

namespace {

// Orders in a register of AVX2. On a machine without, GCC 12 keeps them in memory.
constexpr size_t lanes = 4;
constexpr size_t few = 8;  // terms up to which it takes longer to bring these together
using Register = double __attribute__((vector_size(lanes * sizeof(double))));

template <size_t count>
FRETWAVE_INLINE void add_one_by_one(std::array<Series const*, count> const& all, Powers& e, size_t n,
                                    std::array<Series::Jet, count>& out) {
  for (; n < all[0]->q.size(); ++n, e.next())
    for (size_t j = 0; j < count; ++j) {
      const double k = double(n), re = all[j]->q[n].real(), im = all[j]->q[n].imag();
      const double a = re * e.x - im * e.y, b = k * (re * e.y + im * e.x);
      out[j].d[0] += a, out[j].d[1] -= b, out[j].d[2] -= k * k * a;
    }
}

/// Four orders at a time.
template <size_t count>
FRETWAVE_INLINE void add_side_by_side(std::array<Series const*, count> const& all, double tau,
                                      std::array<Series::Jet, count>& out) {
  const double c = std::cos(tau), s = std::sin(tau), c2 = c * c - s * s, s2 = 2 * c * s;
  Register x = {c, c2, c * c2 - s * s2, c2 * c2 - s2 * s2}, y = {s, s2, s * c2 + c * s2, 2 * c2 * s2},
           k = {1, 2, 3, 4}, sum[count][3] = {};
  const double c4 = x[3], s4 = y[3];
  size_t n = 1;
  for (; n + lanes <= all[0]->q.size(); n += lanes, k += double(lanes)) {
    for (size_t j = 0; j < count; ++j) {
      Register low, high;
      std::memcpy(&low, &all[j]->q[n], sizeof low), std::memcpy(&high, &all[j]->q[n + 2], sizeof high);
      const Register re = __builtin_shufflevector(low, high, 0, 2, 4, 6),
                     im = __builtin_shufflevector(low, high, 1, 3, 5, 7);
      const Register a = re * x - im * y, b = k * (re * y + im * x);
      sum[j][0] += a, sum[j][1] -= b, sum[j][2] -= k * k * a;
    }
    const Register turned = x * c4 - y * s4;
    y = x * s4 + y * c4, x = turned;
  }
  for (size_t j = 0; j < count; ++j)
    for (int d = 0; d < 3; ++d) out[j].d[d] += (sum[j][d][0] + sum[j][d][1]) + (sum[j][d][2] + sum[j][d][3]);
  Powers rest(x[0], y[0], c, s);
  add_one_by_one(all, rest, n, out);
}

FRETWAVE_VECTORISE void add(std::array<Series const*, 3> const& all, double tau,
                            std::array<Series::Jet, 3>& out) {
  add_side_by_side(all, tau, out);
}
FRETWAVE_VECTORISE void add(std::array<Series const*, 1> const& all, double tau,
                            std::array<Series::Jet, 1>& out) {
  add_side_by_side(all, tau, out);
}

}  // namespace

template <size_t count>
std::array<Series::Jet, count> jets(std::array<Series const*, count> const& all, double tau) {
  std::array<Series::Jet, count> out{};
  for (size_t j = 0; j < count; ++j) out[j].d[0] = all[j]->q[0].real();
  static const bool side_by_side = FRETWAVE_SUPPORTS("x86-64-v3");
  if (side_by_side && all[0]->q.size() > few) {
    add(all, tau, out);
    return out;
  }
  Powers e(tau);
  e.next();
  add_one_by_one(all, e, 1, out);
  return out;
}

template std::array<Series::Jet, 3> jets(std::array<Series const*, 3> const&, double);

Series::Jet Series::at(double tau) const { return jets<1>({this}, tau)[0]; }

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

double Series::bound(int order) const {
  double sum = 0;
  for (size_t k = 1; k < q.size(); ++k) {
    double size = std::abs(q[k]);
    for (int n = 0; n < order; ++n) size *= double(k);
    sum += size;
  }
  return sum;
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
    double value = 0;
    const auto f = [this, &value](double tau) {
      const Series::Jet jet = p.at(tau);
      value = jet.d[0];
      return std::pair(jet.d[derivative], jet.d[derivative + 1]);
    };
    const double guess = low + (high - low) * (below / (below - above));
    const double at = root(f, low, high, guess, below < 0 ? 1 : -1, 1);
    out.push_back({at, below < 0, value});
  }
};

}  // namespace

Harmonics search_times(Harmonics const& h) {
  return {h.orders(), std::max(8 * (h.moving() + 1), 2 * (h.highest() + 1))};
}

void find_roots(Series const& p, int derivative, double const* samples, int count, std::vector<Root>& out) {
  out.clear();
  if (p.q.size() < 2) return;
  Search search{p, derivative, out};
  for (size_t k = 1; k < p.q.size(); ++k) {
    const double size = std::abs(p.q[k].real()) + std::abs(p.q[k].imag());
    search.bent += double(k * k) * (derivative ? double(k) : 1.0) * size;
  }
  const double step = period / count, far = step * step * search.bent / 8;
  for (int t = 0; t < count; ++t) {
    const double here = samples[t], after = samples[t + 1 < count ? t + 1 : 0];
    if ((here > far && after > far) || (here < -far && after < -far)) continue;
    search.between(t * step, (t + 1) * step, here, after);
  }
  // the last one may lie at the period's end by a rounding
  if (out.size() && out.back().at >= period) {
    out.back().at -= period;
    std::rotate(out.begin(), out.end() - 1, out.end());
  }
}

std::vector<Span> positive_spans(std::vector<Root> const& roots) {
  std::vector<Span> out;
  for (size_t i = 0; i < roots.size(); ++i) {
    if (!roots[i].rising) continue;
    const double end = i + 1 < roots.size() ? roots[i + 1].at : roots[0].at + period;
    out.push_back({roots[i].at, end - roots[i].at});
  }
  return out;
}

}  // namespace fretwave::hb
