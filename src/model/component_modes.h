#pragma once
#include <vector>

#include "petsc.h"

namespace fretwave::model {

/// Which component modes to keep: the `count` lowest, or all up to `highest_omega` [rad/s] where that is
/// positive.
struct ComponentModes {
  PetscInt count = 10;
  double highest_omega = 0;
  /// The next ones, of so many that are kept, which tell what is left out.
  static PetscInt beyond(PetscInt kept) { return kept < 10 ? 10 : kept; }
};

/// A mode with the kept dofs held: K_ii phi = omega^2 M_ii phi, unit modal mass.
struct ComponentMode {
  double omega = 0;
  VecHandle shape;  ///< over the internal dofs
};

/// The component with its kept dofs held: K_ii, M_ii and the one factorisation of K_ii.
class FixedInterface {
 public:
  /// Factorises. K and M symmetric; K_ii must be positive definite (InputError otherwise). Collective.
  FixedInterface(Mat K, Mat M, IS internal);
  /// Dense, for `solve`. Collective.
  MatHandle columns(PetscInt count) const;
  /// X = K_ii^-1 B for dense B. Collective.
  void solve(Mat B, Mat X) const;
  /// Lowest modes, ascending, and behind those to keep the ones beyond, as far as there are any; the same on
  /// every number of ranks, double modes included. Sets the number to keep. Takes the factorisation: no solve
  /// after this. Collective.
  std::vector<ComponentMode> modes(ComponentModes&);

 private:
  std::vector<ComponentMode> krylov_modes(PetscInt count);
  std::vector<ComponentMode> counted_modes(PetscInt count, double resolution);
  std::vector<ComponentMode> all_modes() const;
  PetscInt dofs() const;
  PetscInt local_dofs() const;

  MPI_Comm comm_ = MPI_COMM_NULL;
  MatHandle K_, M_;
  KspHandle ksp_;
};

}  // namespace fretwave::model
