#include "contact/coulomb_3d.h"

#include <algorithm>
#include <cmath>

namespace fretwave::contact {

namespace {

/// Arrays of the march's record, each 2 samples x pairs: closed; per tangent the factor s on the elastic
/// trial force (1 stick, < 1 slip) and the slip direction e (0 when stuck or open).
constexpr int record_arrays = 5;

struct Places {
  double *closed, *s1, *s2, *e1, *e2;
};

Places places(double* march, size_t steps_x_pairs, size_t at) {
  march += at;
  return {march, march + steps_x_pairs, march + 2 * steps_x_pairs, march + 3 * steps_x_pairs,
          march + 4 * steps_x_pairs};
}

/// Trial force to slip-limited force: factor s and direction e.
struct Slip {
  double s, e;
};

inline Slip limit_alone(double trial, double limit) {
  const bool stick = std::abs(trial) <= limit && limit > 0;
  return {stick ? 1.0 : 0.0, stick ? 0.0 : std::copysign(1.0, trial)};
}

}  // namespace

template <bool Coupled>
Coulomb3d<Coupled>::Coulomb3d(Coulomb3dParameters p)
    : p_(std::move(p)), slider_(2 * p_.gap.size(), 0.0), closed_(p_.gap.size()) {
  for (size_t i = 0; i < closed_.size(); ++i)
    closed_[i] = p_.normal_load[i] - p_.normal_stiffness[i] * p_.gap[i] > 0;
}

template <bool Coupled>
double Coulomb3d<Coupled>::stuck_stiffness(int component, int pair) const {
  return closed_[pair] * (component ? p_.tangential_stiffness[pair] : p_.normal_stiffness[pair]);
}

/// One step of the march from a slider at zero.
template <bool Coupled>
void Coulomb3d<Coupled>::rest(double const* u) {
  const int n = pairs();
  std::fill(slider_.begin(), slider_.end(), 0.0);
  std::vector<double> f(3 * size_t(n));
  Record record;
  force({.samples = 1, .components = 3, .pairs = n, .u = u, .v = nullptr, .step = 0}, f.data(), record);
  for (int i = 0; i < n; ++i) {
    closed_[i] = f[i] > 0;
    for (int c = 0; c < 2; ++c)
      slider_[c * n + i] = u[(c + 1) * n + i] - f[(c + 1) * n + i] / p_.tangential_stiffness[i];
  }
}

template <bool Coupled>
void Coulomb3d<Coupled>::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs;
  const size_t all = size_t(2) * motion.samples * n;
  std::vector<double> slider = slider_;
  record.march.resize(record_arrays * all);
  double const *kn = p_.normal_stiffness.data(), *kt = p_.tangential_stiffness.data(),
               *mu = p_.friction_coefficient.data();
  double const *load = p_.normal_load.data(), *gap = p_.gap.data();
  double *w1 = slider.data(), *w2 = slider.data() + n;
  for (int step = 0; step < 2 * motion.samples; ++step) {
    double const* u = motion.u + size_t(step % motion.samples) * 3 * n;
    double* out = f + size_t(step % motion.samples) * 3 * n;
    const Places r = places(record.march.data(), all, size_t(step) * n);
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double elastic = load[i] + kn[i] * (u[i] - gap[i]);
      const double normal = elastic > 0 ? elastic : 0.0, limit = mu[i] * normal;
      const double trial1 = kt[i] * (u[n + i] - w1[i]), trial2 = kt[i] * (u[2 * n + i] - w2[i]);
      double force1, force2;
      if constexpr (Coupled) {
        const double size = std::sqrt(trial1 * trial1 + trial2 * trial2);
        const bool stick = size <= limit && limit > 0;  // without friction nothing sticks
        const double inverse = stick || size == 0 ? 0.0 : 1 / size, s = stick ? 1.0 : limit * inverse;
        r.s1[i] = s, r.s2[i] = s;
        r.e1[i] = trial1 * inverse, r.e2[i] = trial2 * inverse;
        force1 = s * trial1, force2 = s * trial2;
        w1[i] = stick ? w1[i] : u[n + i] - force1 / kt[i];
        w2[i] = stick ? w2[i] : u[2 * n + i] - force2 / kt[i];
      } else {
        const Slip a = limit_alone(trial1, limit), b = limit_alone(trial2, limit);
        r.s1[i] = a.s, r.s2[i] = b.s;
        r.e1[i] = a.e, r.e2[i] = b.e;
        force1 = a.s * trial1 + a.e * limit, force2 = b.s * trial2 + b.e * limit;
        w1[i] = a.s * w1[i] + (1 - a.s) * (u[n + i] - force1 / kt[i]);
        w2[i] = b.s * w2[i] + (1 - b.s) * (u[2 * n + i] - force2 / kt[i]);
      }
      r.closed[i] = elastic > 0 ? 1.0 : 0.0;
      out[i] = normal, out[n + i] = force1, out[2 * n + i] = force2;
    }
  }
}

/// dN = kn du_n where closed; trial dT = kt (du_t - dw). Coupled: dT = s (I - e e^T) trial + mu e dN; alone:
/// dT = s trial + mu e dN. Where it slips dw = du - dT/kt, where it sticks dw stays.
template <bool Coupled>
void Coulomb3d<Coupled>::product(Motion const& motion, Record const& record, double const* du_all,
                                 double const*, double* df) const {
  const int n = motion.pairs;
  const size_t all = size_t(2) * motion.samples * n;
  std::vector<double> slider(2 * size_t(n), 0.0);
  double const *kn = p_.normal_stiffness.data(), *kt = p_.tangential_stiffness.data(),
               *mu = p_.friction_coefficient.data();
  double *dw1 = slider.data(), *dw2 = slider.data() + n;
  for (int step = 0; step < 2 * motion.samples; ++step) {
    double const* du = du_all + size_t(step % motion.samples) * 3 * n;
    double* out = df + size_t(step % motion.samples) * 3 * n;
    const Places r = places(const_cast<double*>(record.march.data()), all, size_t(step) * n);
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double dN = r.closed[i] * kn[i] * du[i];
      const double trial1 = kt[i] * (du[n + i] - dw1[i]), trial2 = kt[i] * (du[2 * n + i] - dw2[i]);
      const double along = Coupled ? r.e1[i] * trial1 + r.e2[i] * trial2 : 0.0;
      const double dT1 = r.s1[i] * (trial1 - r.e1[i] * along) + mu[i] * r.e1[i] * dN;
      const double dT2 = r.s2[i] * (trial2 - r.e2[i] * along) + mu[i] * r.e2[i] * dN;
      dw1[i] = r.s1[i] == 1.0 ? dw1[i] : du[n + i] - dT1 / kt[i];
      dw2[i] = r.s2[i] == 1.0 ? dw2[i] : du[2 * n + i] - dT2 / kt[i];
      out[i] = dN, out[n + i] = dT1, out[2 * n + i] = dT2;
    }
  }
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
      double moved[2], path = 0, size = 0;
      for (int c = 0; c < 2; ++c) {
        const size_t k = size_t(c + 1) * n + i;
        moved[c] = u[k] - before[k] - (now[k] - then[k]) / kt;  // of the slider w = u - T/kt
        path += moved[c] * moved[c];
        size = Coupled ? std::hypot(size, now[k]) : std::max(size, std::abs(now[k]));
      }
      const bool open = now[i] <= 0, slips = !open && size >= limit * (1 - 1e-12);
      out.status[size_t(t) * n + i] = open ? Status::open : slips ? Status::slip : Status::stick;
      if (!slips) continue;
      out.slip_path[i] += std::sqrt(path);
      out.work[i] += now[n + i] * moved[0] + now[2 * n + i] * moved[1];
    }
  }
}

template class Coulomb3d<true>;
template class Coulomb3d<false>;

namespace {

template <bool Coupled>
Entry entry(std::string name, std::string doc) {
  return {
      .name = std::move(name),
      .doc = std::move(doc),
      .components = 3,
      .parameters = {{.name = "normal_stiffness", .unit = "N/m", .doc = "kn", .lower = 0, .strict = true},
                     {.name = "tangential_stiffness", .unit = "N/m", .doc = "kt", .lower = 0, .strict = true},
                     {.name = "friction_coefficient", .unit = "-", .doc = "mu", .lower = 0},
                     {.name = "normal_load",
                      .unit = "N",
                      .doc = "N0, contact force at zero relative displacement and gap",
                      .lower = 0,
                      .standard = 0.0},
                     {.name = "gap",
                      .unit = "m",
                      .doc = "initial gap; negative is an interference",
                      .lower = -std::numeric_limits<double>::max(),
                      .standard = 0.0}},
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
