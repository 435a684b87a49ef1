#include "model/component_modes.h"

#include <slepceps.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "error.h"
#include "model/inertia.h"
#include "model/lowest_pairs.h"
#include "model/mode_orientation.h"
#include "model/static_factor.h"

namespace fretwave::model {

namespace {

using EpsHandle = Handle<EPS, EPSDestroy>;
using Modes = std::vector<ComponentMode>;

constexpr double tolerance = 1e-11;  // of the residual; frequencies are exact to its square
constexpr PetscInt small = 500;
constexpr double family = 1e-7;  // relative distance in omega^2 below which modes are not counted apart

void expect_held(KSP ksp) {
  const PetscInt null = null_pivots(ksp), negative = negative_pivots(ksp);
  if (null > 0)
    throw InputError("the structure can still move freely when the kept dofs are held",
                     std::to_string(null) + " rigid motions or dofs without stiffness", "none",
                     "keep dofs that stop every rigid motion, and remove dofs without stiffness");
  if (negative > 0)
    throw InputError("the stiffness of the internal dofs is not positive definite",
                     std::to_string(negative) + " negative pivots", "none",
                     "check the sign and the assembly of K");
}

void normalise(Mat M, Vec shape) {
  VecHandle Mx = like(shape);
  double mass;
  check(MatMult(M, shape, Mx));
  check(VecDot(shape, Mx, &mass));
  check(VecScale(shape, 1 / std::sqrt(mass)));
}

/// omega^2 in the last gap of ascending modes, and how many lie below it; zero where all are one family.
std::pair<double, PetscInt> last_gap(Modes const& modes, double rounding) {
  const auto square = [&](size_t k) { return modes[k].omega * modes[k].omega; };
  for (size_t k = modes.size() - 1; k > 0; --k)
    if (square(k) - square(k - 1) > std::max(family * square(k), 20 * rounding))
      return {(square(k) + square(k - 1)) / 2, PetscInt(k)};
  return {0, 0};
}

}  // namespace

FixedInterface::FixedInterface(Mat K, Mat M, IS internal) {
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(K), &comm_));
  check(MatCreateSubMatrix(K, internal, internal, MAT_INITIAL_MATRIX, K_.out()));
  check(MatCreateSubMatrix(M, internal, internal, MAT_INITIAL_MATRIX, M_.out()));
  check(MatSetOption(M_, MAT_SYMMETRIC, PETSC_TRUE));
  ksp_ = symmetric_factor(K_, "component_");
  expect_held(ksp_);
}

PetscInt FixedInterface::dofs() const {
  PetscInt n;
  check(MatGetSize(K_, &n, nullptr));
  return n;
}

PetscInt FixedInterface::local_dofs() const {
  PetscInt n;
  check(MatGetLocalSize(K_, &n, nullptr));
  return n;
}

MatHandle FixedInterface::columns(PetscInt count) const { return dense_columns(K_, count); }

void FixedInterface::solve(Mat B, Mat X) const {
  check(KSPMatSolve(ksp_, B, X));
  expect_factorised(ksp_);
}

/// Shift-invert about zero with the factorisation that the constraint modes have used.
Modes FixedInterface::krylov_modes(PetscInt count) {
  EpsHandle eps;
  ST st;
  check(EPSCreate(comm_, eps.out()));
  check(EPSSetOptionsPrefix(eps, "component_"));
  check(EPSSetOperators(eps, K_, M_));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetDimensions(eps, count, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, tolerance, 1000));
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetTarget(eps, 0));
  check(EPSGetST(eps, &st));
  check(STSetType(st, STSINVERT));
  check(STSetKSP(st, ksp_));
  check(EPSSetFromOptions(eps));
  check(EPSSolve(eps));
  PetscInt converged;
  check(EPSGetConverged(eps, &converged));
  if (converged < count)
    throw PetscFailure("component modes: " + std::to_string(converged) + " of " + std::to_string(count) +
                       " converged; raise -component_eps_max_it");
  Modes modes;
  for (PetscInt k = 0; k < count; ++k) {
    double value;
    ComponentMode mode;
    check(MatCreateVecs(K_, mode.shape.out(), nullptr));
    check(EPSGetEigenpair(eps, k, &value, nullptr, mode.shape, nullptr));
    mode.omega = std::sqrt(value);
    modes.push_back(std::move(mode));
  }
  return modes;
}

/// All modes of finite frequency by LAPACK, whole on every rank: M phi = theta K phi keeps the lowest
/// frequencies (largest theta) at full relative accuracy, and M may be singular.
Modes FixedInterface::all_modes() const {
  MatHandle K, M;
  check(MatCreateRedundantMatrix(K_, comm_size(comm_), PETSC_COMM_SELF, MAT_INITIAL_MATRIX, K.out()));
  check(MatCreateRedundantMatrix(M_, comm_size(comm_), PETSC_COMM_SELF, MAT_INITIAL_MATRIX, M.out()));
  EpsHandle eps;
  check(EPSCreate(PETSC_COMM_SELF, eps.out()));
  check(EPSSetOperators(eps, M, K));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetType(eps, EPSLAPACK));
  check(EPSSetWhichEigenpairs(eps, EPS_LARGEST_REAL));
  check(EPSSolve(eps));
  PetscInt converged, first;
  check(EPSGetConverged(eps, &converged));
  check(MatGetOwnershipRange(K_, &first, nullptr));
  VecHandle whole;
  check(MatCreateVecs(K, whole.out(), nullptr));
  Modes modes;
  double largest = 0;
  for (PetscInt k = 0; k < converged; ++k) {
    double theta;
    check(EPSGetEigenpair(eps, k, &theta, nullptr, whole, nullptr));
    largest = std::max(largest, theta);
    if (theta <= 1e-14 * largest) break;  // a motion without mass
    modes.push_back({1 / std::sqrt(theta), make_vector(comm_, local_dofs())});
    ReadArray in(whole);
    WriteArray out(modes.back().shape);
    std::copy_n(in.data() + first, local_dofs(), out.data());
  }
  return modes;
}

/// Those of the Krylov space, and where inertia counts more of them, these searched for as well: whether a
/// space misses one hangs on the rounding of its factors. Ascending but for those closer than `resolution`.
Modes FixedInterface::counted_modes(PetscInt count, double resolution) {
  Modes modes = krylov_modes(count);
  const auto [lambda, below] = last_gap(modes, resolution);
  if (below == 0 || count_below(K_, M_, lambda, "component_count_") <= below) return modes;
  modes.clear();
  for (auto& pair : lowest_pairs({K_, M_, dofs(), 0, 0, resolution}, count))
    modes.push_back({std::sqrt(pair.value), std::move(pair.vector)});
  return modes;
}

Modes FixedInterface::modes(ComponentModes& wanted) {
  if (dofs() == 0) return {};
  const bool by_frequency = wanted.highest_omega > 0;
  const bool dense = dofs() <= std::max(small, by_frequency ? 0 : 2 * wanted.count);
  if (by_frequency && !dense)
    wanted.count = count_below(K_, M_, wanted.highest_omega * wanted.highest_omega, "component_");
  const auto asked = [&] { return wanted.count + ComponentModes::beyond(wanted.count); };
  // two more, so that a double mode is not cut before it is oriented
  const double resolution = rounding(K_, M_);
  Modes modes = dense ? all_modes() : counted_modes(std::min(asked() + 2, dofs()), resolution);
  sort_and_orient(modes, resolution);
  if (by_frequency && dense)
    wanted.count = std::count_if(modes.begin(), modes.end(),
                                 [&](auto const& m) { return m.omega <= wanted.highest_omega; });
  if (modes.size() > size_t(asked())) modes.resize(size_t(asked()));
  wanted.count = std::min(wanted.count, PetscInt(modes.size()));
  for (auto const& mode : modes) normalise(M_, mode.shape);
  return modes;
}

}  // namespace fretwave::model
