#pragma once
#include "hb/residual.h"
#include "precondition/harmonic_block.h"

namespace fretwave::precondition {

using namespace hb;

/// What harmonic blocks hold of one pair's linearised contact: per harmonic, component row and column, the
/// coupling of the harmonic with itself: the nearest complex factor, or the fundamental's real 2x2 block as
/// it is.
std::vector<Rotation> harmonic_tangents(Harmonics const&, int components, double const* D,
                                        bool real_fundamental);

/// The rest, dD = D - (harmonic tangents), of one pair as its own compliance G lets it act: by Woodbury's
/// formula its force is f = E u, E = dD (I + G dD)^-1, u its motion without dD. Without it slipping pairs,
/// whose stiffness changes within a period between that of the contact and none, cost 100 iterations. Single
/// precision, as blocks.
class PairCorrection {
 public:
  /// G: as harmonic_tangents, of B P^-1 B^T.
  PairCorrection(Harmonics const&, int components, std::vector<double> D, Rotation const* tangents,
                 Rotation const* G);
  /// dD is nothing: the pair sticks, or is open.
  bool idle() const { return E_.empty(); }
  int size() const { return size_; }
  /// f = E u, blocks of one pair that is not idle.
  void apply(float const* u, float* f) const;

 private:
  int size_;
  std::vector<float> E_;  ///< row-major
};

}  // namespace fretwave::precondition
