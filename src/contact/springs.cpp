#include "contact/springs.h"

#include <algorithm>

namespace fretwave::contact {

UnilateralSpring::UnilateralSpring(std::vector<double> stiffness, std::vector<double> gap)
    : stiffness_(std::move(stiffness)), gap_(std::move(gap)), closed_(gap_.size()) {
  for (size_t i = 0; i < closed_.size(); ++i) closed_[i] = gap_[i] < 0;
}

void UnilateralSpring::set_rest(double const* u) {
  for (size_t i = 0; i < closed_.size(); ++i) closed_[i] = u[i] > gap_[i];
}

void UnilateralSpring::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs;
  record.df_du.resize(motion.size());
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) {
      const size_t k = size_t(t) * n + i;
      const double depth = motion.u[k] - gap_[i] - stand_off_;
      f[k] = stiffness_[i] * std::max(0.0, depth);
      record.df_du[k] = depth > 0 ? stiffness_[i] : 0;
    }
}

void UnilateralSpring::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  const int n = motion.pairs;
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) {
      const size_t k = size_t(t) * n + i;
      const bool open = f[k] <= 0;
      out.status[k] = open ? Status::open : Status::stick;
      if (!out.gap.empty()) out.gap[k] = open ? std::max(0.0, gap_[i] + stand_off_ - motion.u[k]) : 0;
    }
}

void CubicSpring::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs;
  record.df_du.resize(motion.size());
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) {
      const size_t k = size_t(t) * n + i;
      const double square = motion.u[k] * motion.u[k];
      f[k] = cubic_[i] * square * motion.u[k];
      record.df_du[k] = 3 * cubic_[i] * square;
    }
}

/// A spring neither slips nor opens.
void CubicSpring::diagnose(Motion const&, double const*, Diagnosis& out) const {
  std::fill(out.status.begin(), out.status.end(), Status::stick);
}

Entry unilateral_spring_entry() {
  return {.name = "unilateral_spring",
          .doc = "stop: a spring along the normal that acts where the gap is closed",
          .components = 1,
          .parameters = {{.name = "normal_stiffness",
                          .unit = "force/length",
                          .doc = "k of the closed stop",
                          .role = Role::normal_stiffness,
                          .lower = 0,
                          .strict = true},
                         gap_parameter()},
          .make = [](Parameters const& p) {
            return std::make_unique<UnilateralSpring>(p.at("normal_stiffness"), p.at("gap"));
          }};
}

Entry cubic_spring_entry() {
  return {.name = "cubic_spring",
          .doc = "cubic spring without linear part, k3 u^3 (Duffing)",
          .components = 1,
          .parameters = {{.name = "cubic_stiffness",
                          .unit = "force/length^3",
                          .doc = "k3; negative softens",
                          .role = Role::none,
                          .lower = -std::numeric_limits<double>::max()}},
          .make = [](Parameters const& p) { return std::make_unique<CubicSpring>(p.at("cubic_stiffness")); }};
}

}  // namespace fretwave::contact
