#pragma once
#include "model/modes.h"

namespace fretwave::model {

/// (K + s C + s^2 M) phi = 0 with the contact's tangents at rest: the oscillating modes alone, `count` at
/// least where there are so many, in any order. Collective.
std::vector<LinearMode> damped_modes(Model const&, int count);

/// The same of (K + s^2 M) phi = 0 with an unsymmetric K, as circulatory forces make it: modes without
/// damping may flutter. Contact stuck or free; `InputError` of rigid contact, and of modes near a frequency.
/// Collective.
std::vector<LinearMode> circulatory_modes(Model const&, int count, bool stuck, std::optional<double> near);

}  // namespace fretwave::model
