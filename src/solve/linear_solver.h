#pragma once
#include <initializer_list>
#include <optional>
#include <string>

#include "guard.h"
#include "solve/bordered.h"
#include "solve/preconditioner.h"

namespace fretwave::solve {

/// How often a linear solve that failed was tried in another way, and what is said of it.
struct Fallbacks {
  int rebuilt = 0;    ///< preconditioner built anew at the point
  int condensed = 0;  ///< the problem's dearer preconditioner taken
  int whole = 0;      ///< the whole system factorised
  std::string said;   ///< of the last that was taken, or why there was none left
};

/// The bordered system linearised at a point, for Newton's steps and for solves beside them (tangents). Two
/// routes, chosen by size or by -<prefix>route: direct (assembled, LU) and krylov
/// (matrix-free product, a kind of preconditioner for such problems, rebuilt when iterations rise). PETSc
/// options apply under the prefix; ours are only its defaults. Solves beside Newton's have a KSP of their
/// own, prefix <prefix>tangent_, with the same operator and preconditioner: how roughly Newton's steps are
/// solved for is a matter of cost, a tangent's error is one of the branch.
///
/// Where GMRES fails, `climb` goes up a ladder: the preconditioner built anew, the problem's fallback,
/// factors of the whole system, each if it fits the memory. After a while that grows with each climb the
/// solver goes back to the foot.
class LinearSolver {
 public:
  /// Configures the KSP of the SNES, which must outlive this.
  LinearSolver(Bordered&, std::string const& prefix, SNES);
  LinearSolver(LinearSolver const&) = delete;
  ~LinearSolver();
  /// After SNESSetFromOptions: what the options made of it is set up.
  void take_options();
  Mat jacobian() const { return J_; }
  /// "direct" or "krylov", with the reason of the choice.
  std::string route() const;
  bool krylov() const { return krylov_; }
  /// Point and factors of the solves that follow; false where it is singular. `newton`: one of Newton's
  /// follows; `left`: what the step from the last linearisation to here left of the residual; none: it is no
  /// step. The preconditioner stays where such steps leave next to nothing. Collective.
  bool linearise(Vec y, bool newton, std::optional<double> left = {});
  /// J x = b from x where the Krylov route is taken, to the tangent's tolerance, or to this residual, or
  /// share of b. Collective.
  bool solve(Vec b, Vec x, double rounding = 0, double share = 0);
  /// Share that is left by a tangent good enough to take a step along, of large problems; else 0.
  double rough() const { return rough_; }
  /// A large problem whose options leave open how far steps are solved.
  bool aims() const { return aims_; }
  /// The last step was solved to few digits, for it was not foretold to end the iteration.
  bool hurried() const { return aims_ && aimed_at_ > digits; }
  /// The digits of Newton's next step of such a one from this residual and the one before it; a residual of
  /// `enough` may end the iteration.
  void aim(double residual, double before, double enough);
  /// No Newton steps are asked for, but solves beside them alone, to this relative tolerance.
  void serve_beside(double tolerance);
  /// The next linearisation builds the preconditioner anew.
  void renew() { stale_ = true; }
  /// After a failure at the last linearisation: the next one tries another way; false if there is none left.
  /// Collective.
  bool climb();
  /// A point was solved for: back to the foot of the ladder in time.
  void descend();
  Fallbacks const& fallbacks() const { return fallbacks_; }
  Guard& guard() { return guard_; }

  /// Of a PC whose type is a kind of ours: PCSetUp, PCApply and PCView.
  PetscErrorCode set_up(PC);
  PetscErrorCode apply(Vec x, Vec z);
  /// None of our kinds has a transpose: says so.
  PetscErrorCode refuse_transpose();
  std::string description() const;

 private:
  static PetscErrorCode shell_product(Mat, Vec, Vec);
  static PetscErrorCode shell_transposed_product(Mat, Vec, Vec);
  void choose_route();
  PreconditionerKind const* asked_kind();
  void use_krylov();
  void make_preconditioner();
  void make_tangent();
  bool set_up();
  bool build();
  void follow();
  void serve_from_here();
  bool serves() const;
  void set_reach(Vec y, double left);
  bool solve_once(Vec b, Vec x);
  std::pair<PreconditionerKind const*, double> condensing() const;
  bool take_condensed(PreconditionerKind const&, double bytes);
  bool take_whole();
  double whole_bytes() const;
  PetscInt unknowns() const;
  bool given(std::initializer_list<char const*> options) const;
  bool fits(double bytes, std::string const& what);
  void count_iterations();
  Preconditioner& preconditioner() { return fallback_ ? *fallback_ : *own_; }

  KSP newton_ksp() const;

  static constexpr double digits = 1e-6;  ///< relative residual of a Newton step
  Bordered& bordered_;
  std::string prefix_;
  SNES snes_;
  MatHandle J_;
  KspHandle tangent_;
  VecHandle point_, served_;  ///< of the last linearisation; of which the preconditioner is
  ChosenKind kind_;
  std::unique_ptr<Preconditioner> own_, fallback_;  ///< none where options ask for a PC of PETSc's
  bool krylov_ = false, stale_ = true, uncounted_ = false, beside_ = false;
  double fresh_ = -1, last_fresh_ = -1;  ///< Krylov iterations of the first solve after a build, or that
                                         ///< before; -1: none yet
  double excess_ = 0;                    ///< iterations beyond that and a share of them, of all solves since
  double first_reuse_ = 0;  ///< iterations beyond it that the first reuse cost when it was last tried, halved
                            ///< at every build since
  double reach_ = 0;        ///< from `served_`: how far the preconditioner is as good; < 0: it is not
  bool built_here_ = false;                       ///< at the last linearisation
  double tangent_least_ = 0, tangent_floor_ = 0;  ///< of its residuals, by the options
  bool aims_ = false;
  double aimed_at_ = digits;    ///< relative residual of Newton's next step
  double rough_ = 0;            ///< of tangents that steps are taken along
  int rung_ = 0;                ///< of the ladder; 0: the problem's own preconditioner
  int stay_ = 32, solved_ = 0;  ///< points to stay up there, and points since
  Fallbacks fallbacks_;
  std::string route_, note_;
  Guard guard_;
};

}  // namespace fretwave::solve
