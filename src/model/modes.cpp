#include "model/modes.h"

#include <slepceps.h>
#include <slepcpep.h>

#include <algorithm>
#include <cmath>

#include "error.h"

namespace fretwave::model {

namespace {

using EpsHandle = Handle<EPS, EPSDestroy>;
using PepHandle = Handle<PEP, PEPDestroy>;

constexpr double tolerance = 1e-13;

void use_mumps(ST st) {
  KSP ksp;
  PC pc;
  check(STSetType(st, STSINVERT));
  check(STGetKSP(st, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCLU));
  check(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
}

/// B^T D B for D diagonal by contact rows.
MatHandle congruence(Mat B, Vec diagonal) {
  MatHandle DB, product;
  check(MatDuplicate(B, MAT_COPY_VALUES, DB.out()));
  check(MatDiagonalScale(DB, diagonal, nullptr));
  check(MatTransposeMatMult(B, DB, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.out()));
  return product;
}

/// sum += B^T D B with one stiffness or damping per contact row; rows that are not finite count as zero.
template <class Entry>
void add_contact(Mat sum, Contact const& contact, Entry entry) {
  VecHandle diagonal;
  check(MatCreateVecs(contact.B, nullptr, diagonal.out()));
  {
    WriteArray d(diagonal);
    const int components = contact.law->components();
    for (int row = 0; row < components * contact.law->pairs(); ++row) {
      const double value = entry(row % components, row / components);
      d[row] = std::isfinite(value) ? value : 0;
    }
  }
  check(MatAXPY(sum, 1, congruence(contact.B, diagonal), DIFFERENT_NONZERO_PATTERN));
}

/// Rows of B on which a stuck contact allows no motion at all, one matrix for all contacts (empty handle if
/// none).
MatHandle rigid_rows(Model const& model) {
  std::vector<MatHandle> parts;
  for (auto const& contact : model.contacts()) {
    PetscInt begin;
    check(MatGetOwnershipRange(contact.B, &begin, nullptr));
    std::vector<PetscInt> rows;
    const int d = contact.law->components();
    for (int row = 0; row < d * contact.law->pairs(); ++row)
      if (std::isinf(contact.law->stuck_stiffness(row % d, row / d))) rows.push_back(begin + row);
    PetscInt all = PetscInt(rows.size());
    MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPIU_INT, MPI_SUM, model.comm());
    if (all == 0) continue;
    IsHandle rows_set, cols_set;
    check(
        ISCreateGeneral(model.comm(), PetscInt(rows.size()), rows.data(), PETSC_COPY_VALUES, rows_set.out()));
    check(ISCreateStride(model.comm(), model.local_dofs(), model.first_dof(), 1, cols_set.out()));
    parts.emplace_back();
    check(MatCreateSubMatrix(contact.B, rows_set, cols_set, MAT_INITIAL_MATRIX, parts.back().out()));
  }
  if (parts.size() <= 1) return parts.empty() ? MatHandle() : std::move(parts[0]);
  std::vector<Mat> raw(parts.begin(), parts.end());
  MatHandle nest, all;
  check(MatCreateNest(model.comm(), PetscInt(raw.size()), nullptr, 1, nullptr, raw.data(), nest.out()));
  check(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, all.out()));
  return all;
}

/// [A, G^T; G, 0], or A itself without constraints; the dofs come first on each rank.
MatHandle saddle(Mat A, Mat G, double scale) {
  if (!G) return MatHandle::share(A);
  MatHandle scaled, transposed, nest, whole;
  check(MatDuplicate(G, MAT_COPY_VALUES, scaled.out()));
  check(MatScale(scaled, scale));
  check(MatTranspose(scaled, MAT_INITIAL_MATRIX, transposed.out()));
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  PetscInt rows;
  check(MatGetLocalSize(G, &rows, nullptr));
  MatHandle zero;
  check(MatCreateAIJ(comm, rows, rows, PETSC_DETERMINE, PETSC_DETERMINE, 0, nullptr, 0, nullptr, zero.out()));
  check(MatAssemblyBegin(zero, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(zero, MAT_FINAL_ASSEMBLY));
  Mat blocks[4] = {A, transposed, scaled, zero};
  check(MatCreateNest(comm, 2, nullptr, 2, nullptr, blocks, nest.out()));
  check(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, whole.out()));
  return whole;
}

/// Matrices of an eigenproblem; a small one is held whole by each rank, which all solve the same: cheaper
/// than to share it, and the Krylov space of a tiny problem, once exhausted, would end at another step on
/// another rank.
struct Operators {
  std::vector<MatHandle> matrices;
  PetscInt offset = 0;  ///< where this rank's rows begin in its part of a vector
  Mat operator[](int k) const { return matrices[k]; }
  MPI_Comm comm() const {
    MPI_Comm comm;
    check(PetscObjectGetComm(reinterpret_cast<PetscObject>(Mat(matrices[0])), &comm));
    return comm;
  }
};

constexpr PetscInt small = 500;

Operators operators(MPI_Comm comm, std::vector<MatHandle> matrices) {
  PetscInt rows, first;
  check(MatGetSize(matrices[0], &rows, nullptr));
  check(MatGetOwnershipRange(matrices[0], &first, nullptr));
  if (comm_size(comm) == 1 || rows > small) return {std::move(matrices), 0};
  Operators out{{}, first};
  for (auto const& A : matrices) {
    out.matrices.emplace_back();
    check(MatCreateRedundantMatrix(A, comm_size(comm), PETSC_COMM_SELF, MAT_INITIAL_MATRIX,
                                   out.matrices.back().out()));
  }
  return out;
}

/// This rank's dofs of an eigenvector; those of the constraints stand behind them.
VecHandle dofs_of(Model const& model, Operators const& operators, Vec whole) {
  VecHandle part = model.displacement();
  ReadArray in(whole);
  WriteArray out(part);
  std::copy_n(in.data() + operators.offset, model.local_dofs(), out.data());
  return part;
}

double trace_ratio(Model const& model, Mat K, Mat M) {
  VecHandle d = model.displacement();
  double k, m;
  check(MatGetDiagonal(K, d));
  check(VecSum(d, &k));
  check(MatGetDiagonal(M, d));
  check(VecSum(d, &m));
  return k / m;
}

MatHandle required(Model const& model, int order, char const* name) {
  MatHandle A = model.sum(order);
  if (!A)
    throw InputError(std::string("the model has no ") + name + " term", "none", "one at least",
                     "give all of K and M");
  return A;
}

PetscInt rigid_count(Mat G) {
  PetscInt n = 0;
  if (G) check(MatGetSize(G, &n, nullptr));
  return n;
}

/// (K + B^T kt B) phi = w^2 M phi, with B phi = 0 where the stuck contact is rigid.
std::vector<LinearMode> undamped(Model const& model, int count, bool stuck) {
  MatHandle K = required(model, 0, "stiffness"), M = required(model, 2, "mass"), G;
  if (stuck) {
    for (auto const& contact : model.contacts())
      add_contact(K, contact,
                  [&](int component, int pair) { return contact.law->stuck_stiffness(component, pair); });
    G = rigid_rows(model);
  }
  const double scale = trace_ratio(model, K, M);
  std::vector<MatHandle> pair;
  pair.push_back(saddle(K, G, scale));
  pair.push_back(saddle(M, G, 0));
  const Operators AB = operators(model.comm(), std::move(pair));
  const PetscInt wanted = std::min<PetscInt>(count, model.dofs() - rigid_count(G));
  if (wanted < 1)
    throw InputError("the stuck contact leaves no degree of freedom", "0", ">= 1", "use contact = \"free\"");
  EpsHandle eps;
  check(EPSCreate(AB.comm(), eps.out()));
  check(EPSSetOptionsPrefix(eps, "modes_"));
  check(EPSSetOperators(eps, AB[0], AB[1]));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetDimensions(eps, wanted, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, tolerance, 1000));
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  // a little below zero: K may be singular (rigid motions), K - target M is not
  check(EPSSetTarget(eps, -1e-8 * scale));
  ST st;
  check(EPSGetST(eps, &st));
  use_mumps(st);
  check(EPSSetFromOptions(eps));
  check(EPSSolve(eps));
  PetscInt converged;
  check(EPSGetConverged(eps, &converged));
  std::vector<LinearMode> modes;
  VecHandle x;
  check(MatCreateVecs(AB[0], x.out(), nullptr));
  for (PetscInt k = 0; k < std::min(converged, wanted); ++k) {
    double value;
    check(EPSGetEigenpair(eps, k, &value, nullptr, x, nullptr));
    LinearMode mode{std::sqrt(std::max(value, 0.0)), 0, dofs_of(model, AB, x), model.displacement()};
    VecHandle Mx = like(mode.shape);
    double mass;
    check(MatMult(M, mode.shape, Mx));
    check(VecDot(mode.shape, Mx, &mass));
    check(VecScale(mode.shape, 1 / std::sqrt(mass)));
    check(VecSet(mode.imaginary, 0));
    modes.push_back(std::move(mode));
  }
  return modes;
}

/// The law's tangents at rest, per contact row (diagonal part).
struct RestTangent {
  std::vector<double> stiffness, damping;
};

RestTangent rest_tangent(contact::Law const& law) {
  const int d = law.components(), n = law.pairs();
  std::vector<double> zero(size_t(d) * n), f(size_t(d) * n);
  contact::Record record;
  law.force({.samples = 1, .components = d, .pairs = n, .u = zero.data(), .v = zero.data(), .step = 1},
            f.data(), record);
  RestTangent out{zero, zero};
  for (int c = 0; c < d; ++c)
    for (int i = 0; i < n; ++i) {
      const size_t k = (size_t(c) * d + c) * n + i;
      if (!record.df_du.empty()) out.stiffness[size_t(i) * d + c] = record.df_du[k];
      if (!record.df_dv.empty()) out.damping[size_t(i) * d + c] = record.df_dv[k];
    }
  return out;
}

/// (K + s C + s^2 M) phi = 0 with the contact's tangents at rest; oscillating modes only.
std::vector<LinearMode> damped(Model const& model, int count) {
  MatHandle K = required(model, 0, "stiffness"), M = required(model, 2, "mass"), C = model.sum(1);
  if (!C) {
    check(MatDuplicate(K, MAT_DO_NOT_COPY_VALUES, C.out()));
    check(MatZeroEntries(C));
  }
  for (auto const& contact : model.contacts()) {
    const RestTangent rest = rest_tangent(*contact.law);
    const int d = contact.law->components();
    add_contact(K, contact, [&](int c, int i) { return rest.stiffness[size_t(i) * d + c]; });
    add_contact(C, contact, [&](int c, int i) { return rest.damping[size_t(i) * d + c]; });
  }
  std::vector<MatHandle> matrices;
  for (auto* A : {&K, &C, &M}) matrices.push_back(std::move(*A));
  const Operators terms = operators(model.comm(), std::move(matrices));
  PepHandle pep;
  Mat raw[3] = {terms[0], terms[1], terms[2]};
  check(PEPCreate(terms.comm(), pep.out()));
  check(PEPSetOptionsPrefix(pep, "modes_"));
  check(PEPSetOperators(pep, 3, raw));
  check(PEPSetProblemType(pep, PEP_GENERAL));
  check(PEPSetType(pep, PEPTOAR));
  check(PEPSetScale(pep, PEP_SCALE_SCALAR, PETSC_DECIDE, nullptr, nullptr, PETSC_DECIDE, PETSC_DECIDE));
  check(PEPSetDimensions(pep, std::min<PetscInt>(2 * count + 4, 2 * model.dofs()), PETSC_DEFAULT,
                         PETSC_DEFAULT));
  check(PEPSetTolerances(pep, tolerance, 1000));
  check(PEPSetWhichEigenpairs(pep, PEP_TARGET_MAGNITUDE));
  check(PEPSetTarget(pep, 0));
  ST st;
  check(PEPGetST(pep, &st));
  use_mumps(st);
  check(PEPSetFromOptions(pep));
  check(PEPSolve(pep));
  PetscInt converged;
  check(PEPGetConverged(pep, &converged));
  std::vector<LinearMode> modes;
  VecHandle x, y;
  check(MatCreateVecs(terms[0], x.out(), y.out()));
  for (PetscInt k = 0; k < converged; ++k) {
    double re, im;
    check(PEPGetEigenpair(pep, k, &re, &im, x, y));
    if (!(im > 1e-9 * std::hypot(re, im))) continue;  // the conjugate, or an overdamped motion
    modes.push_back({im, -re, dofs_of(model, terms, x), dofs_of(model, terms, y)});
  }
  return modes;
}

}  // namespace

std::vector<LinearMode> linear_modes(Model const& model, int count, ContactState state) {
  auto modes = state == ContactState::linearised ? damped(model, count)
                                                 : undamped(model, count, state == ContactState::stuck);
  std::sort(modes.begin(), modes.end(), [](auto const& a, auto const& b) { return a.omega < b.omega; });
  if (modes.size() > size_t(count)) modes.resize(size_t(count));
  return modes;
}

}  // namespace fretwave::model
