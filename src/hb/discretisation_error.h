#pragma once
#include <array>
#include <optional>
#include <span>

#include "hb/harmonic_problem.h"
#include "solve/newton.h"

namespace fretwave::hb {

/// Changes of a point's scalars (HarmonicProblem::scalars) at the same parameter, by what is left out, and by
/// all of it.
struct LeftOut {
  std::vector<double> all;
  std::array<std::vector<double>, 4> by_source;  ///< harmonics, samples, solver, reduction
};

/// What a point's discretisation leaves out of it. With ' for the same problem on the orders up to
/// H' = H + 3 H / 4, 17 at the least (up to 2 H + 1 for H < 4 on large models), and four times the samples,
/// and the point embedded there with zeros, one Newton step of its equations is
///
///   J' dy' = -r',   r' = (r'_old, r'_new),
///
/// closed as the continuation's: at a right angle to the branch's tangent t, for at a fold there may be
/// nothing at the same parameter. From there the branch leads to it: dy = dy' + s t with no change of the
/// last entry, as far as a straight line goes, and beside a fold as its parabola does (|s| <= `reach`).
/// Harmonics left out answer for -r'_new, the contact force outside the retained orders, and as much more as
/// lies above H', samples for r - r'_old, the change of the retained rows on more samples (rounding in
/// continuous time), and the solver for -r, what it left; what a reduction has left out of the model is given
/// as a residual of the point's equations. A source next to nothing is not solved for and has its share of
/// r'. Error estimation by a hierarchical basis (Bank & Smith 1993): what the estimate misses is as much
/// smaller as the finer set is better, and the square of the error.
///
/// That square is looked at. Along the step, for equations of the second order,
///
///   r'(y + s dy') = (1 - s) r' + s^2 q,   c = q . r' / r' . r',
///
/// of which one more residual tells q. Its part along r' vanishes at s = 2 / (1 + sqrt(1 - 4 c)), and is the
/// least at s = 1 / (2 c) where c > 1/4: so far the step goes. Where c is not small (`bent`) it is
/// taken anew with the Jacobian halfway there, for r' + J'(y + dy' / 2) dy' = 0 holds for such equations
/// without any error (the implicit midpoint rule). Others are bent still: where systems are small enough for
/// the direct route, the finer equations are then solved (`finish`).
class DiscretisationError {
 public:
  /// `prefix`: of the PETSc options of J' dy' = b. Collective.
  DiscretisationError(HarmonicProblem&, std::string const& prefix);
  /// Why nothing is estimated: its systems would not fit the memory; empty if they do.
  std::string const& left_out() const { return left_out_; }
  /// At a converged point with its tangent; none where J' is singular. Collective.
  std::optional<LeftOut> at(Vec y, Vec tangent, Vec reduction = nullptr);

 private:
  VecHandle retained(Vec r) const;
  VecHandle right_side(Vec r) const;
  VecHandle left_side(Vec b) const;
  VecHandle closing_row(Vec y, Vec tangent);
  std::array<VecHandle, 4> residuals(Vec y, Vec point, Vec reduction);
  std::optional<bool> step(Vec point, Vec row, Vec reduction, std::span<Vec const> b, std::span<Vec const> x);
  double to_moved() const;
  double square_up_to(int highest, Vec force) const;
  std::optional<double> fall(Vec force) const;
  double bound(int order) const;
  double all_above(Vec force) const;
  double bend(Vec point, Vec r, Vec reduction, Vec step);
  double curvature(Vec point, Vec row, Vec tangent);
  void from_halfway(Vec middle, Vec row, std::span<Vec const> b, std::span<Vec const> x);
  void finish(Vec point, Vec row, double residual, std::span<Vec const> x, Vec most);

  HarmonicProblem& problem_;
  std::string prefix_, left_out_;
  bool of_velocity_ = false;                ///< a contact force follows it
  std::unique_ptr<HarmonicProblem> finer_;  ///< of the point, which moves in H harmonics alone
  std::unique_ptr<HarmonicProblem> moved_;  ///< of where the step leads, which moves in all
  std::unique_ptr<solve::Newton> newton_, again_;
};

}  // namespace fretwave::hb
