#include "contact/coulomb_3d_uncoupled.h"

#include <algorithm>
#include <cmath>

namespace fretwave::contact {

/// One step to u: sliders w (tangents x n) onto the interval of +-R about it, by exactly nothing where they
/// stick.
void Coulomb3dUncoupled::set_rest(double const* u) {
  const int n = pairs();
  for (int i = 0; i < n; ++i) {
    const double elastic = p_.normal_load[i] + p_.normal_stiffness[i] * (u[i] - p_.gap[i]);
    const double R = reach_[i] * std::max(elastic, 0.0);
    for (int c = 0; c + 1 < components(); ++c) {
      const double d = u[(c + 1) * n + i] - slider_[c * n + i];
      slider_[c * n + i] += d - (std::abs(d) <= R && R > 0 ? d : std::copysign(R, d));
    }
    closed_[i] = elastic > 0;
  }
}

Entry coulomb_3d_uncoupled_entry() {
  return coulomb_entry(
      "coulomb_3d_uncoupled", "as coulomb_3d, with each tangent limited by itself", 3,
      [](CoulombParameters p) { return std::make_unique<Coulomb3dUncoupled>(std::move(p)); });
}

}  // namespace fretwave::contact
