#pragma once
#include "hb/harmonic_problem.h"
#include "text.h"

namespace fretwave::hb {

/// Static equilibrium K x + B^T f(B x) = p P over the load factor p: harmonic 0 alone, y = (x / size, p). The
/// contact starts untouched.
class StaticPreload : public HarmonicProblem {
 public:
  /// P: load per dof at factor 1; `size`: reference displacement, `stiffness`: reference stiffness.
  /// Collective.
  StaticPreload(model::Model const&, Vec P, double size, double stiffness);
  VecHandle initial();
  double parameter_value(double entry) const override { return entry; }
  double parameter_entry(double value) const override { return value; }
  std::string parameter_text(double value) const override { return "load factor " + short_text(value); }
  void metric(Vec y, Vec weights) override { (void)y, check(VecSet(weights, 1)); }

 private:
  ScaledMotion motion(std::vector<double> const& z) const override;
  double size_;
};

}  // namespace fretwave::hb
