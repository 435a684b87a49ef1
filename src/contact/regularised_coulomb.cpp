#include "contact/regularised_coulomb.h"

#include <cmath>

namespace fretwave::contact {

RegularisedCoulomb::RegularisedCoulomb(std::vector<double> friction_limit,
                                       std::vector<double> regularisation_velocity)
    : limit_(std::move(friction_limit)), velocity_(std::move(regularisation_velocity)) {}

void RegularisedCoulomb::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs;
  record.df_dv.resize(motion.size());
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) {
      // f = R tanh(v/eps), df/dv = R/eps (1 - tanh^2)
      const size_t k = size_t(t) * n + i;
      const double th = std::tanh(motion.v[k] / velocity_[i]);
      f[k] = limit_[i] * th;
      record.df_dv[k] = limit_[i] / velocity_[i] * (1 - th * th);
    }
}

void RegularisedCoulomb::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  add_work(motion, f, out.work);
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < motion.pairs; ++i) {
      const double v = std::abs(motion.v[size_t(t) * motion.pairs + i]);
      const bool slips = v > 2 * velocity_[i];
      out.status[size_t(t) * motion.pairs + i] = slips ? Status::slip : Status::stick;
      if (slips) out.slip_path[i] += v * motion.step;
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
