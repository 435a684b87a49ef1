#pragma once
#include <string>

#include "solve/bordered.h"
#include "solve/guard.h"

namespace fretwave::solve {

/// The bordered system linearised at a point, for Newton's steps and for solves beside them (tangents). Two
/// routes (DESIGN section 4), chosen by size or by -<prefix>route: direct (assembled, LU) and krylov
/// (matrix-free product, the problem's own preconditioner, rebuilt when iterations rise). PETSc options apply
/// under the prefix; ours are only its defaults. Solves beside Newton's have a KSP of their own, prefix
/// <prefix>tangent_, with the same operator and preconditioner: how roughly Newton's steps are solved for is
/// a matter of cost, a tangent's error is one of the branch.
class LinearSolver {
 public:
  /// Configures the KSP of the SNES, which must outlive this.
  LinearSolver(Bordered&, std::string const& prefix, SNES);
  LinearSolver(LinearSolver const&) = delete;
  /// After SNESSetFromOptions.
  void make_tangent(std::string const& prefix);
  Mat jacobian() const { return J_; }
  /// "direct" or "krylov", with the reason of the choice.
  std::string route() const;
  /// Point and factors of the solves that follow; false where it is singular. `newton`: one of Newton's
  /// follows. Collective.
  bool linearise(Vec y, bool newton);
  /// J x = b from x where the Krylov route is taken, to the tangent's tolerance. Collective.
  bool solve(Vec b, Vec x);
  /// Of the residual by Newton's last linear solve.
  double last_reduction() const;
  /// The next linearisation builds the preconditioner anew.
  void renew() { stale_ = true; }
  Guard& guard() { return guard_; }

 private:
  static PetscErrorCode shell_product(Mat, Vec, Vec);
  static PetscErrorCode shell_precondition(PC, Vec, Vec);
  void choose_route(std::string const& prefix);
  void use_direct();
  void give_mumps_room(KSP);
  void use_krylov();
  bool factorise();
  bool solve_once(Vec b, Vec x);
  void count_iterations();

  Bordered& bordered_;
  SNES snes_;
  MatHandle J_;
  KspHandle tangent_;
  VecHandle point_;
  std::unique_ptr<Preconditioner> preconditioner_;
  bool stale_ = true, uncounted_ = false;
  int fresh_ = -1;          ///< Krylov iterations of the first solve after a build; -1: none yet
  int excess_ = 0;          ///< iterations beyond that, of all solves since
  double first_reuse_ = 0;  ///< iterations beyond it that the first reuse cost when it was last tried, halved
                            ///< at every build since
  std::string route_;
  Guard guard_;
};

}  // namespace fretwave::solve
