#include "contact/coulomb_3d_uncoupled.h"

#include <cmath>

namespace fretwave::contact {

/// Each onto the interval of +-R about its u.
void Coulomb3dUncoupled::hold(int i, double const* u, double R) {
  const int n = pairs();
  for (int c = 0; c + 1 < components(); ++c) {
    const double d = u[(c + 1) * n + i] - slider_[c * n + i];
    if (std::abs(d) > R) slider_[c * n + i] += d - std::copysign(R, d);
  }
}

Entry coulomb_3d_uncoupled_entry() {
  return coulomb_entry(
      "coulomb_3d_uncoupled", "as coulomb_3d, with each tangent limited by itself", 3,
      [](CoulombParameters p) { return std::make_unique<Coulomb3dUncoupled>(std::move(p)); });
}

}  // namespace fretwave::contact
