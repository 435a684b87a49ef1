#pragma once
#include <optional>

#include "model/model.h"

namespace fretwave::model {

/// What the contact does in a linear mode: closed and stuck, absent, or the law's tangent at rest.
enum class ContactState { stuck, free, linearised };

/// A linear mode lambda = -beta + i omega with its shape's real and imaginary parts (unit modal mass when
/// undamped).
struct LinearMode {
  double omega = 0, beta = 0;
  VecHandle shape, imaginary;
};

/// Lowest modes, ascending in omega, by SLEPc with shift-invert: K - w^2 M for stuck and free contact (no
/// damping; a K that is not symmetric makes some flutter), the quadratic problem with C for linearised
/// contact. At most `count`. Of a sector the waves with its nodal diameter, x_j = shape e^{-i j theta}.
/// `near` [rad/s]: of stuck or free contact those nearest to it instead of the lowest. A motion of negative
/// stiffness has no frequency, omega 0 if it is found at all; where the structure is to be `stable` it is
/// refused. Collective.
std::vector<LinearMode> linear_modes(Model const&, int count, ContactState, std::optional<double> near = {},
                                     bool stable = false);

}  // namespace fretwave::model
