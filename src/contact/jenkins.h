#pragma once
#include "contact/registry.h"

namespace fretwave::contact {

/// Elastic Coulomb slider with constant normal load (Jenkins element): f = kt (u - w), |f| <= R, the slider w
/// moves when it slips.
class Jenkins : public Law {
 public:
  Jenkins(std::vector<double> stiffness, std::vector<double> friction_limit);
  int components() const override { return 1; }
  int pairs() const override { return int(stiffness_.size()); }
  bool uses_velocity() const override { return false; }
  bool hereditary() const override { return true; }
  Limit limit() const override { return Limit::each; }
  bool odd() const override;
  std::vector<double> sliders() const override { return slider_; }
  double stuck_stiffness(int, int pair) const override { return (limit_[pair] > 0) * stiffness_[pair]; }
  Integration integration() const override { return Integration::pieces; }
  LinearPair linear_pair(int pair) const override;
  void diagnose(Motion const&, double const* f, Diagnosis&) const override;

 protected:
  void set_rest(double const* u) override;
  void set_sliders(std::vector<double> const& sliders) override { slider_ = sliders; }

 private:
  std::vector<double> stiffness_, limit_, slider_;  ///< slider_: w at rest
};

Entry jenkins_entry();

}  // namespace fretwave::contact
