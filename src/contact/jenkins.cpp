#include "contact/jenkins.h"

#include <algorithm>
#include <cmath>

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

LinearPair Jenkins::linear_pair(int pair) const {
  return {
      .tangential_stiffness = stiffness_[pair], .friction_limit = limit_[pair], .slider = {slider_[pair], 0}};
}

void Jenkins::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  const int n = motion.pairs;
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) {
      const size_t k = size_t(t) * n + i;
      out.status[k] = at_limit(std::abs(f[k]), limit_[i]) ? Status::slip : Status::stick;
    }
}

Entry jenkins_entry() {
  return {.name = "jenkins",
          .doc = "elastic Coulomb slider with constant normal load",
          .components = 1,
          .parameters = {{.name = "tangential_stiffness",
                          .unit = "force/length",
                          .doc = "kt of the elastic part",
                          .role = Role::tangential_stiffness,
                          .lower = 0,
                          .strict = true},
                         {.name = "friction_limit",
                          .unit = "force",
                          .doc = "sliding force mu N",
                          .role = Role::friction_limit,
                          .lower = 0}},
          .make = [](Parameters const& p) {
            return std::make_unique<Jenkins>(p.at("tangential_stiffness"), p.at("friction_limit"));
          }};
}

}  // namespace fretwave::contact
