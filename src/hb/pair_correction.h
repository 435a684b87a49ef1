#pragma once
#include "hb/harmonic_inverse.h"
#include "hb/residual.h"

namespace fretwave::hb {

/// What harmonic blocks hold of one pair's linearised contact: per harmonic, component row and column, the
/// coupling of the harmonic with itself: the nearest complex factor, or the fundamental's real 2x2 block as
/// it is.
std::vector<Rotation> harmonic_tangents(Harmonics const&, int components, double const* D,
                                        bool real_fundamental);

/// The rest, D - (harmonic tangents), is eliminated pair by pair by Woodbury's formula with the compliance G
/// of the pair alone: J^-1 ~ P^-1 - P^-1 B^T E B P^-1, E = dD (I + G dD)^-1. Without it slipping pairs, whose
/// stiffness changes within a period between that of the contact and none, cost 100 iterations.
class PairCorrection {
 public:
  /// G: as harmonic_tangents, of B P^-1 B^T.
  PairCorrection(Harmonics const&, int components, std::vector<double> D, Rotation const* tangents,
                 Rotation const* G);
  /// f = E u, blocks of one pair.
  void apply(double const* u, double* f) const;
  int size() const { return size_; }

 private:
  int size_;
  std::vector<double> E_;  ///< row-major
};

}  // namespace fretwave::hb
