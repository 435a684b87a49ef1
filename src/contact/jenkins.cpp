#include "contact/jenkins.h"

#include <algorithm>
#include <cmath>

namespace fretwave::contact {

Jenkins::Jenkins(std::vector<double> stiffness, std::vector<double> friction_limit)
    : stiffness_(std::move(stiffness)), limit_(std::move(friction_limit)), slider_(stiffness_.size(), 0.0) {}

void Jenkins::rest(double const* u) {
  for (size_t i = 0; i < slider_.size(); ++i)
    slider_[i] = u[i] - std::clamp(stiffness_[i] * u[i], -limit_[i], limit_[i]) / stiffness_[i];
}

bool Jenkins::odd() const {
  return std::all_of(slider_.begin(), slider_.end(), [](double w) { return w == 0; });
}

/// march: stick flags (1 or 0) of both periods, 2 samples x pairs.
void Jenkins::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs;
  std::vector<double> slider = slider_;
  record.march.resize(2 * motion.size());
  double const *k = stiffness_.data(), *limit = limit_.data();
  double* w = slider.data();
  for (int step = 0; step < 2 * motion.samples; ++step) {
    double const* u = motion.u + size_t(step % motion.samples) * n;
    double* out = f + size_t(step % motion.samples) * n;
    double* stick = record.march.data() + size_t(step) * n;
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double trial = k[i] * (u[i] - w[i]);
      const double force = std::min(std::max(trial, -limit[i]), limit[i]);
      const bool sticks = force == trial && limit[i] > 0;  // without friction nothing sticks
      w[i] = sticks ? w[i] : u[i] - force / k[i];
      stick[i] = sticks ? 1.0 : 0.0;
      out[i] = force;
    }
  }
}

/// Stick: df = k (du - dw); slip: df = 0 and dw = du.
void Jenkins::product(Motion const& motion, Record const& record, double const* du_all, double const*,
                      double* df) const {
  const int n = motion.pairs;
  std::vector<double> slider(n, 0.0);
  double const* k = stiffness_.data();
  double* dw = slider.data();
  for (int step = 0; step < 2 * motion.samples; ++step) {
    double const* du = du_all + size_t(step % motion.samples) * n;
    double const* stick = record.march.data() + size_t(step) * n;
    double* out = df + size_t(step % motion.samples) * n;
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      out[i] = stick[i] * k[i] * (du[i] - dw[i]);
      dw[i] = stick[i] * dw[i] + (1 - stick[i]) * du[i];
    }
  }
}

void Jenkins::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  const int n = motion.pairs;
  for (int t = 0; t < motion.samples; ++t) {
    const int before = t ? t - 1 : motion.samples - 1;
    for (int i = 0; i < n; ++i) {
      const size_t now = size_t(t) * n + i, then = size_t(before) * n + i;
      const bool slips = std::abs(f[now]) >= limit_[i] * (1 - 1e-12);
      out.status[now] = slips ? Status::slip : Status::stick;
      if (!slips) continue;
      // the slider w = u - f/k moves under the force of the slip's end
      const double moved = motion.u[now] - motion.u[then] - (f[now] - f[then]) / stiffness_[i];
      out.slip_path[i] += std::abs(moved);
      out.work[i] += f[now] * moved;
    }
  }
}

Entry jenkins_entry() {
  return {.name = "jenkins",
          .doc = "elastic Coulomb slider with constant normal load",
          .components = 1,
          .parameters = {{.name = "tangential_stiffness",
                          .unit = "N/m",
                          .doc = "kt of the elastic part",
                          .lower = 0,
                          .strict = true},
                         {.name = "friction_limit", .unit = "N", .doc = "sliding force mu N", .lower = 0}},
          .make = [](Parameters const& p) {
            return std::make_unique<Jenkins>(p.at("tangential_stiffness"), p.at("friction_limit"));
          }};
}

}  // namespace fretwave::contact
