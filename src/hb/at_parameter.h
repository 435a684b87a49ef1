#pragma once
#include <functional>
#include <vector>

namespace fretwave::hb {

/// Scalars of dy' + s t without a change of the last of `count`, the parameter; of several such the one that
/// is off the most.
/// tangent: of the branch at the point, in arclength; curvature: of the parameter along it, asked for where a
/// straight line does not lead there.
std::vector<double> at_parameter(std::vector<double> const& change, std::vector<double> const& tangent,
                                 std::function<double()> const& curvature, int count);

/// Arclength by which a branch is followed to a parameter, at the most.
double farthest();

}  // namespace fretwave::hb
