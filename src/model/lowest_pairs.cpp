#include "model/lowest_pairs.h"

#include <slepceps.h>

#include <algorithm>
#include <cmath>

#include "error.h"
#include "model/inertia.h"
#include "model/mode_orientation.h"
#include "text.h"

namespace fretwave::model {

namespace {

using EpsHandle = Handle<EPS, EPSDestroy>;
using Pairs = std::vector<EigenPair>;

constexpr double tolerance = 1e-13;
constexpr double resolution = 1e-9;  // relative distance below which eigenvalues count as one
constexpr PetscInt beyond = 2;       // more than wanted, to find a gap behind them
constexpr int searches = 5;
constexpr double widest = 1e6;  // highest eigenvalue over the lowest's distance from a shift that serves both

MPI_Comm comm_of(Mat A) {
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  return comm;
}

/// For the pivots that an indefinite matrix delays.
void make_room(ST st) {
  KSP ksp;
  PC pc;
  Mat factor;
  check(STGetOperator(st, nullptr));  // hands the operator to the KSP
  check(STGetKSP(st, &ksp));
  check(KSPGetPC(ksp, &pc));
  check(PCFactorSetUpMatSolverType(pc));
  check(PCFactorGetMatrix(pc, &factor));
  check(MatMumpsSetIcntl(factor, 14, delayed_pivots));
}

struct Search {
  bool more, diverged;
};

/// Up to `count` eigenpairs orthogonal to those found, which they join.
Search search(Pencil const& pencil, PetscInt count, Pairs& found) {
  EpsHandle eps;
  ST st;
  check(EPSCreate(comm_of(pencil.K), eps.out()));
  check(EPSSetOptionsPrefix(eps, "modes_"));
  check(EPSSetOperators(eps, pencil.K, pencil.M));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetDimensions(eps, count, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, tolerance, 1000));
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetTarget(eps, pencil.shift));
  check(EPSGetST(eps, &st));
  shift_invert(st);
  make_room(st);
  std::vector<Vec> known;
  for (auto const& pair : found) known.push_back(pair.vector);
  if (!known.empty()) check(EPSSetDeflationSpace(eps, PetscInt(known.size()), known.data()));
  check(EPSSetFromOptions(eps));
  check(EPSSolve(eps));
  PetscInt converged;
  EPSConvergedReason reason;
  check(EPSGetConverged(eps, &converged));
  check(EPSGetConvergedReason(eps, &reason));
  const size_t before = found.size();
  for (PetscInt k = 0; k < converged && PetscInt(found.size()) < pencil.size; ++k) {
    EigenPair pair;
    check(MatCreateVecs(pencil.K, pair.vector.out(), nullptr));
    check(EPSGetEigenpair(eps, k, &pair.value, nullptr, pair.vector, nullptr));
    if (std::isfinite(pair.value)) found.push_back(std::move(pair));  // else: a motion without mass
  }
  std::sort(found.begin(), found.end(), [](auto const& a, auto const& b) { return a.value < b.value; });
  return {found.size() > before, reason < 0};
}

double width(Pencil const& pencil, double value) {
  return std::max(resolution * std::abs(value), pencil.rounding);
}

/// Behind the wanted ones in the first gap, or behind the last.
double bound(Pencil const& pencil, PetscInt count, Pairs const& found) {
  for (size_t k = size_t(count); k < found.size(); ++k) {
    const double below = found[k - 1].value, above = found[k].value;
    if (above - below > 20 * width(pencil, above)) return (below + above) / 2;
  }
  return found.back().value + 10 * width(pencil, found.back().value);
}

PetscInt found_below(double lambda, Pairs const& found) {
  return PetscInt(std::count_if(found.begin(), found.end(), [&](auto const& p) { return p.value < lambda; }));
}

[[noreturn]] void name_unstable(std::string const& measured) {
  throw InputError("the structure is statically unstable: its stiffness is negative for some motion",
                   measured, "all eigenvalues of K with stuck contact > 0",
                   "check the signs of K, or give it with more digits");
}

/// What may be below zero of a motion that is rigid, of a matrix printed with eight digits: measured, up to
/// 1.4e-9 of |x|^T |K| |x|. Collective.
double blur(Pencil const& pencil, EigenPair const& pair) {
  return 2e4 * uncertainty(pencil.K, pair.vector);  // 1e-8 of that
}

/// Whether K does no work on a motion but for rounding. Collective.
bool loose(Mat K, Vec x) {
  double work;
  VecHandle f = like(x);
  check(MatMult(K, x, f));
  check(VecDot(x, f, &work));
  return std::abs(work) <= uncertainty(K, x);
}

/// Eigenvalues between the lowest found, or the shift, and a bound. Only those of a structure that is
/// unstable lie below.
PetscInt counted_below(Pencil const& pencil, double lambda, Pairs const& found) {
  const PetscInt all = count_below(pencil.K, pencil.M, lambda, "modes_count_") - pencil.constraints;
  if (all <= found_below(lambda, found)) return all;
  const double lowest = std::min(pencil.shift, found.front().value);
  const double floor = lowest - 10 * width(pencil, lowest) - std::abs(pencil.shift);
  const auto under = [&](double value) {
    return count_below(pencil.K, pencil.M, value, "modes_count_") - pencil.constraints;
  };
  const PetscInt unstable = under(floor);
  if (pencil.stable && unstable > 0) {
    const double far = floor - 10 * blur(pencil, found.front());
    if (const PetscInt surely = under(far); surely > 0)
      name_unstable(std::to_string(surely) + " negative pivots of K - (" + short_text(far) + " 1/s^2) M");
  }
  return all - unstable;
}

/// How far from the shift the `count` nearest ones reach, and what cannot be told from the last of them.
double reach(Pencil const& pencil, PetscInt count, Pairs const& found) {
  std::vector<double> distance;
  for (auto const& pair : found) distance.push_back(std::abs(pair.value - pencil.shift));
  std::sort(distance.begin(), distance.end());
  return distance[size_t(count) - 1] +
         10 * width(pencil, std::abs(pencil.shift) + distance[size_t(count) - 1]);
}

PetscInt counted_between(Pencil const& pencil, double low, double high) {
  const auto below = [&](double lambda) { return count_below(pencil.K, pencil.M, lambda, "modes_count_"); };
  return below(high) - below(low);
}

/// The `count` nearest to the shift, ascending.
Pairs nearest(Pencil const& pencil, PetscInt count, Pairs found) {
  const auto off = [&](EigenPair const& pair) { return std::abs(pair.value - pencil.shift); };
  std::sort(found.begin(), found.end(), [&](auto const& a, auto const& b) { return off(a) < off(b); });
  if (PetscInt(found.size()) > count) found.erase(found.begin() + count, found.end());
  std::sort(found.begin(), found.end(), [](auto const& a, auto const& b) { return a.value < b.value; });
  return found;
}

[[noreturn]] void name_short(PetscInt found, PetscInt count) {
  throw PetscFailure("linear modes: " + std::to_string(found) + " of " + std::to_string(count) +
                     " converged; raise -modes_eps_max_it or -modes_eps_ncv");
}

[[noreturn]] void name_missing(PetscInt missing, double lambda) {
  throw PetscFailure("linear modes: " + std::to_string(missing) + " of those below " +
                     short_text(std::sqrt(std::max(lambda, 0.0))) +
                     " rad/s do not converge, by the number of negative pivots; raise -modes_eps_max_it or "
                     "-modes_eps_ncv");
}

}  // namespace

void shift_invert(ST st) {
  KSP ksp;
  PC pc;
  check(STSetType(st, STSINVERT));
  check(STGetKSP(st, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCLU));
  check(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
}

std::vector<EigenPair> nearest_pairs(Pencil const& pencil, PetscInt count) {
  Pairs found;
  PetscInt wanted = std::min(count + beyond, pencil.size), missing = 0;
  double radius = 0;
  for (int k = 0; k < searches; ++k) {
    const auto [more, diverged] = search(pencil, wanted, found);
    const PetscInt have = PetscInt(found.size());
    if (have >= pencil.size || (have < count && !more && !diverged))
      return nearest(pencil, count, std::move(found));
    if (have < count) {
      if (!more) name_short(have, count);
      wanted = std::min(count + beyond, pencil.size) - have;
      continue;
    }
    radius = reach(pencil, count, found);
    const double low = pencil.shift - radius, high = pencil.shift + radius;
    missing = counted_between(pencil, low, high) - (found_below(high, found) - found_below(low, found));
    if (missing <= 0) return nearest(pencil, count, std::move(found));
    wanted = std::min(missing + beyond, pencil.size - have);
  }
  name_missing(missing, pencil.shift + radius);
}

std::vector<EigenPair> lowest_pairs(Pencil const& pencil, PetscInt count) {
  Pairs found;
  PetscInt wanted = std::min(count + beyond, pencil.size), missing = 0;
  double lambda = 0;
  for (int k = 0; k < searches; ++k) {
    const auto [more, diverged] = search(pencil, wanted, found);
    if (PetscInt(found.size()) >= pencil.size) return found;
    if (PetscInt(found.size()) < count) {
      if (!more && diverged) name_short(PetscInt(found.size()), count);
      if (!more) return found;  // the others have no mass
      wanted = std::min(count + beyond, pencil.size) - PetscInt(found.size());
      continue;
    }
    lambda = bound(pencil, count, found);
    missing = counted_below(pencil, lambda, found) - found_below(lambda, found);
    if (missing <= 0) return found;
    wanted = std::min(missing + beyond, pencil.size - PetscInt(found.size()));
  }
  if (missing > 0) name_missing(missing, lambda);
  return found;
}

void expect_stable(Pencil const& pencil, std::vector<EigenPair> const& pairs) {
  if (pairs.empty() || pairs.front().value >= -blur(pencil, pairs.front())) return;
  name_unstable("omega^2 = " + short_text(pairs.front().value) + " 1/s^2 of a linear mode");
}

bool is_rigid(Mat K, double scale, double value, Vec vector) {
  return value < 1e-9 * scale && value <= uncertainty(K, vector);
}

std::vector<EigenPair> lowest_beside_zero(Pencil pencil, PetscInt count) {
  const double far = 100 * std::abs(pencil.shift);
  auto found = lowest_pairs(pencil, count);
  for (auto& pair : found)  // a loose part without a spring of its own has no rounding to tell it by
    if (std::abs(pair.value) < 10 * tolerance * std::abs(pencil.shift) && loose(pencil.K, pair.vector))
      pair.value = 0;
  const auto wanted = found.begin() + std::min<std::ptrdiff_t>(count, std::ssize(found));
  const auto elastic =
      std::find_if(found.begin(), wanted, [&](auto const& pair) { return pair.value > far; });
  const PetscInt soft = PetscInt(elastic - found.begin());
  if (soft == 0) return found;
  // a shift below all of them costs no digits that their own spread does not
  const bool spread = (wanted - 1)->value > widest * (found.front().value - pencil.shift);
  if (found.front().value > std::abs(pencil.shift) && !spread) return found;
  EigenPair const& last = *(elastic - 1);
  const double stiffest = last.value < uncertainty(pencil.K, last.vector) ? 0 : last.value;
  if (elastic != wanted) {
    pencil.shift = -elastic->value;
    found = lowest_pairs(pencil, count);
  }
  if (stiffest > 0) {
    pencil.shift = -stiffest;
    auto again = lowest_pairs(pencil, soft);
    std::move(again.begin(), again.begin() + soft, found.begin());
  }
  return found;
}

}  // namespace fretwave::model
