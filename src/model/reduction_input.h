#pragma once
#include <vector>

#include "model/component_modes.h"

namespace fretwave::model {

/// Can these matrices be reduced to these dofs? Throws InputError on every rank, or on none. Collective.
void check_reduction_input(Mat K, Mat M, Mat C, std::vector<PetscInt> const& kept, ComponentModes wanted);

}  // namespace fretwave::model
