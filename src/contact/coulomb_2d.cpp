#include "contact/coulomb_2d.h"

#include <algorithm>

namespace fretwave::contact {

namespace {

/// (samples x 2 x n) with a third component of zeros.
std::vector<double> in_space(int samples, int n, double const* plane) {
  std::vector<double> out(size_t(samples) * 3 * n, 0.0);
  for (int t = 0; t < samples; ++t)
    std::copy_n(plane + size_t(t) * 2 * n, 2 * size_t(n), out.data() + size_t(t) * 3 * n);
  return out;
}

Motion in_space(Motion motion, std::vector<double> const& u) {
  motion.components = 3, motion.u = u.data(), motion.v = nullptr;
  return motion;
}

}  // namespace

std::vector<double> Coulomb2d::sliders() const {
  std::vector<double> both = space_.sliders();
  both.resize(size_t(pairs()));
  return both;
}

void Coulomb2d::set_sliders(std::vector<double> const& sliders) {
  std::vector<double> both = sliders;
  both.resize(2 * size_t(pairs()), 0.0);
  space_.place(both);
}

void Coulomb2d::set_rest(double const* u) { space_.rest(in_space(1, pairs(), u).data(), space_.sliders()); }

void Coulomb2d::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  const auto u = in_space(motion.samples, motion.pairs, motion.u);
  const auto F = in_space(motion.samples, motion.pairs, f);
  space_.diagnose(in_space(motion, u), F.data(), out);
}

/// Parameters and their words are those in space.
Entry coulomb_2d_entry() {
  Entry entry = coulomb_3d_uncoupled_entry();
  entry.name = "coulomb_2d";
  entry.doc = "elastic Coulomb contact in a plane: variable normal load and lift-off, one tangent";
  entry.components = 2;
  entry.make = [](Parameters const& p) {
    return std::make_unique<Coulomb2d>(
        Coulomb3dParameters{p.at("normal_stiffness"), p.at("tangential_stiffness"),
                            p.at("friction_coefficient"), p.at("normal_load"), p.at("gap")});
  };
  return entry;
}

}  // namespace fretwave::contact
