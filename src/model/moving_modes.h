#pragma once
#include <optional>
#include <vector>

namespace fretwave::model {

struct MovingModes {
  std::vector<double> theta, columns;
};

/// Columns Psi of unit stiffness, Psi^T K Psi = 1, of which the first are modes M phi = theta K phi, theta
/// descending, down to `least` of the largest at least, and the others anything that makes them whole: those
/// move with stiffness alone. K = U^T U and Psi = U^-1 Q, with Q's first columns the eigenvectors of U^-T M
/// U^-1 by SLEPc, the others by Householder's reflections. All modes by a tridiagonal matrix take nine n^3
/// operations, half of the reduction bound by the memory, this 5 / 3 n^3.
///
/// K, M dense, n x n; none where K is not positive definite, or an eighth of the modes does not reach so far.
std::optional<MovingModes> moving_modes(std::vector<double> K, std::vector<double> M, int n, double least);

}  // namespace fretwave::model
