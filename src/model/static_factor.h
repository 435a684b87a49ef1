#pragma once
#include <memory>
#include <string>
#include <vector>

#include "guard.h"
#include "model/substructures.h"
#include "petsc.h"

namespace fretwave::model {

/// L D L^T of a real symmetric stiffness by MUMPS, and solves with many columns at once, each rank with its
/// dofs of them. On several ranks by substructures, where few dofs lie between the ranks; else over all
/// ranks, and a small one is held whole by every rank too, which then solves for its share of the columns:
/// MUMPS' triangular solves on two ranks take as long as on one.
class StaticFactor {
 public:
  /// Factorises. Collective.
  explicit StaticFactor(Mat K);
  bool definite() const { return definite_; }
  /// y = K^-1 x: coefficients, innermost, of this rank's dofs. Collective.
  void solve(double const* x, int coefficients, double* y) const;
  /// X = K^-1 B of dense matrices. Collective.
  void solve(Mat B, Mat X) const;
  /// Solves with one column, for SLEPc; `rethrow` behind it what was thrown meanwhile.
  KSP ksp() const { return ksp_; }
  void rethrow() const { of_parts_.guard.rethrow(); }
  Mat stiffness() const { return K_; }
  PetscInt local_dofs() const { return local_; }
  /// In words, where it is one of substructures.
  std::string divided() const;
  /// Of all ranks: what the factors took [MB], and their entries.
  double megabytes() const { return megabytes_; }
  double entries() const { return entries_; }

 private:
  void take_parts();
  static PetscErrorCode solve_parts(PC, Vec x, Vec y);
  void take_whole();
  void hold_whole();
  void solve_share(double const* x, int coefficients, double* y) const;
  void solve_whole(std::vector<double>& parts, std::vector<int> const& first, int columns) const;

  MPI_Comm comm_ = MPI_COMM_NULL;
  MatHandle K_, whole_K_;
  KspHandle ksp_, whole_;
  std::unique_ptr<Substructures> parts_;
  struct OfParts {
    Substructures const* parts = nullptr;
    Guard guard;
  };
  mutable OfParts of_parts_;     ///< what the KSP's shell has
  std::vector<PetscInt> first_;  ///< dof of each rank, and the number of all
  PetscInt local_ = 0;
  bool definite_ = false;
  double megabytes_ = 0, entries_ = 0;
};

/// Dense, of so many columns, with rows where a square matrix has them. Collective.
MatHandle dense_columns(Mat like, PetscInt columns);

}  // namespace fretwave::model
