#include <cmath>
#include <utility>

#include "lapack.h"
#include "solve/continuation.h"
#include "tuned.h"

/// Corners of a branch: a sample changes state (stick, slip, contact) and the Jacobian jumps, J_B = J_A + c
/// n^T, n the normal of the facet between the pieces A and B. The branch then turns by any angle, also by
/// more than a right one, where no plane across the old tangent meets it again.
///
/// Which way it goes on is seen from where things are: a solution behind the corner lies on the branch, which
/// comes to it from there. Else the tangent t spans the null space of J, and det [J; t^T] has one sign on all
/// pieces (Allgower & Georg, Introduction to Numerical Continuation Methods, 2003, section 14: det [J_B; n^T]
/// = det [J_A; n^T], so that n . t_A and n . t_B agree). A single facet, and several passed at once by
/// symmetry, have J_B t_A = c (n . t_A) and -J_A t_B = c (n . t_B): the right t_B is the one for which these
/// two point the same way. Where different ones lie between, one way along the new piece leads into it, the
/// other soon out again (not so between facets that are curved and lie side by side), or the determinant
/// itself is asked, of systems that are small enough. It deceives at a branch point, and where pieces are
/// passed that nothing shows.
namespace fretwave::solve {

namespace {

constexpr double surely_one = 1 - 1e-6;  // the same cosine, where nothing else can be: facets of two samples
                                         // side by side are alike
constexpr double one_facet = 0.98;       // least cosine between the two vectors of a single facet
constexpr double about = 1e-3;           // share of a place by which one looks before it and behind
constexpr double at_once = 1e-11;        // arclength: samples that by symmetry change their states together
constexpr double shortest = 1e-13;       // length of a piece that can be told from a point
constexpr double no_corner = 1e-6;       // 1 - cosine of the angle between the tangents
constexpr double no_force = 1e-3;        // of a tangent on the other piece, in forces that act
constexpr int halvings = 60;

const Tuned kink_angle("branch_kink_angle", 0.02, "turn [rad] that is a kink in so short a step");
const Tuned quick("branch_quick", 500,
                  "unknowns, at most 1000, up to which each step asks a determinant which way it leads");
const Tuned surely_in("branch_surely_in", 100,
                      "times as far within a piece one way as the other: it begins here");
const Tuned sparse("branch_sparse", 1.0 / 32,
                   "share of a step: corners farther apart are walked to one by one");
const Tuned seen_jump("branch_seen_jump", 3e-3,
                      "change of a tangent's forces across the end of a piece, in forces that act: a corner");
const Tuned lies_back("branch_lies_back", 0.1,
                      "share of the way to a point behind a corner, by which it may lie back on a tangent");
const Tuned meets("branch_meets", 0.1, "of the piece behind a corner: by which it may miss the one before");

}  // namespace

namespace {

/// Shares r and s of two directions in what lies nearest to a vector, from their products with each other
/// (aa, ab, bb) and with it (a, b).
std::pair<double, double> shares(double aa, double ab, double bb, double a, double b) {
  const double turned = aa * bb - ab * ab;
  return {(bb * a - ab * b) / turned, (aa * b - ab * a) / turned};
}

/// Of the determinant of n columns, 0 if they are singular.
int sign_of(std::vector<double> dense, int n) {
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

}  // namespace

/// At most 1000 unknowns, whose determinant takes some 50 ms.
bool Continuation::small(Vec y) { return global_size(y) <= 1000; }

/// Sign of det [J(y); row], 0 if it is singular or too large to tell. Collective.
int Continuation::determinant(Vec y, Vec row) {
  if (!small(y)) return 0;
  newton_.system().close(row, 0);
  MatHandle J = newton_.system().matrix();
  newton_.system().assemble(y, J);
  int sign = sign_of(whole(J), int(global_size(y)));
  MPI_Bcast(&sign, 1, MPI_INT, 0, problem_.comm());  // nearly singular it may be another one on another rank
  return sign;
}

/// Of the determinant at the anchor, which is asked once. Collective.
int Continuation::anchor_sign() {
  if (!anchor_.sign) anchor_.sign = determinant(anchor_.y, row_);
  return anchor_.sign;
}

/// Cosine between J_y t_anchor and -J_anchor t_y, c (n . t_anchor) and c (n . t_y) behind a single facet; 0
/// where the first is less than `least`. Collective.
double Continuation::along_facet(Vec y, Vec tangent, double least) {
  VecHandle entering = problem_.equations(), leaving = problem_.equations();
  problem_.product(y, anchor_.tangent, entering);
  if (dot(entering, entering) < least * least) return 0;
  problem_.product(anchor_.y, tangent, leaving);
  return -dot(entering, leaving) / std::sqrt(dot(entering, entering) * dot(leaving, leaving));
}

/// +1: `tangent` at y, behind a corner ahead of the anchor, leads on; -1: it leads back; 0: it cannot be
/// told. Facets that are passed at once by symmetry have the same c and n . t along it, and off it they may
/// turn the determinant's sign: it is asked where facets differ. Collective.
int Continuation::orientation(Vec y, Vec tangent) { return orientation(y, tangent, along_facet(y, tangent)); }

/// By the cosine along the facet. Collective.
int Continuation::orientation(Vec y, Vec tangent, double cosine) {
  const int by_products = cosine > 0 ? 1 : -1;
  if (std::abs(cosine) >= surely_one && !round_facet(anchor_.y, y)) return by_products;
  if (const int here = anchor_sign()) return here * determinant(y, weighted(weights_, tangent));
  return std::abs(cosine) >= one_facet ? by_products : 0;
}

/// Whether a trial lies along its tangent behind a corner that is ahead along the anchor's. A step so short
/// is two straight pieces, y - y_anchor = r t_anchor + s t: the branch leads from where they meet to the
/// trial, whatever determinants say. (These change their sign at a branch point, too, and where pieces are
/// passed that are shorter than can be seen.) In the anchor's metric, which does not see the mean.
bool Continuation::beyond_corner(Trial const& trial) const {
  const VecHandle chord = moved(trial.y, -1, anchor_.y), row = weighted(weights_, trial.tangent);
  const double across = dot(row_, trial.tangent), square = dot(row, trial.tangent),
               turned = square - across * across;
  const auto [r, s] = shares(1, across, square, dot(row_, chord), dot(row, chord));
  check(VecAXPY(chord, -r, anchor_.tangent));
  check(VecAXPY(chord, -s, trial.tangent));
  return s > 0 && r >= -meets * s && weighted_norm(weights_, chord) <= meets * s * std::sqrt(turned);
}

/// Whether a trial lies ahead on the anchor's tangent and on its own, which `sign` orients, but for a share
/// of the way: in all unknowns, the mean among them. Collective.
bool Continuation::straight_there(Trial const& trial, int sign) const {
  const VecHandle chord = moved(trial.y, -1, anchor_.y);
  Vec first = anchor_.tangent, second = trial.tangent;
  const double one = dot(first, first), both = dot(first, second), other = dot(second, second),
               ahead = dot(first, chord), slack = lies_back * norm(chord);
  if (!(one * other - both * both > no_corner * one * other)) return ahead >= 0;
  const auto [r, s] = shares(one, both, other, ahead, dot(second, chord));
  return r * std::sqrt(one) >= -slack && sign * s * std::sqrt(other) >= -slack;
}

/// Whether a trial's tangent runs against the branch: an older piece of it, or another branch, as a sheet
/// that begins beside it. Asked of small systems, where a determinant costs less than a Newton step. A branch
/// point looks the same: it is passed in a step of `kink_length`, of which this is not asked.
bool Continuation::leads_back(Trial& trial) {
  if (global_size(trial.y) > quick) return false;
  const double cosine = along_facet(trial.y, trial.tangent, no_force);
  if (cosine <= -surely_one) return true;  // shorter steps tell a turn on the way from a way back
  if (cosine >= surely_one && !round_facet(anchor_.y, trial.y)) return false;
  trial.sign = determinant(trial.y, weighted(weights_, trial.tangent));
  return trial.sign ? anchor_sign() * trial.sign < 0 : cosine <= -one_facet;
}

/// Turns the tangent of a trial behind a step so short that a turn is a corner, to lead on; what speaks
/// against it. Sheets that touch a facet lie so near to each other that Newton finds either, and a turn just
/// behind the anchor looks like one just ahead: of that the trail tells. Collective.
std::string Continuation::oriented(Trial& trial, double angle) {
  const bool touched = round_facet(anchor_.y, trial.y);
  if (angle < kink_angle && !touched && fits(trial.y)) return "";
  const int sign = beyond_corner(trial) && !touched ? 1 : orientation(trial.y, trial.tangent);
  if (sign < 0 && touched && (angle < kink_angle || just_touched()))
    return "the corrector lands on another branch";
  if ((sign && !touched && !straight_there(trial, sign)) || (sign > 0 && fell_back(trial)))
    return "the corrector lands on another branch";
  if (sign == 0) return angle > steps_.max_angle ? "the branch turns too sharply" : "";
  if (sign < 0) {
    check(VecScale(trial.tangent, -1));
    trial.tests = tests(trial.y, trial.tangent);
  }
  turned_ = angle > steps_.max_angle;
  return "";
}

/// Whether the tangent lies on this piece at a distance from the anchor. Collective.
bool Continuation::on_piece(std::uint64_t here, double at) {
  return piece(moved(anchor_.y, at, anchor_.tangent)) == here;
}

/// Just beyond the end of this piece along the tangent, to a share of it, where `reach` is beyond.
/// Collective.
double Continuation::piece_end(std::uint64_t here, double reach, double share) {
  for (double inside = 0; reach - inside > share * reach && reach > shortest;) {
    const double middle = (inside + reach) / 2;
    (on_piece(here, middle) ? inside : reach) = middle;
  }
  return std::max(reach, shortest);
}

/// Just beyond the end of the present piece along the tangent, if it ends within `reach`. Collective.
std::optional<double> Continuation::facet(double reach) {
  constexpr double precise = 1e-6;
  const auto here = piece(anchor_.y);
  if (on_piece(here, reach)) return {};
  return piece_end(here, reach, precise);
}

/// Whether the Jacobian changes within a thousandth of the way to where the present piece ends, if that is
/// within `reach` and not at once: where a soft contact first opens it hardly does, and no corner is to be
/// walked to. `soft` gets the place then. Of several ends one is judged; shorter steps come to the others.
/// Collective.
bool Continuation::corner_within(double reach, double& soft) {
  const auto here = piece(anchor_.y);
  if (on_piece(here, reach) || !on_piece(here, sparse * reach)) return false;
  const double end = piece_end(here, reach, about / 2);
  newton_.scale(anchor_.y);  // the attempt was measured in its own forces
  VecHandle before = problem_.equations(), behind = problem_.equations();
  problem_.product(moved(anchor_.y, (1 - about) * end, anchor_.tangent), anchor_.tangent, before);
  problem_.product(moved(anchor_.y, (1 + about) * end, anchor_.tangent), anchor_.tangent, behind);
  check(VecAXPY(behind, -1, before));
  if (!(norm(behind) < seen_jump)) return true;
  soft = end;
  return false;
}

/// Whether the anchor's tangent is one at y too: the metric does not see a corner at which only the mean
/// turns. A determinant that changes its sign all the same is a branch point. Collective.
bool Continuation::fits(Vec y) {
  VecHandle entering = problem_.equations();
  problem_.product(y, anchor_.tangent, entering);
  return dot(entering, entering) < no_force * no_force;
}

/// How far, at most `reach`, a tangent leads from y within one piece, halved so that it ends well inside.
double Continuation::within_piece(Vec y, Vec tangent, double reach) {
  const auto here = piece(y);
  if (piece(moved(y, reach, tangent)) == here) return reach;
  for (int k = 0; k < halvings; ++k, reach /= 2)
    if (piece(moved(y, reach, tangent)) == here) break;
  return reach / 2;
}

/// +1: `tangent` leads on into the piece that begins just before y, -1: back out of it; 0: it cannot be told,
/// as where pieces are shorter than `reach`.
int Continuation::into_piece(Vec y, Vec tangent, double reach) {
  const VecHandle back = copy(tangent);
  check(VecScale(back, -1));
  const double ahead = within_piece(y, tangent, reach), behind = within_piece(y, back, reach);
  if (std::max(ahead, behind) < reach || surely_in * std::min(ahead, behind) > reach) return 0;
  return ahead > behind ? 1 : -1;
}

/// The branch behind a corner that lies just before `beyond`, at most `reach` from it; `seen` where a piece
/// ends there. The tangent's extension beyond it is off the branch, but it lies on the piece behind: its
/// Jacobian gives that piece's tangent, along which Newton is closed.
std::optional<Continuation::Trial> Continuation::turn_corner(double beyond, double reach, bool seen) {
  if (seen) beyond += std::min(at_once, about * reach);
  const VecHandle there = moved(anchor_.y, beyond, anchor_.tangent);
  const auto found = tangent_at(there);
  if (!found) return {};
  Vec tangent = *found;
  const bool straight = dot(row_, tangent) > 1 - no_corner && fits(there);
  if (straight && on_piece(piece(anchor_.y), beyond)) return {};
  const double cosine = straight ? 1 : along_facet(there, tangent);
  const int told = straight ? 1 : orientation(there, tangent, cosine);
  const bool single = std::abs(cosine) >= one_facet && told * cosine > 0;
  const int placed = straight ? 1 : seen && !single ? into_piece(there, tangent, reach) : 0;
  const int sign = placed ? placed : told;
  if (sign == 0) return {};
  check(VecScale(tangent, sign));
  auto trial = along_piece(there, tangent, reach, beyond, std::cos(steps_.max_angle));
  if (trial && !placed && orientation(trial->y, trial->tangent) < 0) return {};
  if (trial && fell_back(*trial)) return {};
  return trial;
}

/// The unit tangent of the piece that y lies on, which need not be a solution, along the anchor's.
/// Collective.
std::optional<VecHandle> Continuation::tangent_at(Vec y) {
  VecHandle tangent = copy(anchor_.tangent);
  newton_.system().close(row_, 0);
  if (!newton_.tangent(y, tangent, true)) return {};
  const double size = weighted_norm(weights_, tangent);
  if (!std::isfinite(size)) return {};
  check(VecScale(tangent, 1 / size));
  return tangent;
}

/// A solution along the tangent of the piece that y lies on, which is off the branch by `aside`. Both pieces
/// are straight: neither in the metric nor in the mean, which that does not see, may it lie farther from
/// there.
std::optional<Continuation::Trial> Continuation::along_piece(Vec y, Vec tangent, double reach, double aside,
                                                             double least) {
  const double on = within_piece(y, tangent, reach);
  if (!(on > shortest)) return {};
  const VecHandle row = weighted(weights_, tangent), guess = moved(y, on, tangent);
  Trial trial = at(copy(guess));
  if (!correct(trial, row, dot(row, guess), row)) return {};
  if (!(distance(trial.y, guess) <= aside + on)) return {};
  if (!(norm(moved(trial.y, -1, guess)) <= aside * norm(anchor_.tangent) + (aside + on) * norm(tangent)))
    return {};
  if (!(dot(row, trial.tangent) >= least)) return {};
  return trial;
}

}  // namespace fretwave::solve
