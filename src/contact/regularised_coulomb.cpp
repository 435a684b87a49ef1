#include "contact/regularised_coulomb.h"

#include <cmath>
#include <numbers>

namespace fretwave::contact {

RegularisedCoulomb::RegularisedCoulomb(std::vector<double> friction_limit,
                                       std::vector<double> regularisation_velocity)
    : limit_(std::move(friction_limit)), velocity_(std::move(regularisation_velocity)) {}

namespace {

constexpr double slips = 2;         // |v| / eps
constexpr double saturated = 16.5;  // 1 - tanh = 1e-14

}  // namespace

/// tanh has its poles at +-i pi / 2, 3 pi / 2, ...
VelocityLayer RegularisedCoulomb::velocity_layer(int pair) const {
  const double eps = velocity_[pair];
  return {.width = std::numbers::pi / 2 * eps, .end = saturated * eps, .slip = slips * eps};
}

/// f = R tanh(v/eps), df/dv = R/eps (1 - tanh^2)
void RegularisedCoulomb::at_velocities(int pair, int count, double const* v, double* f, double* df_dv) const {
  const double limit = limit_[pair], eps = velocity_[pair];
  for (int j = 0; j < count; ++j) {
    const double th = std::tanh(v[j] / eps);
    f[j] = limit * th;
    df_dv[j] = limit / eps * (1 - th * th);
  }
}

void RegularisedCoulomb::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs;
  record.df_dv.resize(motion.size());
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) {
      const size_t k = size_t(t) * n + i;
      at_velocities(i, 1, motion.v + k, f + k, record.df_dv.data() + k);
    }
}

void RegularisedCoulomb::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  add_work(motion, f, out.work);
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < motion.pairs; ++i) {
      const double v = std::abs(motion.v[size_t(t) * motion.pairs + i]);
      const bool slipping = v > slips * velocity_[i];
      out.status[size_t(t) * motion.pairs + i] = slipping ? Status::slip : Status::stick;
      if (slipping) out.slip_path[i] += v * motion.step;
    }
}

Entry regularised_coulomb_entry() {
  return {.name = "regularised_coulomb",
          .doc = "mu N tanh(v/eps): Coulomb friction with constant normal load, regularised by a velocity",
          .components = 1,
          .parameters = {{.name = "friction_limit",
                          .unit = "N",
                          .doc = "sliding force mu N",
                          .role = Role::friction_limit,
                          .lower = 0},
                         {.name = "regularisation_velocity",
                          .unit = "m/s",
                          .doc = "eps; smaller is closer to Coulomb",
                          .role = Role::regularisation,
                          .lower = 0,
                          .strict = true}},
          .make = [](Parameters const& p) {
            return std::make_unique<RegularisedCoulomb>(p.at("friction_limit"),
                                                        p.at("regularisation_velocity"));
          }};
}

}  // namespace fretwave::contact
