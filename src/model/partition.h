#pragma once
#include <petscsf.h>

#include "petsc.h"

namespace fretwave::model {

/// A symmetric matrix with its dofs dealt out to the ranks so that few have neighbours on a later one: as
/// they are numbered or sorted from one end of their graph to the other, and cut where that is narrow.
/// (PTSCOTCH 7.0.3, Debian 12's, does not come back from a bar of 3660 dofs numbered at random.)
class Partition {
 public:
  /// Collective.
  explicit Partition(Mat);
  /// In the partition's order.
  Mat matrix() const { return matrix_; }
  void release_matrix() { matrix_.reset(); }
  /// Coefficients, innermost, of this rank's dofs of the given matrix, to those of its part, and back.
  /// Collective.
  void take(double const* x, int coefficients, double* part) const;
  void give(double const* part, int coefficients, double* x) const;

 private:
  MatHandle matrix_;
  Handle<PetscSF, PetscSFDestroy> given_;  ///< roots: dofs of the given matrix, leaves: those of the part
};

}  // namespace fretwave::model
