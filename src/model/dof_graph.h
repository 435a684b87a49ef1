#pragma once
#include <petscsf.h>

#include <span>
#include <vector>

#include "petsc.h"

namespace fretwave::model {

/// Which dofs a symmetric matrix couples, of this rank's rows: own dofs are numbered from 0, behind them
/// stand those of other ranks that they are coupled to.
class DofGraph {
 public:
  /// Collective.
  explicit DofGraph(Mat);
  MPI_Comm comm() const { return comm_; }
  PetscInt size() const { return end_ - begin_; }  ///< own dofs
  PetscInt all() const { return size() + PetscInt(others_.size()); }
  /// Own dofs that are coupled to one of all.
  std::span<int const> coupled_to(PetscInt j) const;
  /// Of all dofs, where those of own ones are known. Collective.
  void exchange(std::span<PetscInt> values) const;
  /// Distance of each own dof from an end of the graph (Cuthill & McKee 1969), one connected part behind the
  /// other; what is not reached in so many steps is as far as the last. (Within a level they stand as
  /// numbered: of a blade cut into 16 parts a tenth more lie between than by Cuthill-McKee.) Collective.
  std::vector<PetscInt> levels(int steps) const;

 private:
  struct Walk;
  void read(Mat);
  void reach_alone(std::span<PetscInt> level) const;
  PetscInt first_unreached(std::span<PetscInt const> level, PetscInt& from) const;

  MPI_Comm comm_;
  PetscInt begin_, end_;
  std::vector<PetscInt> others_;  ///< ascending
  std::vector<PetscInt64> first_;
  std::vector<int> rows_;
  Handle<PetscSF, PetscSFDestroy> owners_;  ///< leaves: `others_`
};

}  // namespace fretwave::model
