#pragma once
#include <vector>

#include "model/component_modes.h"

namespace fretwave::model {

/// Error that rounding in K leaves in omega^2 [1/s^2]: modes that are closer form one eigenspace. Collective.
double rounding(Mat K, Mat M);

/// What x^T K x may be off by, from the digits that other programs print of K and the rounding of a
/// reduction: a motion with less is rigid. Collective.
double uncertainty(Mat K, Vec x);

/// Ascending, with signs, and the axes within an eigenspace, fixed by a rule that knows no number of ranks.
/// `resolution`: distance in omega^2 below which modes share an eigenspace. Collective.
void sort_and_orient(std::vector<ComponentMode>&, double resolution);

}  // namespace fretwave::model
