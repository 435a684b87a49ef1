#pragma once
#include <string>

/// Named places at which a test lets one rank fail (FRETWAVE_FAULT, cases/robustness/FAULTS.md). In a run of
/// its own nothing is armed, and a place costs one comparison. None stands inside a loop over samples or
/// pairs.
namespace fretwave::fault {

namespace detail {
extern bool armed;
bool meets(char const* place, bool value);
[[noreturn]] void raise(char const* place);
}  // namespace detail

/// Arms this process: at the `count`-th pass of the place it fails by `kind`: error, input, memory (an
/// exception of that kind) or value (what the place itself calls a failure).
void arm(std::string const& place, std::string const& kind, int count);

/// Arms this process if the text "place:kind:count:rank" (FRETWAVE_FAULT; null: nothing) names its rank.
void arm_from(char const* text, int rank);

/// Throws if this is where and when.
inline void point(char const* place) {
  if (detail::armed && detail::meets(place, false)) detail::raise(place);
}
/// True if the value computed here shall be a failed one.
inline bool value(char const* place) { return detail::armed && detail::meets(place, true); }

}  // namespace fretwave::fault
