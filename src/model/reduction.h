#pragma once
#include <span>
#include <vector>

#include "model/component_modes.h"

namespace fretwave {
class BlockedProduct;
}

namespace fretwave::model {

/// Wall time of each stage [s].
struct ReductionTimes {
  double factorisation = 0, constraint_modes = 0, component_modes = 0, projection = 0;
};

/// The component modes next to those of a reduction: with unit modal mass and diag(omega^2) as the others.
struct OmittedModes {
  std::vector<double> omega;  ///< [rad/s]
  std::vector<double> M, from,
      onto;               ///< what couples them: M, C by mode and coordinate, C the other way round
  std::vector<double> C;  ///< of each by itself; with `from` and `onto` empty where there is none
};

/// Craig-Bampton reduction (Craig & Bampton, AIAA J. 6(7), 1968): x = T x_r with T = [I 0; Psi Phi] over
/// (kept, internal) dofs, constraint modes Psi = -K_ii^-1 K_ib and component modes Phi. Kept dofs come first,
/// in the order given, then the component modes. The reduced matrices stand whole on every rank, T by rows on
/// the rank that owns the dof (dofs x size doubles in all).
class Reduction {
 public:
  /// K, M, C: AIJ of one row layout, K and M symmetric; C may be null. `kept`: global dofs, the same list on
  /// every rank. Collective. InputError, on every rank, for unusable dofs, counts or matrices.
  Reduction(Mat K, Mat M, Mat C, std::vector<PetscInt> kept, ComponentModes wanted);
  PetscInt size() const { return PetscInt(kept_.size() + component_omega_.size()); }
  PetscInt local_dofs() const { return local_; }
  std::vector<PetscInt> const& kept() const { return kept_; }
  /// Reduced matrices (size x size), symmetric except for C (column by column); C is empty where none was
  /// given.
  std::vector<double> const& K() const { return K_; }
  std::vector<double> const& M() const { return M_; }
  std::vector<double> const& C() const { return C_; }
  /// Frequencies of the component modes [rad/s], ascending.
  std::vector<double> const& component_omega() const { return component_omega_; }
  OmittedModes const& omitted() const { return omitted_; }
  ReductionTimes const& times() const { return times_; }
  /// This rank's rows of T x_r for several x_r: (size x count) in and (local_dofs x count) out, row by row.
  std::vector<double> expand(std::span<double const> reduced, PetscInt count) const;
  /// T^T f for several f: this rank's rows (local_dofs x count) in, (size x count) out on every rank, row by
  /// row. Collective.
  std::vector<double> project(std::span<double const> forces, PetscInt count) const;

 private:
  using Columns = std::vector<double>;  ///< this rank's rows, column by column
  static PetscInt panel_of(PetscInt columns);
  double* column(PetscInt j) { return T_.data() + size_t(j) * size_t(local_); }
  Columns moved(BlockedProduct& A, PetscInt begin, PetscInt end, Columns* low = nullptr);
  std::vector<double> place_constraint_modes(Mat K, FixedInterface const&);
  void add_inside(Mat X, PetscInt begin, PetscInt end);
  void place_left(Columns const& KT, Mat B, PetscInt columns);
  void take_forces(Columns& KT, Columns const& low, PetscInt begin, PetscInt end,
                   std::vector<double>& of_kept);
  void place_component_modes(std::vector<ComponentMode> const&);
  std::vector<double> congruence(Mat A, bool symmetric);
  void omit(PetscInt modes);

  MPI_Comm comm_ = MPI_COMM_NULL;
  PetscInt local_ = 0, global_ = 0, first_ = 0;
  std::vector<PetscInt> kept_, internal_;  ///< the latter this rank's, ascending
  std::vector<double> component_omega_, K_, M_, C_, T_;
  OmittedModes omitted_;
  ReductionTimes times_;
};

}  // namespace fretwave::model
