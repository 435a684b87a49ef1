#include "hb/velocity_force.h"

#include <algorithm>
#include <cmath>

#include "hb/indicator.h"

namespace fretwave::hb {

namespace {

constexpr int tile = 32;  // pairs whose times fit the cache

double norm(double const* x, int size) {
  double square = 0;
  for (int k = 0; k < size; ++k) square += x[k] * x[k];
  return std::sqrt(square);
}

/// e^{i k T}, k = 0 .. size - 1, times what was integrated from T on.
void add_turned(std::vector<complex> const& from, double T, double factor, std::vector<complex>& sum) {
  const complex turn = std::polar(1.0, T);
  complex turned = factor;
  for (size_t k = 0; k < sum.size(); ++k, turned *= turn) sum[k] += from[k] * turned;
}

}  // namespace

VelocityForce::VelocityForce(Harmonics const& h, contact::Law const& law)
    : harmonics_(h),
      times_(search_times(h)),
      law_(law),
      half_wave_(h.odd_only() && law.odd()),
      tile_(std::clamp(law.pairs(), 1, tile)),
      transform_(times_, tile_),
      grading_(h.highest()),
      blocks_(size_t(tile_) * h.block_size()),
      values_(size_t(tile_) * times_.samples()),
      V_(size_t(law.pairs()) * h.block_size()),
      F_(V_.size()),
      pairs_(law.pairs()) {}

void VelocityForce::force(double const* U, double const* V, double* F) {
  slopes_.made = false, tile_at_ = -1;
  std::copy_n(V, V_.size(), V_.data());
  const int m = harmonics_.block_size();
  for (int number = 0; number < int(pairs_.size()); ++number) {
    Pair& pair = pairs_[number];
    pair.v = series(harmonics_, V + block(number));
    pair.v.q.resize(harmonics_.highest() + 1);
    pair.v.q[0] = mean(harmonics_, V + block(number));
    const double u = norm(U + block(number), m), v = norm(V + block(number), m);
    pair.rate = u > 0 ? v / u : 0;
    pair.parts.clear(), pair.share = 1, pair.mean_slope = 0;
    double* f = F + block(number);
    std::fill_n(f, m, std::isfinite(v) ? 0.0 : v);
    if (!std::isfinite(v)) continue;
    divide(pair, number);
    integrate(pair, number, f);
  }
  std::copy_n(F, F_.size(), F_.data());
}

/// Roots of a pair's velocity, from each two samples between which its sign changes. Panels are measured from
/// them; they find layers without them too, so that those that hide in pairs between samples may be left out.
std::vector<double> VelocityForce::roots(Series const& v, int number) {
  if (const int first = number - number % tile_; tile_at_ != first) {
    tile_at_ = first;
    std::ranges::fill(blocks_, 0.0);
    std::copy_n(&V_[block(first)], std::min(blocks_.size(), V_.size() - block(first)), blocks_.data());
    transform_.to_time(blocks_.data(), values_.data());
  }
  const auto f = [&v](double tau) {
    const Series::Jet jet = v.at(tau);
    return std::pair(jet.d[0], jet.d[1]);
  };
  const int N = times_.samples();
  const auto at = [&](int t) { return values_[size_t(t % N) * tile_ + number % tile_]; };
  std::vector<double> out;
  for (int t = 0; t < N; ++t) {
    const double here = at(t), after = at(t + 1), low = t * period / N, high = (t + 1) * period / N;
    if ((here < 0) == (after < 0)) continue;
    const double guess = low + (high - low) * (here / (here - after));
    out.push_back(root(f, low, high, guess, here < 0 ? 1 : -1, 1));
  }
  return out;
}

/// Roots that come again half a period later.
bool VelocityForce::mirrored(std::vector<double> const& roots) const {
  const size_t half = roots.size() / 2;
  if (!half_wave_ || roots.size() % 4 != 2) return false;
  for (size_t i = 0; i < half; ++i)
    if (std::abs(roots[i + half] - roots[i] - period / 2) > 1e-6) return false;
  return true;
}

/// Evenly where that will do. Else from each root to the middle between it and its neighbours; the whole
/// period where v has none.
void VelocityForce::divide(Pair& pair, int number) {
  const contact::VelocityLayer layer = law_.velocity_layer(number);
  grading_.set(pair.v, layer.width, layer.end);
  const auto whole = [&pair] { return Part{SeriesFrom(pair.v, 0, pair.v.at(0).d[0]), {}, {}}; };
  if (const int count = grading_.even()) {
    pair.share = half_wave_ ? 0.5 : 1;
    pair.parts.push_back(whole());
    for (int i = 0; i < count * pair.share; ++i)
      pair.parts.back().panels.push_back({(i + 0.5) * period / count, period / count / 2, 0, true});
    return;
  }
  const std::vector<double> roots = this->roots(pair.v, number);
  if (roots.empty()) {
    pair.parts.push_back(whole());
    return grading_.divide(pair.parts.back().v, period, pair.parts.back().panels);
  }
  const size_t count = roots.size(), taken = mirrored(roots) ? count / 2 : count;
  pair.share = double(taken) / double(count);
  const auto gap = [&](size_t i) {
    return i + 1 < count ? roots[i + 1] - roots[i] : roots[0] + period - roots[i];
  };
  for (size_t i = 0; i < taken; ++i) {
    pair.parts.push_back({SeriesFrom(pair.v, roots[i], 0), {}, {}});
    Part& part = pair.parts.back();
    grading_.divide(part.v, -gap(i ? i - 1 : count - 1) / 2, part.panels);
    grading_.divide(part.v, gap(i) / 2, part.panels);
  }
}

/// F_k = (1 / pi) int f e^{i k tau}: its real part at the cosine, its imaginary one at the sine.
void VelocityForce::integrate(Pair& pair, int number, double* F) {
  const int H = harmonics_.highest();
  std::vector<complex> sum(H + 1), own(H + 1);
  Arc arc;
  Panel::Values v, f;
  for (Part& part : pair.parts) {
    std::ranges::fill(own, 0.0);
    part.slopes.resize(part.panels.size());
    for (size_t i = 0; i < part.panels.size(); ++i) {
      Panel const& panel = part.panels[i];
      Panel::Values& slope = part.slopes[i];
      if (panel.side) {
        const double large = panel.side * 2 * law_.velocity_layer(number).end;
        law_.at_velocities(number, 1, &large, f.data(), slope.data());
        arc.set(H, panel.middle - panel.half, 2 * panel.half);
        for (int k = 0; k <= H; ++k) own[k] += f[0] * arc.integral(k);
        continue;
      }
      const Panel::Waves waves = panel.waves();
      panel.at_nodes(part.v, waves, v);
      law_.at_velocities(number, Panel::nodes, v.data(), f.data(), slope.data());
      panel.add_integral(waves, f, own);
      pair.mean_slope += panel.integral(slope) / (period * pair.share);
    }
    add_turned(own, part.v.at, 2 / (period * pair.share), sum);
  }
  for (int i = 0; i < harmonics_.count(); ++i) {
    const int n = harmonics_.orders()[i];
    F[harmonics_.offset(i)] = n ? sum[n].real() : sum[0].real() / 2;
    if (n) F[harmonics_.offset(i) + 1] = sum[n].imag();
  }
}

/// By G_p = (1 / 2 pi) int df/dv e^{-i p tau}; over half a period those of even orders, which alone count.
void VelocityForce::linearise() {
  if (slopes_.made) return;
  const int m = harmonics_.block_size(), highest = 2 * harmonics_.highest();
  slopes_.clear(pairs_.size(), m);
  std::vector<complex> sum(highest + 1), own(highest + 1);
  for (size_t number = 0; number < pairs_.size(); ++number) {
    Pair const& pair = pairs_[number];
    std::ranges::fill(sum, 0.0);
    for (Part const& part : pair.parts) {
      std::ranges::fill(own, 0.0);
      for (size_t i = 0; i < part.panels.size(); ++i)
        if (!part.panels[i].side) part.panels[i].add_integral(part.panels[i].waves(), part.slopes[i], own);
      add_turned(own, part.v.at, 1 / (period * pair.share), sum);
    }
    for (complex& G : sum) G = std::conj(G);
    Indicator slope(harmonics_);
    slope.add(sum);
    slope.add_multiplication(1, slopes_.of(number), m);
  }
}

/// dF/dV with its columns recombined by the 2 x 2 of s_k.
void VelocityForce::blocks(Exponents const& e, double* D) {
  linearise();
  multiply(harmonics_, conjugate(e.s), slopes_.D.data(), D, int(slopes_.by_gap.size()));
}

void VelocityForce::product(double const*, double const* dV, double* dF) {
  linearise();
  slopes_.multiply(dV, dF);
}

void VelocityForce::gap_product(double const*, double* dF) { std::fill_n(dF, F_.size(), 0.0); }

double VelocityForce::mean_stiffness(int pair, int) const {
  return pairs_[pair].mean_slope * pairs_[pair].rate;
}

void VelocityForce::sample(int samples, double const*, double const* v, double* f) const {
  double slope;
  for (int t = 0; t < samples; ++t)
    for (size_t i = 0; i < pairs_.size(); ++i) {
      const size_t k = t * pairs_.size() + i;
      law_.at_velocities(int(i), 1, v + k, f + k, &slope);
    }
}

/// Work is T (F_0 V_0 + sum_n (Fc Vc + Fs Vs) / 2): of the force it takes the orders that the velocity has.
void VelocityForce::measure(contact::Diagnosis& out, double omega) const {
  const size_t m = harmonics_.block_size(), mean = harmonics_.orders()[0] == 0;
  for (size_t i = 0; i < pairs_.size(); ++i) {
    double power = 0;
    for (size_t k = 0; k < m; ++k) power += F_[i * m + k] * V_[i * m + k] * (k < mean ? 1 : 0.5);
    out.work[i] = power * period / omega;
    out.slip_path[i] = slip_path(pairs_[i], law_.velocity_layer(int(i)).slip) / omega;
  }
}

/// Integral of |v| over where it is above the threshold.
double VelocityForce::slip_path(Pair const& pair, double threshold) const {
  double sum = 0;
  const int N = times_.samples();
  std::vector<double> samples(N);
  for (const double side : {1.0, -1.0}) {
    Series above = pair.v;
    for (complex& q : above.q) q *= side;
    above.q[0] -= threshold;
    for (int t = 0; t < N; ++t) samples[t] = above.at(period * t / N).d[0];
    std::vector<Root> roots;
    find_roots(above, 0, samples.data(), N, roots);
    if (roots.empty() && samples[0] > 0) sum += period * (above.q[0].real() + threshold);
    for (Span const& span : positive_spans(roots)) {
      const Arc arc(harmonics_.highest(), span.begin, span.length);
      sum += arc.integral(above) + threshold * arc.length();
    }
  }
  return sum;
}

}  // namespace fretwave::hb
