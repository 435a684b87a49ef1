#include <optional>
#include <utility>

#include "solve/continuation.h"
#include "solve/vectors.h"

/// Facets that a branch touches from both sides: where opposite discs begin to hold a slider, or cease to.
///
/// delta is what the slider has to go between the two, or less than nothing, by how far they overlap. Where
/// it goes round it lags by the root of delta behind the line of their centres, where it is held it lies in a
/// corner of what they have in common, the root of -delta beside it: w = w_c + k eta c with eta^2 = |delta|
/// and another k on either side. In R(y, w) = 0 both pieces leave the facet along R_y v = -R_w c with v .
/// delta_y = 0, each its own way: where the two k have one sign the branch turns right round, and the
/// tangent's extension need not meet the other piece. There J = R_y + g (R_w c) delta_y^T, g = +-k / (2 eta)
/// without bound, which tells delta_y.
namespace fretwave::solve {

namespace {

constexpr double longest = 1e-4, nearer = 2;              // steps in which such a facet is passed
constexpr double shallow = 0.01, deep = 100, deeper = 3;  // across, in squares of these
constexpr int powers = 3;  // of J^T J, by which its stiffest direction is found

}  // namespace

/// Whether a facet lies between two places that is seen finely alone, of systems whose determinant can be
/// asked. Collective.
bool Continuation::round_facet(Vec a, Vec b) {
  return small(a) && problem_.piece(a) == problem_.piece(b) &&
         problem_.piece(a, true) != problem_.piece(b, true);
}

/// Whether two solutions lie on two sheets that touch such a facet where they meet, of small systems: both
/// tangents point the same way, the branch goes along one of them and comes back along the other. Collective.
bool Continuation::on_other_sheet(Trial const& a, Trial const& b) {
  return round_facet(a.y, b.y) &&
         determinant(a.y, weighted(weights_, a.tangent)) * determinant(b.y, weighted(weights_, b.tangent)) <
             0;
}

/// The direction of which the Jacobian at the anchor makes most, of length 1. Collective.
VecHandle Continuation::stiffest() {
  newton_.system().close(row_, 0);
  MatHandle J = newton_.system().matrix();
  newton_.system().assemble(anchor_.y, J);
  VecHandle across = copy(anchor_.tangent), forces = like(across);
  check(VecSet(across, 1));
  for (int k = 0; k < powers; ++k) {
    check(MatMult(J, across, forces));
    check(MatMultTranspose(J, forces, across));
    check(VecScale(across, 1 / norm(across)));
  }
  return across;
}

/// Whether the branch has just come over such a facet: it leaves it first, while the sheets are so near to
/// each other that Newton finds either. Collective.
bool Continuation::just_touched() { return before_.y && round_facet(before_.y, anchor_.y); }

/// The branch behind such a facet, by a tangent across it. Collective.
std::optional<Continuation::Trial> Continuation::turn_round_facet(Vec across, double length) {
  const auto tangent = tangent_at(across);
  if (!tangent) return {};
  const int sign = anchor_sign() * determinant(across, weighted(weights_, *tangent));
  if (!sign) return {};
  check(VecScale(*tangent, sign));
  finely_ = true;
  auto trial = along_piece(across, *tangent, length, length, 0);
  finely_ = false;
  if (!trial || !round_facet(anchor_.y, trial->y) || orientation(trial->y, trial->tangent) <= 0) return {};
  return trial;
}

/// The same where no step leads on: by tangents from as far across as the branch is there, some square of the
/// length. Not over an end of the range, which may lie just before the facet. Collective.
std::optional<Continuation::Trial> Continuation::behind_touched_facet(double& length) {
  if (!anchor_sign() || just_touched()) return {};
  const VecHandle across = stiffest();
  const auto here = problem_.piece(anchor_.y, true);
  for (length = longest; length >= steps_.minimum; length /= nearer)
    for (double way = shallow; way < deep; way *= deeper)
      for (const double side : {1.0, -1.0}) {
        const VecHandle there = moved(anchor_.y, side * way * length * length, across);
        if (problem_.piece(there, true) == here) continue;
        auto trial = turn_round_facet(there, length);
        if (trial && !outside(trial->y)) return turned(std::move(trial), length);
      }
  return {};
}

}  // namespace fretwave::solve
