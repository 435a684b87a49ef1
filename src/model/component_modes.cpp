#include "model/component_modes.h"

#include <slepceps.h>

#include <algorithm>
#include <cmath>

#include "error.h"
#include "model/mode_orientation.h"

namespace fretwave::model {

namespace {

using EpsHandle = Handle<EPS, EPSDestroy>;
using Modes = std::vector<ComponentMode>;

constexpr double tolerance = 1e-11;  // of the residual; frequencies are exact to its square
constexpr double null_pivot =
    1e-13;  // relative to the scaled matrix; rounding leaves 1e-15 of a rigid motion
constexpr PetscInt small = 500;

Mat factor_of(KSP ksp) {
  PC pc;
  Mat factor;
  check(KSPGetPC(ksp, &pc));
  check(PCFactorGetMatrix(pc, &factor));
  return factor;
}

void expect_factorised(KSP ksp) {
  PC pc;
  PCFailedReason reason;
  PetscInt code;
  check(KSPGetPC(ksp, &pc));
  check(PCGetFailedReason(pc, &reason));
  check(MatMumpsGetInfog(factor_of(ksp), 1, &code));
  if (reason != PC_NOERROR || code < 0)
    throw PetscFailure("the stiffness of the internal dofs could not be factorised: MUMPS INFOG(1) = " +
                       std::to_string(code));
}

/// L D L^T by MUMPS, which also counts negative and null pivots.
KspHandle factorise(Mat A) {
  KspHandle ksp;
  PC pc;
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(KSPCreate(comm, ksp.out()));
  check(KSPSetOptionsPrefix(ksp, "component_"));
  check(KSPSetOperators(ksp, A, A));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCCHOLESKY));
  check(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
  check(PCFactorSetUpMatSolverType(pc));
  const Mat factor = factor_of(ksp);
  check(MatMumpsSetIcntl(factor, 13, 1));  // no ScaLAPACK root, or its pivots are not counted
  check(MatMumpsSetIcntl(factor, 24, 1));
  check(MatMumpsSetCntl(factor, 3, null_pivot));
  check(KSPSetFromOptions(ksp));
  check(KSPSetUp(ksp));
  expect_factorised(ksp);
  return ksp;
}

void expect_held(KSP ksp) {
  PetscInt null = 0, negative = 0;
  check(MatMumpsGetInfog(factor_of(ksp), 28, &null));
  check(MatMumpsGetInfog(factor_of(ksp), 12, &negative));
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

}  // namespace

FixedInterface::FixedInterface(Mat K, Mat M, IS internal) {
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(K), &comm_));
  check(MatCreateSubMatrix(K, internal, internal, MAT_INITIAL_MATRIX, K_.out()));
  check(MatCreateSubMatrix(M, internal, internal, MAT_INITIAL_MATRIX, M_.out()));
  check(MatSetOption(K_, MAT_SYMMETRIC, PETSC_TRUE));
  check(MatSetOption(M_, MAT_SYMMETRIC, PETSC_TRUE));
  ksp_ = factorise(K_);
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

void FixedInterface::solve(Mat B, Mat X) const {
  check(KSPMatSolve(ksp_, B, X));
  expect_factorised(ksp_);
}

/// Number of modes up to omega: negative pivots of K_ii - omega^2 M_ii (Sylvester), which misses no double
/// mode.
PetscInt FixedInterface::count_below(double omega) const {
  MatHandle A;
  check(MatDuplicate(K_, MAT_COPY_VALUES, A.out()));
  check(MatAXPY(A, -omega * omega, M_, DIFFERENT_NONZERO_PATTERN));
  check(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscInt negative;
  const KspHandle ksp = factorise(A);
  check(MatMumpsGetInfog(factor_of(ksp), 12, &negative));
  return negative;
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

Modes FixedInterface::modes(ComponentModes wanted) {
  const bool by_frequency = wanted.highest_omega > 0;
  const bool dense = dofs() <= std::max(small, by_frequency ? 0 : 2 * wanted.count);
  if (by_frequency && !dense) wanted.count = count_below(wanted.highest_omega);
  if (wanted.count == 0 && !(by_frequency && dense)) return {};
  // two more, so that a double mode is not cut before it is oriented
  Modes modes = dense ? all_modes() : krylov_modes(std::min(wanted.count + 2, dofs()));
  sort_and_orient(modes, rounding(K_, M_));
  if (by_frequency && dense)
    std::erase_if(modes, [&](auto const& mode) { return mode.omega > wanted.highest_omega; });
  else if (modes.size() > size_t(wanted.count))
    modes.resize(size_t(wanted.count));
  for (auto const& mode : modes) normalise(M_, mode.shape);
  return modes;
}

}  // namespace fretwave::model
