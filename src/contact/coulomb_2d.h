#pragma once
#include "contact/coulomb_3d_uncoupled.h"

namespace fretwave::contact {

/// Elastic Coulomb contact in a plane: components (normal, tangent). The uncoupled law without its second
/// tangent.
class Coulomb2d : public Coulomb3dUncoupled {
 public:
  explicit Coulomb2d(CoulombParameters p) : Coulomb3dUncoupled(std::move(p), 1) {}
};

Entry coulomb_2d_entry();

}  // namespace fretwave::contact
