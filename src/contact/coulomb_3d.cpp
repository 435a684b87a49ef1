#include "contact/coulomb_3d.h"

#include <algorithm>
#include <cmath>

#include "contact/slider_closure.h"

namespace fretwave::contact {

template <bool Coupled>
Coulomb3d<Coupled>::Coulomb3d(Coulomb3dParameters p)
    : p_(std::move(p)),
      unworn_(p_.gap),
      worn_(p_.gap),
      reach_(p_.gap.size()),
      slider_(2 * p_.gap.size(), 0.0),
      closed_(p_.gap.size()) {
  for (size_t i = 0; i < closed_.size(); ++i) {
    reach_[i] = p_.friction_coefficient[i] / p_.tangential_stiffness[i];
    closed_[i] = p_.normal_load[i] - p_.normal_stiffness[i] * p_.gap[i] > 0;
  }
}

template <bool Coupled>
double Coulomb3d<Coupled>::stuck_stiffness(int component, int pair) const {
  return closed_[pair] * (component ? p_.tangential_stiffness[pair] : p_.normal_stiffness[pair]);
}

template <bool Coupled>
LinearPair Coulomb3d<Coupled>::linear_pair(int i) const {
  return {.normal_stiffness = p_.normal_stiffness[i],
          .load = p_.normal_load[i] - p_.normal_stiffness[i] * p_.gap[i],
          .tangential_stiffness = p_.tangential_stiffness[i],
          .friction_coefficient = p_.friction_coefficient[i],
          .slider = {slider_[i], slider_[pairs() + i]}};
}

template <bool Coupled>
PairConstants Coulomb3d<Coupled>::constants(int first) const {
  return {p_.normal_stiffness.data() + first, p_.tangential_stiffness.data() + first, reach_.data() + first,
          p_.normal_load.data() + first, p_.gap.data() + first};
}

/// A march of one sample.
template <bool Coupled>
void Coulomb3d<Coupled>::set_rest(double const* u) {
  const int n = pairs();
  std::vector<double> f(3 * size_t(n)), record(record_arrays<Coupled> * size_t(n));
  march<Coupled>(constants(0), 1, n, u, slider_.data(), f.data(), record.data());
  for (int i = 0; i < n; ++i) closed_[i] = f[i] > 0;
}

template <bool Coupled>
void Coulomb3d<Coupled>::set_wear(double const* depth) {
  for (int i = 0; i < pairs(); ++i) worn_[i] = unworn_[i] + depth[i];
  p_.gap = worn_;
}

template <bool Coupled>
void Coulomb3d<Coupled>::set_stand_off(double distance) {
  for (int i = 0; i < pairs(); ++i) p_.gap[i] = worn_[i] + distance;
}

template <bool Coupled>
void Coulomb3d<Coupled>::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs, samples = motion.samples;
  const PairConstants p = constants(motion.first);
  std::vector<double> w(2 * size_t(n));
  for (int i = 0; i < 2 * n; ++i) w[i] = slider_[(i < n ? 0 : pairs() - n) + motion.first + i];
  const std::vector<double> rest = w;
  record.march.resize(size_t(record_arrays<Coupled>) * samples * n);
  record.start.assign(n, {}), record.unclosed = 0;
  march<Coupled>(p, samples, n, motion.u, w.data(), f, record.march.data());
  std::vector<double> left(n);
  left_rest<Coupled>(samples, n, record.march.data(), left.data());
  if constexpr (Coupled)  // pulled in as the period began
    for (int i = 0; i < n; ++i) left[i] = w[i] != rest[i] || w[n + i] != rest[n + i] ? 1.0 : left[i];
  if (std::ranges::count(left, 0.0) == n) return;
  if constexpr (Coupled)
    close(motion, rest, left, f, w, record);
  else
    last_slip(motion, record);
  const std::vector<double> closed = w;
  march<Coupled>(p, samples, n, motion.u, w.data(), f, record.march.data());
  for (int i = 0; i < 2 * n; ++i) record.unclosed = std::max(record.unclosed, std::abs(w[i] - closed[i]));
}

/// A tangent by itself forgets all before its last slip: w = u - e R there, and one period closes it.
template <bool Coupled>
void Coulomb3d<Coupled>::last_slip(Motion const& motion, Record& record) const {
  const int n = motion.pairs;
  double const *r = record.march.data(), *kn = p_.normal_stiffness.data() + motion.first;
  for (int t = 0; t < motion.samples; ++t, r += record_arrays<Coupled> * n)
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < 2; ++c) {
        const double code = r[(c + 1) * n + i];
        if (code == 2) continue;
        SliderStart& start = record.start[i];
        start.sample[c] = t;
        start.gain[c][c][0] = -code * reach_[motion.first + i] * r[i] * kn[i];
        start.gain[c][c][c + 1] = 1;
      }
}

/// Periodic sliders of the pairs that slipped or opened (`left`), wherever their slider w ended: it follows
/// the motion even where it has come back to its rest. One that opens forgets all before, and is closed.
template <bool Coupled>
void Coulomb3d<Coupled>::close(Motion const& motion, std::vector<double> const& rest,
                               std::vector<double> const& left, double const* f, std::vector<double>& w,
                               Record& record) const {
  const int n = motion.pairs;
  std::vector<double> least(n, std::numeric_limits<double>::infinity());
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) least[i] = std::min(least[i], f[size_t(t) * 3 * n + i]);
  std::vector<int> chosen;
  for (int i = 0; i < n; ++i) {
    if (left[i] == 0) continue;
    if (least[i] * reach_[motion.first + i] > 0)
      chosen.push_back(i);
    else
      for (int c = 0; c < 2; ++c) record.start[i].periodic[c][c] = 1;
  }
  if (chosen.empty()) return;
  const int k = int(chosen.size());
  SliderClosure closure(motion.samples, k);
  for (int t = 0; t < motion.samples; ++t) {
    double* disc = closure.disc(t);
    double const *u = motion.u + size_t(t) * 3 * n, *now = f + size_t(t) * 3 * n;
    for (int j = 0; j < k; ++j) {
      const int i = chosen[j];
      disc[j] = u[n + i], disc[k + j] = u[2 * n + i], disc[2 * k + j] = reach_[motion.first + i] * now[i];
    }
  }
  std::vector<double> closed(2 * size_t(k));
  std::vector<SliderStart> starts(k);
  for (int j = 0; j < 2 * k; ++j) {
    const int i = j < k ? chosen[j] : n + chosen[j - k];
    closure.rest[j] = rest[i], closure.first[j] = w[i];
    if (j < k) closure.slope[j] = reach_[motion.first + i] * p_.normal_stiffness[motion.first + i];
  }
  closure.close(closed, starts);
  for (int j = 0; j < k; ++j) {
    w[chosen[j]] = closed[j], w[n + chosen[j]] = closed[k + j];
    record.start[chosen[j]] = starts[j];
  }
}

/// dw at the period's start, then the march of the closed period; `pair` as in linear_march.
template <bool Coupled>
void Coulomb3d<Coupled>::linearised(Motion const& motion, Record const& record, int pair, int n,
                                    double const* du, double* df) const {
  const PairConstants p = constants(motion.first);
  std::vector<double> dw(2 * size_t(n), 0.0);
  const auto start = [&](int i) -> SliderStart const& { return record.start[pair < 0 ? i : pair]; };
  bool periodic = false;
  for (int i = 0; i < (pair < 0 ? n : 1); ++i)
    periodic = periodic || std::any_of(&start(i).periodic[0][0], &start(i).periodic[0][0] + 4,
                                       [](double x) { return x != 0; });
  if (periodic)
    linear_march<Coupled>(p, motion.samples, motion.pairs, pair, n, record.march.data(), du, dw.data(),
                          nullptr);
  for (int i = 0; i < n; ++i) {
    SliderStart const& s = start(i);
    const double b[2] = {dw[i], dw[n + i]};
    for (int row = 0; row < 2; ++row) {
      double sum = s.periodic[row][0] * b[0] + s.periodic[row][1] * b[1];
      for (int k = 0; k < 2; ++k)
        for (int c = 0; c < 3; ++c) sum += s.gain[k][row][c] * du[(size_t(s.sample[k]) * 3 + c) * n + i];
      dw[row * n + i] = sum;
    }
  }
  linear_march<Coupled>(p, motion.samples, motion.pairs, pair, n, record.march.data(), du, dw.data(), df);
}

template <bool Coupled>
void Coulomb3d<Coupled>::product(Motion const& motion, Record const& record, double const* du, double const*,
                                 double* df) const {
  linearised(motion, record, -1, motion.pairs, du, df);
}

template <bool Coupled>
void Coulomb3d<Coupled>::pair_product(Motion const& motion, Record const& record, int pair, int columns,
                                      double const* du, double* df) const {
  linearised(motion, record, pair, columns, du, df);
}

/// Share of the step between two samples over which a pair is open. The uncoupled law's sliders are free
/// until the sample that finds them closed.
template <bool Coupled>
double Coulomb3d<Coupled>::flight(int pair, double before, double now) const {
  if constexpr (!Coupled) return 0;
  const double rest = p_.normal_load[pair] - p_.normal_stiffness[pair] * p_.gap[pair];
  const double was = rest + p_.normal_stiffness[pair] * before, is = rest + p_.normal_stiffness[pair] * now;
  if (was <= 0 && is <= 0) return 1;
  return was <= 0 ? was / (was - is) : is <= 0 ? is / (is - was) : 0;
}

template <bool Coupled>
void Coulomb3d<Coupled>::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  const int n = motion.pairs, samples = motion.samples;
  for (int t = 0; t < samples; ++t) {
    double const *u = motion.u + size_t(t) * 3 * n,
                 *before = motion.u + size_t(t ? t - 1 : samples - 1) * 3 * n;
    double const *now = f + size_t(t) * 3 * n, *then = f + size_t(t ? t - 1 : samples - 1) * 3 * n;
    for (int i = 0; i < n; ++i) {
      const double kt = p_.tangential_stiffness[i], limit = p_.friction_coefficient[i] * now[i];
      const double held = 1 - flight(i, before[i], u[i]);
      double moved[2], path = 0, size = 0;
      for (int c = 0; c < 2; ++c) {
        const size_t k = size_t(c + 1) * n + i;
        moved[c] = held * (u[k] - before[k]) - (now[k] - then[k]) / kt;  // of the slider w = u - T/kt
        path += moved[c] * moved[c];
        size = Coupled ? std::hypot(size, now[k]) : std::max(size, std::abs(now[k]));
      }
      const bool open = now[i] <= 0, slips = !open && at_limit(size, limit);
      out.status[size_t(t) * n + i] = open ? Status::open : slips ? Status::slip : Status::stick;
      if (!out.gap.empty()) {  // N = N0 + kn (u_n - gap), solved for the missing approach
        const double missing = p_.gap[i] - u[i] - p_.normal_load[i] / p_.normal_stiffness[i];
        out.gap[size_t(t) * n + i] = open ? std::max(missing, 0.0) : 0.0;
      }
      // trapezoidal in N, so that a sample that opens takes nothing away at once; a slider in shakedown
      // touches its limit and moves by the rounding of u, which is no slip
      const double size_u = std::hypot(u[n + i], u[2 * n + i]) + limit / kt;
      if (!out.archard.empty() && (open || slips) && std::sqrt(path) > 1e-12 * size_u)
        out.archard[i] += (now[i] + then[i]) / 2 * std::sqrt(path);
      if (Coupled ? !slips && !(open && then[i] > 0) : !slips) continue;
      out.slip_path[i] += std::sqrt(path);
      // never negative: the slider moves along the force, by rounding only where it just touches the limit
      out.work[i] += Coupled ? p_.friction_coefficient[i] * (now[i] + then[i]) / 2 * std::sqrt(path)
                             : std::max(0.0, now[n + i] * moved[0] + now[2 * n + i] * moved[1]);
    }
  }
}

/// Without friction: which samples are open. With it slip turns within its piece, and a slider in shakedown
/// touches its limit by rounding: pieces have no sharp ends there.
template <bool Coupled>
std::uint64_t Coulomb3d<Coupled>::piece(Motion const& motion, Record const& record) const {
  const int n = motion.pairs;
  if (std::ranges::any_of(p_.friction_coefficient, [](double mu) { return mu > 0; })) return 0;
  std::vector<double> states(size_t(motion.samples) * n);
  double const* r = record.march.data();
  for (int t = 0; t < motion.samples; ++t, r += record_arrays<Coupled> * n)
    for (int i = 0; i < n; ++i) states[size_t(t) * n + i] = Coupled ? r[i] >= 0 : r[i];
  return number_of(states, motion.first);
}

template class Coulomb3d<true>;
template class Coulomb3d<false>;

namespace {

template <bool Coupled>
Entry entry(std::string name, std::string doc) {
  return {.name = std::move(name),
          .doc = std::move(doc),
          .components = 3,
          .parameters = {{.name = "normal_stiffness",
                          .unit = "N/m",
                          .doc = "kn",
                          .role = Role::normal_stiffness,
                          .lower = 0,
                          .strict = true},
                         {.name = "tangential_stiffness",
                          .unit = "N/m",
                          .doc = "kt",
                          .role = Role::tangential_stiffness,
                          .lower = 0,
                          .strict = true},
                         {.name = "friction_coefficient",
                          .unit = "-",
                          .doc = "mu",
                          .role = Role::friction_coefficient,
                          .lower = 0},
                         {.name = "normal_load",
                          .unit = "N",
                          .doc = "N0, contact force at zero relative displacement and gap",
                          .role = Role::load,
                          .lower = 0,
                          .standard = 0.0},
                         gap_parameter()},
          .make = [](Parameters const& p) {
            return std::make_unique<Coulomb3d<Coupled>>(
                Coulomb3dParameters{p.at("normal_stiffness"), p.at("tangential_stiffness"),
                                    p.at("friction_coefficient"), p.at("normal_load"), p.at("gap")});
          }};
}

}  // namespace

Entry coulomb_3d_entry() {
  return entry<true>("coulomb_3d",
                     "elastic Coulomb contact with variable normal load and lift-off, circular slip limit");
}
Entry coulomb_3d_uncoupled_entry() {
  return entry<false>("coulomb_3d_uncoupled", "as coulomb_3d, with each tangent limited by itself");
}

}  // namespace fretwave::contact
