#pragma once
#include "model/modes.h"

namespace fretwave::model {

/// (K + s C + s^2 M) phi = 0 with the contact's tangents at rest: the oscillating modes alone, `count` at
/// least where there are so many, in any order. Collective.
std::vector<LinearMode> damped_modes(Model const&, int count);

}  // namespace fretwave::model
