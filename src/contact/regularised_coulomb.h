#pragma once
#include "contact/registry.h"

namespace fretwave::contact {

/// Regularised Coulomb friction with constant normal load, f = mu N tanh(v / eps) (Laxalde et al. 2008, eq.
/// 2b).
class RegularisedCoulomb : public Law {
 public:
  RegularisedCoulomb(std::vector<double> friction_limit, std::vector<double> regularisation_velocity);
  int components() const override { return 1; }
  int pairs() const override { return int(limit_.size()); }
  bool uses_displacement() const override { return false; }
  bool odd() const override { return true; }
  double stuck_stiffness(int component, int pair) const override {
    return limit_[pair] > 0 ? Law::stuck_stiffness(component, pair) : 0;
  }
  Integration integration() const override { return Integration::panels; }
  VelocityLayer velocity_layer(int pair) const override;
  void at_velocities(int pair, int count, double const* v, double* f, double* df_dv) const override;
  /// For what asks for one moment of it: integration in time.
  void force(Motion const&, double* f, Record&) const override;
  /// It slips where |v| > 2 eps, i.e. where the force has reached 96 % of mu N.
  void diagnose(Motion const&, double const* f, Diagnosis&) const override;

 private:
  std::vector<double> limit_, velocity_;
};

Entry regularised_coulomb_entry();

}  // namespace fretwave::contact
