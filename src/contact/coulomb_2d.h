#pragma once
#include "contact/coulomb_3d.h"

namespace fretwave::contact {

/// Elastic Coulomb contact in a plane: components (normal, tangent). The uncoupled law in three dimensions,
/// whose second tangent never moves.
class Coulomb2d : public Law {
 public:
  explicit Coulomb2d(Coulomb3dParameters p) : space_(std::move(p)) {}
  int components() const override { return 2; }
  int pairs() const override { return space_.pairs(); }
  bool uses_velocity() const override { return false; }
  bool hereditary() const override { return true; }
  bool wears() const override { return true; }
  int normal() const override { return 0; }
  Limit limit() const override { return Limit::each; }
  std::vector<double> sliders() const override;
  double stuck_stiffness(int component, int pair) const override {
    return space_.stuck_stiffness(component, pair);
  }
  bool piecewise_linear() const override { return true; }
  LinearPair linear_pair(int pair) const override { return space_.linear_pair(pair); }
  void diagnose(Motion const&, double const* f, Diagnosis&) const override;

 protected:
  void set_rest(double const* u) override;
  void set_sliders(std::vector<double> const& sliders) override;
  void set_wear(double const* depth) override { space_.wear(depth); }
  void set_stand_off(double distance) override { space_.stand_off(distance); }

 private:
  Coulomb3d<false> space_;
};

Entry coulomb_2d_entry();

}  // namespace fretwave::contact
