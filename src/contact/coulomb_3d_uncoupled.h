#pragma once
#include "contact/coulomb.h"

namespace fretwave::contact {

/// Elastic Coulomb contact with each tangent limited by itself, as some other codes have it. Its force is
/// linear in the motion but where a pair changes its state: it is not known by samples.
class Coulomb3dUncoupled : public Coulomb {
 public:
  explicit Coulomb3dUncoupled(CoulombParameters p) : Coulomb3dUncoupled(std::move(p), 2) {}
  Limit limit() const override { return Limit::each; }
  Integration integration() const override { return Integration::pieces; }

 protected:
  Coulomb3dUncoupled(CoulombParameters p, int tangents) : Coulomb(std::move(p), tangents) {}
  void hold(int pair, double const* u, double R) override;
};

Entry coulomb_3d_uncoupled_entry();

}  // namespace fretwave::contact
