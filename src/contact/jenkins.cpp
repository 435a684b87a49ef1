#include "contact/jenkins.h"

#include <algorithm>
#include <cmath>

#include "contact/vectorise.h"

namespace fretwave::contact {

Jenkins::Jenkins(std::vector<double> stiffness, std::vector<double> friction_limit)
    : stiffness_(std::move(stiffness)), limit_(std::move(friction_limit)), slider_(stiffness_.size(), 0.0) {}

void Jenkins::set_rest(double const* u) {
  for (size_t i = 0; i < slider_.size(); ++i)
    slider_[i] =
        u[i] - std::clamp(stiffness_[i] * (u[i] - slider_[i]), -limit_[i], limit_[i]) / stiffness_[i];
}

bool Jenkins::odd() const {
  return std::all_of(slider_.begin(), slider_.end(), [](double w) { return w == 0; });
}

namespace {

/// One period; `last` notes the last sample that slips (-1 none), `stick` the flags: 1, or 0 with the sign of
/// the slip.
FRETWAVE_VECTORISE void march(int samples, int n, double const* k, double const* limit, double const* u,
                              double* w, double* f, double* stick, double* last) {
  for (int t = 0; t < samples; ++t, u += n, f += n, stick += n)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double trial = k[i] * (u[i] - w[i]);
      const double force = std::min(std::max(trial, -limit[i]), limit[i]);
      const bool sticks = force == trial && limit[i] > 0;  // without friction nothing sticks
      w[i] = sticks ? w[i] : u[i] - force / k[i];
      last[i] = sticks ? last[i] : double(t);
      stick[i] = sticks ? 1.0 : std::copysign(0.0, force);
      f[i] = force;
    }
}

/// Stick: df = k (du - dw); slip: df = 0 and dw = du. `pair` >= 0: the n columns perturb that pair alone.
template <bool OnePair>
FRETWAVE_INLINE void linear_loop(int samples, int pairs, int pair, int n, double const* stiffness,
                                 double const* stick, double const* du, double* dw, double* df) {
  for (int t = 0; t < samples; ++t, du += n, df += n, stick += pairs)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const int k = OnePair ? pair : i;
      df[i] = stick[k] * stiffness[k] * (du[i] - dw[i]);
      dw[i] = stick[k] * dw[i] + (1 - stick[k]) * du[i];
    }
}

FRETWAVE_VECTORISE void linear_march(int samples, int pairs, int pair, int n, double const* stiffness,
                                     double const* stick, double const* du, double* dw, double* df) {
  if (pair < 0)
    linear_loop<false>(samples, pairs, pair, n, stiffness, stick, du, dw, df);
  else
    linear_loop<true>(samples, pairs, pair, n, stiffness, stick, du, dw, df);
}

}  // namespace

/// Two periods, read on the second: the slider forgets all before its last slip, so that one period closes
/// it.
void Jenkins::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs, first = motion.first;
  std::vector<double> w(slider_.begin() + first, slider_.begin() + first + n), last(n, -1.0), unused(n);
  record.march.resize(motion.size());
  record.start.assign(n, {});
  const auto period = [&](std::vector<double>& slip) {
    march(motion.samples, n, stiffness_.data() + first, limit_.data() + first, motion.u, w.data(), f,
          record.march.data(), slip.data());
  };
  period(last);
  const std::vector<double> closed = w;
  period(unused);
  record.unclosed = 0;
  for (int i = 0; i < n; ++i) record.unclosed = std::max(record.unclosed, std::abs(w[i] - closed[i]));
  for (int i = 0; i < n; ++i)
    if (last[i] >= 0) record.start[i].sample[0] = int(last[i]), record.start[i].gain[0][0][0] = 1;
}

void Jenkins::linearised(Motion const& motion, Record const& record, int pair, int n, double const* du,
                         double* df) const {
  std::vector<double> dw(n);
  for (int i = 0; i < n; ++i) {
    SliderStart const& start = record.start[pair < 0 ? i : pair];
    dw[i] = start.gain[0][0][0] * du[size_t(start.sample[0]) * n + i];
  }
  linear_march(motion.samples, motion.pairs, pair, n, stiffness_.data() + motion.first, record.march.data(),
               du, dw.data(), df);
}

void Jenkins::product(Motion const& motion, Record const& record, double const* du, double const*,
                      double* df) const {
  linearised(motion, record, -1, motion.pairs, du, df);
}

void Jenkins::pair_product(Motion const& motion, Record const& record, int pair, int columns,
                           double const* du, double* df) const {
  linearised(motion, record, pair, columns, du, df);
}

void Jenkins::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  const int n = motion.pairs;
  for (int t = 0; t < motion.samples; ++t) {
    const int before = t ? t - 1 : motion.samples - 1;
    for (int i = 0; i < n; ++i) {
      const size_t now = size_t(t) * n + i, then = size_t(before) * n + i;
      const bool slips = at_limit(std::abs(f[now]), limit_[i]);
      out.status[now] = slips ? Status::slip : Status::stick;
      if (!slips) continue;
      // the slider w = u - f/k moves under the force of the slip's end
      const double moved = motion.u[now] - motion.u[then] - (f[now] - f[then]) / stiffness_[i];
      out.slip_path[i] += std::abs(moved);
      out.work[i] += std::max(0.0, f[now] * moved);  // by rounding only where it just touches the limit
    }
  }
}

std::uint64_t Jenkins::piece(Motion const& motion, Record const& record) const {
  return number_of(record.march, motion.first);
}

Entry jenkins_entry() {
  return {.name = "jenkins",
          .doc = "elastic Coulomb slider with constant normal load",
          .components = 1,
          .parameters = {{.name = "tangential_stiffness",
                          .unit = "N/m",
                          .doc = "kt of the elastic part",
                          .role = Role::tangential_stiffness,
                          .lower = 0,
                          .strict = true},
                         {.name = "friction_limit",
                          .unit = "N",
                          .doc = "sliding force mu N",
                          .role = Role::friction_limit,
                          .lower = 0}},
          .make = [](Parameters const& p) {
            return std::make_unique<Jenkins>(p.at("tangential_stiffness"), p.at("friction_limit"));
          }};
}

}  // namespace fretwave::contact
