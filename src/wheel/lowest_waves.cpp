#include "wheel/lowest_waves.h"

#include <slepceps.h>

#include "lapack.h"
#include "scramble.h"

namespace fretwave::wheel {

namespace {

using EpsHandle = Handle<EPS, EPSDestroy>;

constexpr double tolerance = 1e-5;  // of the modes, which precondition

/// Matrices of a wave on (re, im) of a sector's dofs side by side.
struct WavePencil {
  SectorFactor const& factor;
  Circulant<SparseBlock> const *K, *M;
  int diameter;
};

complex const* parts(ReadArray const& x) { return reinterpret_cast<complex const*>(x.data()); }

template <auto Term>
PetscErrorCode apply_term(Mat A, Vec x, Vec y) {
  WavePencil const* of;
  PetscCall(MatShellGetContext(A, &of));
  const ReadArray in(x);
  const WriteArray out(y);
  const auto product = multiply(*(of->*Term), of->diameter, of->factor.sectors(), parts(in));
  std::ranges::copy(product, reinterpret_cast<complex*>(out.data()));
  return PetscErrorCode(0);
}

PetscErrorCode apply_inverse(PC pc, Vec x, Vec y) {
  WavePencil const* of;
  PetscCall(PCShellGetContext(pc, &of));
  PetscCall(VecCopy(x, y));
  const WriteArray out(y);
  of->factor.solve({of->diameter}, reinterpret_cast<complex*>(out.data()));
  return PetscErrorCode(0);
}

template <auto Apply>
MatHandle shell(WavePencil& of) {
  MatHandle out;
  const PetscInt n = 2 * of.factor.dofs();
  check(MatCreateShell(PETSC_COMM_SELF, n, n, n, n, &of, out.out()));
  check(MatShellSetOperation(out, MATOP_MULT, reinterpret_cast<void (*)()>(Apply)));
  check(MatSetOption(out, MAT_SYMMETRIC, PETSC_TRUE));
  return out;
}

void invert_by_factor(ST st, WavePencil& of) {
  KSP ksp;
  PC pc;
  check(STGetKSP(st, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCSHELL));
  check(PCShellSetContext(pc, &of));
  check(PCShellSetApply(pc, apply_inverse));
}

/// Joins those found, unless it lies among them: each wave is its own multiple by i too.
void take(LowestWaves& found, WavePencil const& of, double theta, std::vector<complex> u) {
  const int n = of.factor.dofs(), have = int(found.theta.size()), one = 1;
  std::vector<complex> along(have);
  const auto against = [&](std::vector<complex> const& v) {
    const auto Kv = multiply(*of.K, of.diameter, of.factor.sectors(), v.data());
    lapack::multiply("CN", {have, one, n}, 1.0, {found.U.data(), n}, {Kv.data(), n}, 0.0, along.data(), have);
    double square = 0;
    for (int i = 0; i < n; ++i) square += (std::conj(v[i]) * Kv[i]).real();
    return std::sqrt(square);
  };
  double size = against(u);
  for (complex& a : u) a /= size;
  for (complex& a : along) a /= size;
  lapack::multiply("NN", {n, one, have}, -1.0, {found.U.data(), n}, {along.data(), have}, 1.0, u.data(), n);
  size = against(u);
  if (size < 0.5) return;
  for (complex& a : u) a /= size;
  found.theta.push_back(theta);
  found.U.insert(found.U.end(), u.begin(), u.end());
}

}  // namespace

LowestWaves lowest_waves(SectorFactor const& factor, Circulant<SparseBlock> const& K,
                         Circulant<SparseBlock> const& M, int diameter, int count) {
  WavePencil of{factor, &K, &M, diameter};
  const MatHandle stiffness = shell<apply_term<&WavePencil::K>>(of),
                  mass = shell<apply_term<&WavePencil::M>>(of);
  EpsHandle eps;
  ST st;
  check(EPSCreate(PETSC_COMM_SELF, eps.out()));
  check(EPSSetOptionsPrefix(eps, "static_"));
  check(EPSSetOperators(eps, mass, stiffness));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetDimensions(eps, count, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, tolerance, 1000));
  check(EPSSetWhichEigenpairs(eps, EPS_LARGEST_REAL));
  check(EPSSetPurify(eps, PETSC_FALSE));  // K has no null space
  check(EPSGetST(eps, &st));
  invert_by_factor(st, of);
  VecHandle phi = scrambled_vector(2 * factor.dofs());
  Vec first = phi;
  check(EPSSetInitialSpace(eps, 1, &first));
  check(EPSSetFromOptions(eps));
  check(EPSSolve(eps));
  PetscInt converged;
  check(EPSGetConverged(eps, &converged));
  LowestWaves found;
  for (PetscInt k = 0; k < converged && int(found.theta.size()) < count; ++k) {
    double value;
    check(EPSGetEigenpair(eps, k, &value, nullptr, phi, nullptr));
    if (!(value > 1e-14 * (found.theta.empty() ? 0 : found.theta[0]))) break;  // a motion without mass
    const ReadArray in(phi);
    take(found, of, value, {parts(in), parts(in) + factor.dofs()});
  }
  return found;
}

}  // namespace fretwave::wheel
