#pragma once
#include <optional>

#include "hb/harmonic_problem.h"
#include "solve/newton.h"

namespace fretwave::hb {

/// Changes of a point's scalars (HarmonicProblem::scalars) at the same parameter, by what is left out, and by
/// all of it.
struct LeftOut {
  std::vector<double> harmonics, samples, solver, all;
};

/// What a point's discretisation leaves out of it. With ' for the same problem on the orders up to 2 H + 1
/// and four times the samples, and the point embedded there with zeros, one Newton step of its equations is
///
///   J' dy' = -r',   r' = (r'_old, r'_new),
///
/// closed as the continuation's: at a right angle to the branch's tangent t, for at a fold there may be
/// nothing at the same parameter. From there the branch leads to it: dy = dy' + s t with no change of the
/// last entry, as far as a straight line goes (|s| <= `reach`). Harmonics left out answer for -r'_new, the
/// contact force outside the retained orders, samples for r - r'_old, the change of the retained rows on more
/// samples (rounding in continuous time), and the solver for -r, what it left; a source next to nothing is
/// not solved for and has its share of r'. Error estimation by a hierarchical basis (Bank & Smith 1993): what
/// the estimate misses is as much smaller as the finer set is better, and the square of the error.
class DiscretisationError {
 public:
  /// `prefix`: of the PETSc options of J' dy' = b. Collective.
  DiscretisationError(HarmonicProblem&, std::string const& prefix);
  /// Why nothing is estimated: its factors would not fit the memory; empty if they do.
  std::string const& left_out() const { return left_out_; }
  /// At a converged point with its tangent; none where J' is singular. Collective.
  std::optional<LeftOut> at(Vec y, Vec tangent);

 private:
  VecHandle retained(Vec r) const;
  VecHandle right_side(Vec r) const;
  void close(Vec y, Vec tangent);

  HarmonicProblem& problem_;
  std::string left_out_;
  std::unique_ptr<HarmonicProblem> finer_;
  std::unique_ptr<solve::Newton> newton_;
};

}  // namespace fretwave::hb
