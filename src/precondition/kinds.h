#pragma once
#include "hb/harmonic_problem.h"
#include "solve/preconditioner.h"

namespace fretwave::precondition {

using namespace hb;

/// A kind for harmonic problems that are no statics.
template <class P>
solve::PreconditionerKind harmonic_kind(std::string type, std::string blocks,
                                        std::function<bool(HarmonicProblem const&)> suits,
                                        std::function<std::string(HarmonicProblem const&)> refuses) {
  const auto harmonic = [](solve::Problem& problem) { return dynamic_cast<HarmonicProblem*>(&problem); };
  const auto moves = [](HarmonicProblem const* problem) {
    return problem && problem->harmonics().fundamental() >= 0;
  };
  return {.type = std::move(type),
          .blocks = std::move(blocks),
          .suits = [=](solve::Problem& p) { return moves(harmonic(p)) && suits(*harmonic(p)); },
          .refuses = [=](solve::Problem& p) -> std::string {
            if (!harmonic(p)) return "a problem without harmonics";
            return moves(harmonic(p)) ? refuses(*harmonic(p)) : "a static problem";
          },
          .make = [=](solve::Problem& p) { return std::make_unique<P>(*harmonic(p)); }};
}

/// All of this room, the best first (wheels' own come before them).
void register_kinds();

}  // namespace fretwave::precondition
