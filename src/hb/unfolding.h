#pragma once
#include "hb/harmonics.h"
#include "model/model.h"

namespace fretwave::hb {

/// Unknowns and rows that take the double mode of a tuned wheel apart, where with one dof normalised the
/// Jacobian loses rank by 2 as a -> 0: a fundamental force along M phi with two unknown amplitudes tau, and
/// two rows that keep the fundamental's component phi^H M q_1 at zero; phi = re + i im is the linear mode
/// that the motion shall not turn into. None by default.
class Unfolding {
 public:
  Unfolding() = default;
  /// Collective.
  Unfolding(model::Model const&, Harmonics const&, Vec re, Vec im);
  int count() const { return int(vectors_.size()); }
  /// M phi on the fundamental, real and imaginary part, of unit length.
  std::vector<VecHandle> const& vectors() const { return vectors_; }
  /// The same on another set of harmonics: `embed` puts a vector there.
  template <class Embed>
  Unfolding embedded(Embed embed) const {
    Unfolding out;
    for (auto const& g : vectors_) out.vectors_.push_back(embed(g));
    return out;
  }
  /// Of q along the vectors. Collective.
  std::vector<double> components(Vec q) const;
  /// r += sum_j tau_j g_j on this rank.
  void add(double const* tau, double* r) const;

 private:
  std::vector<VecHandle> vectors_;
};

}  // namespace fretwave::hb
