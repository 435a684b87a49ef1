#include "contact/coulomb.h"

#include <algorithm>
#include <cmath>

namespace fretwave::contact {

Coulomb::Coulomb(CoulombParameters p, int tangents)
    : slider_(size_t(tangents) * p.gap.size(), 0.0),
      tangents_(tangents),
      p_(std::move(p)),
      closed_(p_.gap.size()),
      unworn_(p_.gap),
      worn_(p_.gap) {
  for (size_t i = 0; i < closed_.size(); ++i)
    closed_[i] = p_.normal_load[i] - p_.normal_stiffness[i] * p_.gap[i] > 0;
}

double Coulomb::stuck_stiffness(int component, int pair) const {
  if (component == 0) return closed_[pair] * p_.normal_stiffness[pair];
  return (closed_[pair] && p_.friction_coefficient[pair] > 0) * p_.tangential_stiffness[pair];
}

LinearPair Coulomb::linear_pair(int i) const {
  return {.normal_stiffness = p_.normal_stiffness[i],
          .load = p_.normal_load[i] - p_.normal_stiffness[i] * p_.gap[i],
          .tangential_stiffness = p_.tangential_stiffness[i],
          .friction_coefficient = p_.friction_coefficient[i],
          .slider = {slider_[i], components() > 2 ? slider_[pairs() + i] : 0.0}};
}

void Coulomb::set_rest(double const* u) {
  for (int i = 0; i < pairs(); ++i) {
    const double N = p_.normal_load[i] + p_.normal_stiffness[i] * (u[i] - p_.gap[i]);
    hold(i, u, p_.friction_coefficient[i] / p_.tangential_stiffness[i] * std::max(N, 0.0));
    closed_[i] = N > 0;
  }
}

void Coulomb::set_wear(double const* depth) {
  for (int i = 0; i < pairs(); ++i) worn_[i] = unworn_[i] + depth[i];
  p_.gap = worn_;
}

void Coulomb::set_stand_off(double distance) {
  for (int i = 0; i < pairs(); ++i) p_.gap[i] = worn_[i] + distance;
}

/// Paths and wear are those of two tangents that are limited each by itself: all else is measured between
/// samples (`Law::integration`). A slider is free until the sample that finds the pair closed.
void Coulomb::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  const int n = motion.pairs, samples = motion.samples, d = components();
  const bool circle = limit() == Limit::circle;
  for (int t = 0; t < samples; ++t) {
    const size_t here = size_t(t) * d * n, last = size_t(t ? t - 1 : samples - 1) * d * n;
    double const *u = motion.u + here, *before = motion.u + last, *now = f + here, *then = f + last;
    for (int i = 0; i < n; ++i) {
      const double kt = p_.tangential_stiffness[i], limit = p_.friction_coefficient[i] * now[i];
      double square = 0, size = 0, size_u = 0;
      for (int c = 1; c < d; ++c) {
        const size_t k = size_t(c) * n + i;
        const double moved = u[k] - before[k] - (now[k] - then[k]) / kt;  // of the slider w = u - T/kt
        square += moved * moved;
        size = circle ? std::hypot(size, now[k]) : std::max(size, std::abs(now[k]));
        size_u = std::hypot(size_u, u[k]);
      }
      const bool open = now[i] <= 0, slips = !open && at_limit(size, limit);
      out.status[size_t(t) * n + i] = open ? Status::open : slips ? Status::slip : Status::stick;
      if (!out.gap.empty()) {  // N = N0 + kn (u_n - gap), solved for the missing approach
        const double missing = p_.gap[i] - u[i] - p_.normal_load[i] / p_.normal_stiffness[i];
        out.gap[size_t(t) * n + i] = open ? std::max(missing, 0.0) : 0.0;
      }
      // trapezoidal in N, so that a sample that opens takes nothing away at once; a slider in shakedown
      // touches its limit and moves by the rounding of u, which is no slip
      const double path = std::sqrt(square), load = (now[i] + then[i]) / 2;
      if (!out.archard.empty() && (open || slips) && path > 1e-12 * (size_u + limit / kt))
        out.archard[i] += load * path;
      if (slips) out.slip_path[i] += path;
    }
  }
}

Entry coulomb_entry(std::string name, std::string doc, int components,
                    std::function<std::unique_ptr<Law>(CoulombParameters)> make) {
  return {.name = std::move(name),
          .doc = std::move(doc),
          .components = components,
          .parameters = {{.name = "normal_stiffness",
                          .unit = "force/length",
                          .doc = "kn",
                          .role = Role::normal_stiffness,
                          .lower = 0,
                          .strict = true},
                         {.name = "tangential_stiffness",
                          .unit = "force/length",
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
                          .unit = "force",
                          .doc = "N0, contact force at zero relative displacement and gap",
                          .role = Role::load,
                          .lower = 0,
                          .standard = 0.0},
                         gap_parameter()},
          .make = [make = std::move(make)](Parameters const& p) {
            return make({p.at("normal_stiffness"), p.at("tangential_stiffness"), p.at("friction_coefficient"),
                         p.at("normal_load"), p.at("gap")});
          }};
}

}  // namespace fretwave::contact
