#include "contact/coulomb_3d.h"

#include <algorithm>
#include <cmath>

namespace fretwave::contact {

/// One step to u: sliders w onto the disc of radius R about it, by exactly nothing where they stick.
void Coulomb3d::set_rest(double const* u) {
  const int n = pairs();
  for (int i = 0; i < n; ++i) {
    const double elastic = p_.normal_load[i] + p_.normal_stiffness[i] * (u[i] - p_.gap[i]);
    const double R = reach_[i] * std::max(elastic, 0.0);
    const double d[2] = {u[n + i] - slider_[i], u[2 * n + i] - slider_[n + i]}, size = std::hypot(d[0], d[1]);
    const double kept = size <= R && R > 0 ? 1 : R / size;
    for (int c = 0; c < 2 && kept < 1; ++c) slider_[c * n + i] += d[c] - kept * d[c];
    closed_[i] = elastic > 0;
  }
}

Entry coulomb_3d_entry() {
  return coulomb_entry("coulomb_3d",
                       "elastic Coulomb contact with variable normal load and lift-off, circular slip limit",
                       3, [](CoulombParameters p) { return std::make_unique<Coulomb3d>(std::move(p)); });
}

}  // namespace fretwave::contact
