#include "hb/static_preload.h"

namespace fretwave::hb {

StaticPreload::StaticPreload(model::Model const& model, Vec P, double size, double stiffness)
    : HarmonicProblem(model, Harmonics({0}, 2), 1, {{0, 1.0}}, stiffness), size_(size) {
  check(VecCopy(P, excitation()));
}

VecHandle StaticPreload::initial() {
  VecHandle x = model().displacement();
  check(VecSet(x, 0));
  return pack(x, {0.0});
}

ScaledMotion StaticPreload::motion(std::vector<double> const& z) const {
  return {.amplitude = size_,
          .exponents = {{0}, 0},
          .dlog_amplitude = {0},
          .dexponents = {{{0}, 0}},
          .load = z[0],
          .dload = {1}};
}

}  // namespace fretwave::hb
