#pragma once
#include <exception>
#include <string>

#include "solve/bordered.h"

namespace fretwave::solve {

struct Outcome {
  bool converged = false;
  int newton = 0, linear = 0;
  double residual = 0;
  std::string reason;  ///< PETSc's converged or diverged reason
};

/// SNES on a bordered problem. Two routes to the same corrector (DESIGN section 4), chosen by size or by
/// -<prefix>route: direct (assembled, LU) and krylov (matrix-free product, the problem's own preconditioner,
/// rebuilt when iterations rise). PETSc options apply under the prefix; ours are only its defaults.
class Newton {
 public:
  Newton(Problem&, std::string const& prefix);
  Newton(Newton const&) = delete;
  Bordered& system() { return bordered_; }
  SNES snes() const { return snes_; }
  /// "direct" or "krylov", with the reason of the choice.
  std::string route() const;
  /// Solves from y, in place; y is the last iterate when it does not converge. Collective.
  Outcome solve(Vec y);
  /// Tangent at y: J t = 0, row . t = 1 with the closing row. t holds a guess (zero, or the last tangent),
  /// from which the Krylov route starts. Collective.
  bool tangent(Vec y, Vec t);
  /// J x = b at y with the closing row, from x where the Krylov route is taken. Collective.
  bool linear(Vec y, Vec b, Vec x);

 private:
  static PetscErrorCode converged(SNES, PetscInt iteration, PetscReal unknowns, PetscReal step,
                                  PetscReal residual, SNESConvergedReason*, void*);
  static PetscErrorCode form_function(SNES, Vec, Vec, void*);
  static PetscErrorCode form_jacobian(SNES, Vec, Mat, Mat, void*);
  static PetscErrorCode shell_product(Mat, Vec, Vec);
  static PetscErrorCode shell_precondition(PC, Vec, Vec);
  void choose_route(std::string const& prefix);
  void use_direct();
  void use_krylov();
  bool solve_linear(Vec b, Vec x);
  void linearise(Vec y);
  void count_iterations();
  bool at_rounding(Vec y);

  Bordered bordered_;
  MatHandle J_;
  SnesHandle snes_;
  VecHandle right_side_, point_;
  std::unique_ptr<Preconditioner> preconditioner_;
  bool stale_ = true;
  int fresh_ = -1;          ///< Krylov iterations of the first solve after a build; -1: none yet
  int excess_ = 0;          ///< iterations beyond that, of all solves since
  double first_reuse_ = 0;  ///< iterations beyond it that the first reuse cost when it was last tried, halved
                            ///< at every build since
  double residual_before_ = 0;  ///< at the iteration before
  std::string route_;
  std::exception_ptr exception_;
};

}  // namespace fretwave::solve
