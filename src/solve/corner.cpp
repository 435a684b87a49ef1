#include <cmath>

#include "lapack.h"
#include "solve/continuation.h"

/// Corners of a branch: a sample changes state (stick, slip, contact) and the Jacobian jumps, J_B = J_A + c
/// n^T, n the normal of the facet between the pieces A and B. The branch then turns by any angle, also by
/// more than a right one, where no plane across the old tangent meets it again.
///
/// Which way it goes on: the tangent t spans the null space of J, and det [J; t^T] has one sign on all pieces
/// (Allgower & Georg, Introduction to Numerical Continuation Methods, 2003, section 14: det [J_B; n^T] = det
/// [J_A; n^T], so that n . t_A and n . t_B agree). Small systems take it from a factorisation, whatever
/// number of facets lies between. Large ones use J_B t_A = c (n . t_A) and -J_A t_B = c (n . t_B): the right
/// t_B is the one for which these two point the same way, if a single facet lies between.
namespace fretwave::solve {

namespace {

constexpr PetscInt small = 1000;    // unknowns whose determinant is had in some 50 ms
constexpr PetscInt quick = 300;     // unknowns whose determinant is had in a few ms
constexpr double one_facet = 0.98;  // least cosine between the two vectors of a single facet
constexpr double no_corner = 1e-6;  // 1 - cosine of the angle between the tangents

struct Entry {
  PetscInt row, col;
  double value;
};

}  // namespace

/// Sign of det [J(y); row], 0 if it is singular or too large to tell. Collective.
int Continuation::determinant(Vec y, Vec row) {
  PetscInt size;
  check(VecGetSize(y, &size));
  if (size > small) return 0;
  newton_.system().close(row, 0);
  MatHandle J = newton_.system().matrix();
  newton_.system().assemble(y, J);
  std::vector<Entry> mine;
  for_entries(J, [&](PetscInt i, PetscInt j, double value) { mine.push_back({i, j, value}); });
  const int n = int(size);
  std::vector<double> dense(size_t(n) * n, 0.0);
  for (auto const& e : gathered(std::span<Entry const>(mine), problem_.comm()))
    dense[size_t(e.col) * n + e.row] += e.value;
  std::vector<int> pivots(n);
  int info, sign = 1;
  dgetrf_(&n, &n, dense.data(), &n, pivots.data(), &info);
  if (info != 0) return 0;
  for (int i = 0; i < n; ++i) {
    const double pivot = dense[size_t(i) * n + i];
    if (!std::isfinite(pivot)) return 0;
    if ((pivot < 0) != (pivots[i] != i + 1)) sign = -sign;
  }
  return sign;
}

/// +1: `tangent` at y, behind a corner ahead of the anchor, leads on; -1: it leads back; 0: it cannot be
/// told. Collective.
int Continuation::orientation(Vec y, Vec tangent) {
  if (const int here = determinant(anchor_.y, row_))
    return here * determinant(y, weighted(weights_, tangent));
  VecHandle entering = problem_.equations(), leaving = problem_.equations();
  problem_.product(y, anchor_.tangent, entering);
  problem_.product(anchor_.y, tangent, leaving);
  const double cosine = -dot(entering, leaving) / std::sqrt(dot(entering, entering) * dot(leaving, leaving));
  if (!(std::abs(cosine) >= one_facet)) return 0;
  return cosine > 0 ? 1 : -1;
}

/// Whether a trial's tangent runs against the branch: an older piece of it, or another branch. Asked of small
/// systems, where a determinant costs less than a Newton step.
bool Continuation::leads_back(Trial const& trial) {
  PetscInt size;
  check(VecGetSize(trial.y, &size));
  return size <= quick && orientation(trial.y, trial.tangent) < 0;
}

/// The branch behind a corner that lies less than `reach` ahead. The tangent's extension beyond it is off the
/// branch, but it lies on the piece behind: its Jacobian gives that piece's tangent, along which Newton is
/// closed.
std::optional<Continuation::Trial> Continuation::turn_corner(double reach) {
  const VecHandle beyond = moved(anchor_.y, reach, anchor_.tangent);
  VecHandle tangent = copy(anchor_.tangent);
  newton_.system().close(row_, 0);
  if (!newton_.tangent(beyond, tangent)) return {};
  const double size = weighted_norm(weights_, tangent);
  if (!std::isfinite(size)) return {};
  check(VecScale(tangent, 1 / size));
  if (dot(row_, tangent) > 1 - no_corner) return {};
  const int sign = orientation(beyond, tangent);
  if (sign == 0) return {};
  check(VecScale(tangent, sign));
  const VecHandle row = weighted(weights_, tangent);
  const double along = dot(row, anchor_.tangent);
  const VecHandle guess = moved(beyond, reach * (1 - along), tangent);  // row . (guess - anchor) = reach
  Trial trial = at(copy(guess));
  if (!correct(trial, row, dot(row, guess), row)) return {};
  if (!(weighted_norm(weights_, moved(trial.y, -1, guess)) <= 4 * reach)) return {};
  if (!(dot(row, trial.tangent) >= std::cos(steps_.max_angle))) return {};
  if (orientation(trial.y, trial.tangent) < 0) return {};
  return trial;
}

}  // namespace fretwave::solve
