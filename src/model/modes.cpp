#include "model/modes.h"

#include <slepcpep.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>

#include "error.h"
#include "fault.h"
#include "model/lowest_pairs.h"
#include "model/mode_orientation.h"
#include "model/phases.h"
#include "together.h"

namespace fretwave::model {

namespace {

using namespace std::complex_literals;
using PepHandle = Handle<PEP, PEPDestroy>;

constexpr double tolerance = 1e-13;

/// A^T D B for D diagonal by contact rows.
MatHandle congruence(Mat A, Vec diagonal, Mat B) {
  MatHandle DB, product;
  check(MatDuplicate(B, MAT_COPY_VALUES, DB.out()));
  check(MatDiagonalScale(DB, diagonal, nullptr));
  check(MatTransposeMatMult(A, DB, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.out()));
  return product;
}

/// sum += B^H D B with one stiffness or damping per contact row; rows that are not finite count as zero.
template <class Entry>
void add_contact(std::vector<PhasedMap>& sum, Contact const& contact, Entry entry) {
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
  const auto maps = maps_of(contact);
  for (auto const& [A, behind] : maps)
    for (auto const& [B, ahead] : maps) sum.push_back({congruence(A, diagonal, B), ahead - behind});
}

/// This rank's rows of B on which a stuck contact allows no motion at all.
std::vector<PetscInt> rigid_rows(Contact const& contact) {
  PetscInt begin;
  check(MatGetOwnershipRange(contact.B, &begin, nullptr));
  std::vector<PetscInt> rows;
  const int d = contact.law->components();
  for (int row = 0; row < d * contact.law->pairs(); ++row)
    if (std::isinf(contact.law->stuck_stiffness(row % d, row / d))) rows.push_back(begin + row);
  return rows;
}

/// Those rows of B in real form.
MatHandle rigid_map(Model const& model, Contact const& contact, std::vector<PetscInt> const& rows) {
  IsHandle rows_set, cols_set;
  check(ISCreateGeneral(model.comm(), PetscInt(rows.size()), rows.data(), PETSC_COPY_VALUES, rows_set.out()));
  check(ISCreateStride(model.comm(), model.local_dofs(), model.first_dof(), 1, cols_set.out()));
  std::vector<PhasedMap> parts;
  for (auto const& [B, phase] : maps_of(contact)) {
    parts.push_back({{}, phase});
    check(MatCreateSubMatrix(B, rows_set, cols_set, MAT_INITIAL_MATRIX, parts.back().B.out()));
  }
  return real_form(parts, model.theta(), model.travelling());
}

/// One matrix of the rigid rows of all contacts (empty handle if none).
MatHandle rigid_constraints(Model const& model) {
  std::vector<MatHandle> parts;
  for (auto const& contact : model.contacts()) {
    const auto rows = rigid_rows(contact);
    PetscInt all = PetscInt(rows.size());
    MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPIU_INT, MPI_SUM, model.comm());
    if (all > 0) parts.push_back(rigid_map(model, contact, rows));
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

/// This rank's dofs of an eigenvector re + i im (im may be null), behind which the constraints stand; of a
/// travelling wave in real form (x, y) the shape x + i y.
void take_shape(Model const& model, Operators const& operators, Vec re, Vec im, LinearMode& mode) {
  mode.shape = model.displacement(), mode.imaginary = model.displacement();
  WriteArray shape(mode.shape), imaginary(mode.imaginary);
  const auto place = [&](Vec part, std::complex<double> unit) {
    ReadArray in(part);
    const int width = model.travelling() ? 2 : 1;
    for (PetscInt i = 0; i < model.local_dofs(); ++i)
      for (int k = 0; k < width; ++k) {
        const std::complex<double> value = in[operators.offset + width * i + k] * unit * (k ? 1i : 1.0 + 0i);
        shape[i] += value.real(), imaginary[i] += value.imag();
      }
  };
  place(re, 1.0);
  if (im) place(im, 1i);
}

double trace_ratio(Mat K, Mat M) {
  VecHandle d;
  double k, m;
  check(MatCreateVecs(K, d.out(), nullptr));
  check(MatGetDiagonal(K, d));
  check(VecSum(d, &k));
  check(MatGetDiagonal(M, d));
  check(VecSum(d, &m));
  return k / m;
}

std::vector<PhasedMap> required(Model const& model, int order, char const* name) {
  auto parts = terms_of(model, order);
  if (parts.empty())
    throw InputError(std::string("the model has no ") + name + " term", "none", "one at least",
                     "give all of K and M");
  return parts;
}

PetscInt rows_of(Mat G) {
  PetscInt n = 0;
  if (G) check(MatGetSize(G, &n, nullptr));
  return n;
}

/// i x in real form: (re, im) -> (-im, re).
VecHandle turned(Vec x) {
  VecHandle y = like(x);
  ReadArray in(x);
  WriteArray out(y);
  for (PetscInt i = 0; i < local_size(x); i += 2) out[i] = -in[i + 1], out[i + 1] = in[i];
  return y;
}

/// Makes x M-orthonormal, in the complex sense, to the modes found; false if it is one of them times a
/// complex number.
bool orthonormalise(Mat M, std::vector<VecHandle> const& found, bool travelling, Vec x) {
  VecHandle Mx = like(x);
  double before, share, after;
  check(MatMult(M, x, Mx));
  check(VecDot(x, Mx, &before));
  const auto remove = [&](Vec basis) {
    check(VecDot(basis, Mx, &share));
    check(VecAXPY(x, -share, basis));
  };
  for (auto const& mode : found) {
    remove(mode);
    if (travelling) remove(turned(mode));
  }
  check(MatMult(M, x, Mx));
  check(VecDot(x, Mx, &after));
  if (after < 1e-4 * before) return false;
  check(VecScale(x, 1 / std::sqrt(after)));
  return true;
}

/// The lowest pairs of a pencil, whose shift lies just below zero in the scale of the stiffest dof. Rigid
/// motions next to it make the inverse so large that its rounding spoils the shapes far above them, and of
/// motions all softer than it no more is known than a share of it: both kinds are found again from as far
/// below zero as the first of their kind, or the last, lies above.
std::vector<EigenPair> lowest_beside_zero(Pencil pencil, PetscInt count) {
  const double far = 100 * std::abs(pencil.shift);
  auto found = lowest_pairs(pencil, count);
  const auto wanted = found.begin() + std::min<std::ptrdiff_t>(count, std::ssize(found));
  const auto elastic =
      std::find_if(found.begin(), wanted, [&](auto const& pair) { return pair.value > far; });
  const PetscInt soft = PetscInt(elastic - found.begin());
  if (soft == 0) return found;
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

/// (K + B^H kt B) phi = w^2 M phi, with B phi = 0 where the stuck contact is rigid.
std::vector<LinearMode> undamped(Model const& model, int count, bool stuck, std::optional<double> near) {
  const bool travelling = model.travelling();
  const int copies = travelling ? 2 : 1;
  auto stiffness = required(model, 0, "stiffness");
  MatHandle M = real_form(required(model, 2, "mass"), model.theta(), travelling), G;
  if (stuck) {
    for (auto const& contact : model.contacts())
      add_contact(stiffness, contact,
                  [&](int component, int pair) { return contact.law->stuck_stiffness(component, pair); });
    G = rigid_constraints(model);
  }
  MatHandle K = real_form(stiffness, model.theta(), travelling);
  const double scale = trace_ratio(K, M);
  std::vector<MatHandle> pair;
  pair.push_back(saddle(K, G, scale));
  pair.push_back(saddle(M, G, 0));
  const Operators AB = operators(model.comm(), std::move(pair));
  const PetscInt wanted = std::min<PetscInt>(count, model.dofs() - rows_of(G) / copies);
  if (wanted < 1)
    throw InputError("the stuck contact leaves no degree of freedom", "0", ">= 1", "use contact = \"free\"");
  // a little below zero: K may be singular (rigid motions), K - shift M is not; nor on a frequency given
  const Pencil pencil = {.K = AB[0],
                         .M = AB[1],
                         .size = copies * model.dofs() - rows_of(G),
                         .constraints = rows_of(G),
                         .shift = near ? (1 - 1e-9) * *near * *near : -1e-8 * scale,
                         .rounding = rounding(K, M)};
  const auto pairs =
      near ? nearest_pairs(pencil, copies * wanted) : lowest_beside_zero(pencil, copies * wanted);
  std::vector<LinearMode> modes;
  std::vector<VecHandle> found;
  for (auto const& [value, vector] : pairs) {
    if (PetscInt(modes.size()) == wanted) break;
    VecHandle x = like(vector);
    check(VecCopy(vector, x));
    if (!orthonormalise(AB[1], found, travelling, x)) continue;
    const bool rigid = value < 1e-9 * scale && value < uncertainty(AB[0], x);
    modes.push_back({rigid ? 0 : std::sqrt(value), 0, {}, {}});
    take_shape(model, AB, x, nullptr, modes.back());
    found.push_back(std::move(x));
  }
  return modes;
}

/// The law's tangents at rest, per contact row (diagonal part).
struct RestTangent {
  std::vector<double> stiffness, damping;
};

RestTangent rest_tangent(contact::Law const& law, MPI_Comm comm) {
  const int d = law.components(), n = law.pairs();
  std::vector<double> zero(size_t(d) * n), f(size_t(d) * n);
  contact::Record record;
  together(comm, "contact at rest", [&] {
    fault::point("contact at rest");
    if (law.hereditary()) return;  // its tangents are of a period
    law.force({.samples = 1, .components = d, .pairs = n, .u = zero.data(), .v = zero.data(), .step = 1},
              f.data(), record);
  });
  RestTangent out{zero, zero};
  for (int c = 0; c < d; ++c)
    for (int i = 0; i < n; ++i) {
      const size_t k = (size_t(c) * d + c) * n + i;
      if (!record.df_du.empty()) out.stiffness[size_t(i) * d + c] = record.df_du[k];
      if (!record.df_dv.empty()) out.damping[size_t(i) * d + c] = record.df_dv[k];
    }
  return out;
}

/// A shape that no found mode of the same lambda has, up to a complex factor: in real form every eigenvalue
/// comes again with i times its shape, and that of the wave running the other way with no shape at all.
bool is_new(LinearMode& mode, std::vector<LinearMode> const& found) {
  const std::complex<double> lambda(-mode.beta, mode.omega);
  const auto dot = [](Vec a, Vec b) {
    double value;
    check(VecDot(a, b, &value));
    return value;
  };
  const auto square = [&](LinearMode const& m) {
    return dot(m.shape, m.shape) + dot(m.imaginary, m.imaginary);
  };
  if (square(mode) < 1e-4) return false;  // of an eigenvector of unit length
  for (auto const& other : found) {
    if (std::abs(std::complex<double>(-other.beta, other.omega) - lambda) > 1e-7 * std::abs(lambda)) continue;
    const double size = square(other);
    const double re = (dot(other.shape, mode.shape) + dot(other.imaginary, mode.imaginary)) / size,
                 im = (dot(other.shape, mode.imaginary) - dot(other.imaginary, mode.shape)) / size;
    check(VecAXPBYPCZ(mode.shape, -re, im, 1, other.shape, other.imaginary));
    check(VecAXPBYPCZ(mode.imaginary, -im, -re, 1, other.shape, other.imaginary));
  }
  return square(mode) > 1e-4;
}

/// The oscillating modes next to zero of (K + s C + s^2 M) phi = 0, known to a share of `scale` [rad/s]
/// (zero: SLEPc's choice, by the norms of the matrices).
std::vector<LinearMode> oscillating(Model const& model, Operators const& terms, int count, double scale) {
  const bool travelling = model.travelling();
  const int copies = travelling ? 2 : 1;
  PepHandle pep;
  Mat raw[3] = {terms[0], terms[1], terms[2]};
  check(PEPCreate(terms.comm(), pep.out()));
  check(PEPSetOptionsPrefix(pep, "modes_"));
  check(PEPSetOperators(pep, 3, raw));
  check(PEPSetProblemType(pep, PEP_GENERAL));
  check(PEPSetType(pep, PEPTOAR));
  check(PEPSetScale(pep, PEP_SCALE_SCALAR, scale > 0 ? scale : PETSC_DECIDE, nullptr, nullptr, PETSC_DECIDE,
                    PETSC_DECIDE));
  check(PEPSetDimensions(pep, copies * std::min<PetscInt>(2 * count + 4, 2 * model.dofs()), PETSC_DEFAULT,
                         PETSC_DEFAULT));
  check(PEPSetTolerances(pep, tolerance, 1000));
  check(PEPSetWhichEigenpairs(pep, PEP_TARGET_MAGNITUDE));
  check(PEPSetTarget(pep, 0));
  ST st;
  check(PEPGetST(pep, &st));
  shift_invert(st);
  check(PEPSetFromOptions(pep));
  check(PEPSolve(pep));
  PetscInt converged;
  PEPConvergedReason reason;
  check(PEPGetConverged(pep, &converged));
  check(PEPGetConvergedReason(pep, &reason));
  std::vector<LinearMode> modes;
  VecHandle x, y;
  check(MatCreateVecs(terms[0], x.out(), y.out()));
  for (PetscInt k = 0; k < converged; ++k) {
    double re, im;
    check(PEPGetEigenpair(pep, k, &re, &im, x, y));
    if (!(im > 1e-9 * std::hypot(re, im))) continue;  // the conjugate, or an overdamped motion
    LinearMode mode{im, -re, {}, {}};
    take_shape(model, terms, x, y, mode);
    if (!travelling || is_new(mode, modes)) modes.push_back(std::move(mode));
  }
  if (reason < 0 && PetscInt(modes.size()) < std::min<PetscInt>(count, model.dofs()))
    throw PetscFailure("damped linear modes: " + std::to_string(modes.size()) + " of " +
                       std::to_string(count) + " converged; raise -modes_pep_max_it or -modes_pep_ncv");
  return modes;
}

/// (K + s C + s^2 M) phi = 0 with the contact's tangents at rest; oscillating modes only.
std::vector<LinearMode> damped(Model const& model, int count) {
  constexpr double far = 1e3;  // contact that much above the modes spoils their digits
  const bool travelling = model.travelling();
  auto stiffness = required(model, 0, "stiffness"), damping = terms_of(model, 1);
  for (auto const& contact : model.contacts()) {
    const RestTangent rest = rest_tangent(*contact.law, model.comm());
    const int d = contact.law->components();
    add_contact(stiffness, contact, [&](int c, int i) { return rest.stiffness[size_t(i) * d + c]; });
    add_contact(damping, contact, [&](int c, int i) { return rest.damping[size_t(i) * d + c]; });
  }
  std::vector<MatHandle> matrices;
  for (auto const& parts : {std::cref(stiffness), std::cref(damping)})
    matrices.push_back(real_form(parts.get(), model.theta(), travelling));
  matrices.push_back(real_form(required(model, 2, "mass"), model.theta(), travelling));
  if (!matrices[1]) {
    check(MatDuplicate(matrices[0], MAT_DO_NOT_COPY_VALUES, matrices[1].out()));
    check(MatZeroEntries(matrices[1]));
  }
  const Operators terms = operators(model.comm(), std::move(matrices));
  auto modes = oscillating(model, terms, count, 0);
  const size_t last = std::min(modes.size(), size_t(count));
  double highest = 0;
  for (size_t k = 0; k < last; ++k) highest = std::max(highest, std::hypot(modes[k].omega, modes[k].beta));
  const double norms = std::sqrt(trace_ratio(terms[0], terms[2]));
  for (double scale : {highest, 2 * highest, highest / 2}) {
    if (!(scale > 0) || highest > norms / far) break;
    try {
      return oscillating(model, terms, count, scale);
    } catch (PetscFailure const&) {
      // LAPACK may fail on the last directions of a small problem; by another scale it does not
    }
  }
  return modes;
}

}  // namespace

std::vector<LinearMode> linear_modes(Model const& model, int count, ContactState state,
                                     std::optional<double> near) {
  auto modes = state == ContactState::linearised ? damped(model, count)
                                                 : undamped(model, count, state == ContactState::stuck, near);
  std::sort(modes.begin(), modes.end(), [](auto const& a, auto const& b) { return a.omega < b.omega; });
  if (modes.size() > size_t(count)) modes.resize(size_t(count));
  return modes;
}

}  // namespace fretwave::model
