#pragma once
#include <array>
#include <string>

#include "solve/linear_solver.h"

namespace fretwave::solve {

struct Outcome {
  bool converged = false;
  int newton = 0, linear = 0;
  double residual = 0;
  std::string reason;           ///< PETSc's converged or diverged reason, or ours
  bool accepted = false;        ///< by the tolerance; a converged solve that is not ended at rounding
  double rounding = 0;          ///< expected in the residual
  bool linear_failure = false;  ///< the last linear system was not solved, or was singular
  int refined = 0;              ///< of the Newton steps, those taken where rounding hides the residual
};

/// What a guess is worth. `brief`: given up once the residual creeps; `plain`: PETSc's iterations; `full`:
/// those again with the search past kinks; `rough`: the same, to a few digits of the guess's error.
enum class Effort { brief, plain, full, rough };

/// SNES on a bordered problem, whose linear systems `LinearSolver` solves.
class Newton {
 public:
  /// `past_kinks`: a step that backtracking cannot make is tried by the secant line search, which may end on
  /// another branch; for callers that look where they have come to.
  Newton(Problem&, std::string const& prefix, bool past_kinks = true);
  Newton(Newton const&) = delete;
  Bordered& system() { return bordered_; }
  SNES snes() const { return snes_; }
  /// "direct" or "krylov", with the reason of the choice.
  std::string route() const { return linear_->route(); }
  /// An iteration costs more than what is done with a point.
  bool dear() const { return linear_->krylov(); }
  /// A large problem, whose steps are solved no further than they are good for.
  bool aims() const { return linear_->aims(); }
  Fallbacks const& fallbacks() const { return linear_->fallbacks(); }
  /// Measures the rows in the forces that act at y, as `solve` does first; whether they were in others.
  bool scale(Vec y);
  /// Solves from y, in place; y is the last iterate when it does not converge. Collective.
  Outcome solve(Vec y, Effort = Effort::full);
  /// Without a step: converged if there is nothing left that one would take away. Collective.
  Outcome as_it_stands(Vec y);
  /// Tangent at y: J t = 0, row . t = 1 with the closing row. t holds a guess (zero, or the last tangent),
  /// from which the Krylov route starts. Good for a step, or `exactly` for its own values. Collective.
  bool tangent(Vec y, Vec t, bool exactly = false);
  /// J x = b at y with the closing row, from x where the Krylov route is taken. Collective.
  bool linear(Vec y, Vec b, Vec x);
  bool linear(Vec y, std::span<Vec const> b, std::span<Vec const> x, double rounding = 0, double share = 0);
  /// For one that `linear` alone is asked of: how exactly, relative to b.
  void solve_beside(double tolerance) { linear_->serve_beside(tolerance); }

 private:
  static PetscErrorCode converged(SNES, PetscInt iteration, PetscReal unknowns, PetscReal step,
                                  PetscReal residual, SNESConvergedReason*, void*);
  static PetscErrorCode shorten(SNESLineSearch, Vec y, Vec step, PetscBool* changed, void*);
  static PetscErrorCode form_function(SNES, Vec, Vec, void*);
  static PetscErrorCode form_jacobian(SNES, Vec, Mat, Mat, void*);
  Outcome solve_past_kinks(Vec y);
  Outcome solve_persistently(Vec y);
  Outcome solve_once(Vec y);
  void refine(Vec y, Outcome&);
  std::string explain_step(Vec y);
  SNESConvergedReason judge(Vec y, double unknowns, double step, double residual, double residual_before);
  bool below_tolerance(double residual, double share = 1) const;
  bool matters(Vec y, double residual, double before);
  bool stuck_at_rounding(Vec y);
  bool creeps(int iteration, double residual);
  double rounding(Vec y);
  void aim(Vec y);
  double last_effect(Vec y);

  Bordered bordered_;
  SnesHandle snes_;
  std::unique_ptr<LinearSolver> linear_;
  VecHandle right_side_;
  bool past_kinks_;
  Effort effort_ = Effort::full;
  std::array<double, 4> last_{};  ///< residuals of the last iterations, the k-th at k mod 4
  double began_from_ = 0;         ///< residual of the guess
  double step_from_ = 0;          ///< that where the last step began
  std::optional<double> left_;    ///< of it by that step; none where none was taken
};

}  // namespace fretwave::solve
