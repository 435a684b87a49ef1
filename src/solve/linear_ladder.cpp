/// Ways to solve a linear system where GMRES fails, one dearer than the other.
#include <algorithm>

#include "solve/direct.h"
#include "solve/linear_solver.h"
#include "solve/memory.h"
#include "tuned.h"

namespace fretwave::solve {

namespace {

const Tuned most_beside(
    "linear_whole", 4,
    "bytes of a factor of the whole system over those of the condensed contact, up to which "
    "it is taken before that");
const Tuned longest_stay("linear_longest_stay", 256, "points between two tries at the foot of the ladder");

}  // namespace

bool LinearSolver::climb() {
  if (!own_) return false;  // PETSc's ways are the user's own
  stale_ = true, solved_ = 0;
  if (!built_here_) {
    ++fallbacks_.rebuilt;
    return true;
  }
  if (rung_ > 0) return rung_ < 2 && take_whole();
  const auto [condensed, bytes] = condensing();
  if (bytes == 0 || whole_bytes() <= most_beside * bytes)
    return take_whole() || (bytes > 0 && take_condensed(*condensed, bytes));
  return take_condensed(*condensed, bytes) || take_whole();
}

/// What condenses the system on its contact, and the bytes it takes; none and 0 if nothing does.
std::pair<PreconditionerKind const*, double> LinearSolver::condensing() const {
  Problem& problem = bordered_.problem();
  const auto helps = [&](PreconditionerKind const& kind) {
    return &kind != kind_.kind && kind.fallback_bytes && kind.refuses(problem).empty();
  };
  const auto found = std::ranges::find_if(kinds(), helps);
  if (found == kinds().end()) return {nullptr, 0};
  return {&*found, found->fallback_bytes(problem)};
}

bool LinearSolver::take_condensed(PreconditionerKind const& kind, double bytes) {
  if (!fits(bytes, "the condensed contact system")) return false;
  fallback_ = kind.make(bordered_.problem());
  rung_ = 1, ++fallbacks_.condensed;
  fallbacks_.said = "GMRES stalls: the condensed contact system is factorised (" + gigabytes(bytes) + ")";
  return true;
}

double LinearSolver::whole_bytes() const {
  return WholeFactor::bytes(bordered_.problem(), double(unknowns()));
}

bool LinearSolver::take_whole() {
  const double bytes = whole_bytes();
  if (!fits(bytes, "a factor of the whole system")) return false;
  fallback_ = std::make_unique<WholeFactor>(bordered_, prefix_);
  rung_ = 2, ++fallbacks_.whole;
  fallbacks_.said = "GMRES stalls: all " + std::to_string(unknowns()) + " unknowns are factorised (about " +
                    gigabytes(bytes) + ")";
  return true;
}

bool LinearSolver::fits(double bytes, std::string const& what) {
  const double available = available_bytes(bordered_.problem().comm());
  if (bytes <= memory_share * available) return true;
  fallbacks_.said =
      what + " does not fit: about " + gigabytes(bytes) + ", of " + gigabytes(available) + " free";
  return false;
}

void LinearSolver::descend() {
  if (!rung_ || ++solved_ < stay_) return;
  rung_ = 0, solved_ = 0, stale_ = true;
  stay_ = std::min(longest_stay.count(), 2 * stay_);
  fallback_.reset();
}

}  // namespace fretwave::solve
