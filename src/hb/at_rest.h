#pragma once
#include <optional>

#include "hb/residual.h"

namespace fretwave::hb {

/// What stands at rest while a structure vibrates: its static state and the static load, as harmonic blocks,
/// and the sliders. Nothing of the kind by default.
class AtRest {
 public:
  explicit AtRest(Residual const& residual);
  /// Dynamics about a static state x under the static load P: Q = (x, 0, ...) + a q. The mean is retained
  /// then; what was set before is replaced.
  void preload(Vec x, Vec P);
  /// The state of another problem on the same harmonics, and its excitation as a static load.
  void keep(AtRest const& other, Vec excitation);
  /// The same on another set of harmonics: `embed` puts a vector there.
  template <class Embed>
  void embed_from(AtRest const& other, Embed embed) {
    state_ = embed(other.state_), load_ = embed(other.load_);
    sliders_ = other.sliders_, owner_ = other.owner_, ++version_;
  }
  /// The sliders stand there, tangents x pairs of each contact, whatever other problems of the model do with
  /// the laws'.
  void stand(PerContact sliders);
  /// Puts the laws' sliders there, if any have been told.
  void place(Residual&) const;
  Vec state() const { return state_; }
  Vec load() const { return load_; }
  /// Grows with every change.
  unsigned version() const { return version_; }

 private:
  void set_mean(Vec per_dof, Vec blocks) const;
  Harmonics harmonics_;
  VecHandle state_, load_;
  std::optional<PerContact> sliders_;
  unsigned owner_ = 0;  ///< of the sliders, as the laws know it
  unsigned version_ = 0;
};

}  // namespace fretwave::hb
