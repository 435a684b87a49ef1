#pragma once
#include "contact/coulomb.h"

namespace fretwave::contact {

/// Elastic Coulomb contact in three dimensions, with a circular slip limit over both tangents. It is not
/// known by samples.
class Coulomb3d : public Coulomb {
 public:
  explicit Coulomb3d(CoulombParameters p) : Coulomb(std::move(p), 2) {}
  Limit limit() const override { return Limit::circle; }
  Integration integration() const override { return Integration::circle; }

 protected:
  void hold(int pair, double const* u, double R) override;
};

Entry coulomb_3d_entry();

}  // namespace fretwave::contact
