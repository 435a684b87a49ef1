#include "contact/coulomb_3d.h"

#include <cmath>

namespace fretwave::contact {

/// Onto the disc of radius R about u.
void Coulomb3d::hold(int i, double const* u, double R) {
  const int n = pairs();
  const double d[2] = {u[n + i] - slider_[i], u[2 * n + i] - slider_[n + i]}, size = std::hypot(d[0], d[1]);
  for (int c = 0; c < 2 && size > R; ++c) slider_[c * n + i] += d[c] - R / size * d[c];
}

Entry coulomb_3d_entry() {
  return coulomb_entry("coulomb_3d",
                       "elastic Coulomb contact with variable normal load and lift-off, circular slip limit",
                       3, [](CoulombParameters p) { return std::make_unique<Coulomb3d>(std::move(p)); });
}

}  // namespace fretwave::contact
