#include "contact/coulomb_3d_uncoupled.h"

#include <cmath>

#include "contact/vectorise.h"

namespace fretwave::contact {

namespace {

/// One step to u: sliders w (tangents x n) onto the interval of +-R about it, by exactly nothing where they
/// stick.
FRETWAVE_VECTORISE void drag(PairConstants const& p, int tangents, int n, double const* u, double* w,
                             double* closed) {
  double const *kn = p.kn, *reach = p.reach, *load = p.load, *gap = p.gap, *along = u + n;
  for (int c = 0; c < tangents; ++c, along += n, w += n)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double elastic = load[i] + kn[i] * (u[i] - gap[i]), R = reach[i] * (elastic > 0 ? elastic : 0.0);
      const double d = along[i] - w[i], kept = std::abs(d) <= R && R > 0 ? d : std::copysign(R, d);
      w[i] += d - kept, closed[i] = elastic > 0 ? 1.0 : 0.0;
    }
}

}  // namespace

void Coulomb3dUncoupled::set_rest(double const* u) {
  drag(constants(0), components() - 1, pairs(), u, slider_.data(), closed_.data());
}

Entry coulomb_3d_uncoupled_entry() {
  return coulomb_entry(
      "coulomb_3d_uncoupled", "as coulomb_3d, with each tangent limited by itself", 3,
      [](CoulombParameters p) { return std::make_unique<Coulomb3dUncoupled>(std::move(p)); });
}

}  // namespace fretwave::contact
