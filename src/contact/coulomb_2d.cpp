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

/// The inverse, the third component left out.
void in_plane(int samples, int n, std::vector<double> const& space, double* plane) {
  for (int t = 0; t < samples; ++t)
    std::copy_n(space.data() + size_t(t) * 3 * n, 2 * size_t(n), plane + size_t(t) * 2 * n);
}

Motion in_space(Motion motion, std::vector<double> const& u) {
  motion.components = 3, motion.u = u.data(), motion.v = nullptr;
  return motion;
}

Motion sizes_in_space(Motion motion) {
  motion.components = 3, motion.u = motion.v = nullptr;
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

void Coulomb2d::force(Motion const& motion, double* f, Record& record) const {
  const auto u = in_space(motion.samples, motion.pairs, motion.u);
  std::vector<double> F(u.size());
  space_.force(in_space(motion, u), F.data(), record);
  in_plane(motion.samples, motion.pairs, F, f);
}

void Coulomb2d::product(Motion const& motion, Record const& record, double const* du, double const*,
                        double* df) const {
  const auto dU = in_space(motion.samples, motion.pairs, du);
  std::vector<double> dF(dU.size());
  space_.product(sizes_in_space(motion), record, dU.data(), nullptr, dF.data());
  in_plane(motion.samples, motion.pairs, dF, df);
}

void Coulomb2d::pair_product(Motion const& motion, Record const& record, int pair, int columns,
                             double const* du, double* df) const {
  const auto dU = in_space(motion.samples, columns, du);
  std::vector<double> dF(dU.size());
  space_.pair_product(sizes_in_space(motion), record, pair, columns, dU.data(), dF.data());
  in_plane(motion.samples, columns, dF, df);
}

void Coulomb2d::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  const auto u = in_space(motion.samples, motion.pairs, motion.u);
  const auto F = in_space(motion.samples, motion.pairs, f);
  space_.diagnose(in_space(motion, u), F.data(), out);
}

std::uint64_t Coulomb2d::piece(Motion const& motion, Record const& record) const {
  return space_.piece(sizes_in_space(motion), record);
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
