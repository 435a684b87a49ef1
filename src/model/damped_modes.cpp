#include "model/damped_modes.h"

#include <slepcpep.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>

#include "error.h"
#include "fault.h"
#include "model/eigenproblem.h"
#include "model/lowest_pairs.h"
#include "model/mode_orientation.h"
#include "together.h"

namespace fretwave::model {

namespace {

using PepHandle = Handle<PEP, PEPDestroy>;

constexpr double tolerance = 1e-13;

/// The law's tangents at rest, per contact row (diagonal part).
struct RestTangent {
  std::vector<double> stiffness, damping;
};

RestTangent rest_tangent(contact::Law const& law, MPI_Comm comm) {
  const int d = law.components(), n = law.pairs();
  std::vector<double> zero(size_t(d) * n), f(size_t(d) * n);
  contact::Record record;
  RestTangent out{zero, zero};
  together(comm, "contact at rest", [&] {
    fault::point("contact at rest");
    if (law.hereditary())  // its tangents are of a period
      for (int k = 0; k < d * n; ++k) out.stiffness[k] = law.stuck_stiffness(k % d, k / d);
    else
      law.force({.samples = 1, .components = d, .pairs = n, .u = zero.data(), .v = zero.data(), .step = 1},
                f.data(), record);
  });
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

/// Motions that K leaves free, and the frequency of the first that it does not [rad/s].
struct Free {
  PetscInt motions = 0;
  double first = 0;
};

Free free_motions(Operators const& terms, double scale) {
  if (!symmetric(terms[0])) return {};
  PetscInt size;
  check(MatGetSize(terms[0], &size, nullptr));
  const Pencil pencil = {.K = terms[0],
                         .M = terms[2],
                         .size = size,
                         .constraints = 0,
                         .shift = -1e-8 * scale,
                         .rounding = rounding(terms[0], terms[2])};
  Free out;
  for (PetscInt count = 1; count <= size; count = std::max(count + 1, std::min(2 * count, size))) {
    const auto pairs = lowest_beside_zero(pencil, count);
    const auto is_free = [&](EigenPair const& pair) {
      return is_rigid(terms[0], scale, pair.value, pair.vector);
    };
    const auto first = std::find_if_not(pairs.begin(), pairs.end(), is_free);
    out.motions = PetscInt(first - pairs.begin());
    if (first != pairs.end()) out.first = std::sqrt(std::max(first->value, 0.0));
    if (first != pairs.end() || PetscInt(pairs.size()) < count) break;
  }
  if (out.motions == size) out.first = std::sqrt(scale);
  return out;
}

/// The oscillating modes next to zero of (K + s C + s^2 M) phi = 0, known to a share of `scale` [rad/s]
/// (zero: SLEPc's choice, by the norms of the matrices). Where K leaves motions free they are sought from the
/// right of zero, where the matrix is regular.
std::vector<LinearMode> oscillating(Model const& model, Operators const& terms, int count, double scale,
                                    Free const& free) {
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
  check(PEPSetDimensions(
      pep, std::min<PetscInt>(copies * (2 * count + 4) + 2 * free.motions, 2 * copies * model.dofs()),
      PETSC_DEFAULT, PETSC_DEFAULT));
  check(PEPSetTolerances(pep, tolerance, 1000));
  check(PEPSetWhichEigenpairs(pep, PEP_TARGET_MAGNITUDE));
  check(PEPSetTarget(pep, free.motions ? free.first : 0));
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
    if (free.motions && std::hypot(re, im) < 1e-5 * free.first) continue;  // a double zero, but for rounding
    LinearMode mode{im, -re, {}, {}};
    take_shape(model, terms, x, y, mode);
    if (!travelling || is_new(mode, modes)) modes.push_back(std::move(mode));
  }
  const PetscInt all = model.dofs() - free.motions / copies;
  if (reason < 0 && PetscInt(modes.size()) < std::min<PetscInt>(count, all))
    throw PetscFailure("damped linear modes: " + std::to_string(modes.size()) + " of " +
                       std::to_string(count) + " converged; raise -modes_pep_max_it or -modes_pep_ncv");
  return modes;
}

void refuse_rigid(contact::Law const& law) {
  for (int row = 0; row < law.components() * law.pairs(); ++row)
    if (std::isinf(law.stuck_stiffness(row % law.components(), row / law.components())))
      throw InputError("rigid contact holds a structure whose stiffness is not symmetric",
                       "infinite stiffness", "a finite one", "give one, or leave the contact free");
}

/// Of (K + s C + s^2 M) phi = 0, C none where it is empty.
std::vector<LinearMode> modes_of(Model const& model, int count, std::vector<PhasedMap> const& stiffness,
                                 std::vector<PhasedMap> const& damping) {
  constexpr double far = 1e3;  // contact that much above the modes spoils their digits
  const bool travelling = model.travelling();
  std::vector<MatHandle> matrices;
  for (auto const& parts : {std::cref(stiffness), std::cref(damping)})
    matrices.push_back(real_form(parts.get(), model.theta(), travelling));
  matrices.push_back(real_form(required(model, 2, "mass"), model.theta(), travelling));
  cancel(matrices[0], stiffness);
  if (!matrices[1]) {
    check(MatDuplicate(matrices[0], MAT_DO_NOT_COPY_VALUES, matrices[1].out()));
    check(MatZeroEntries(matrices[1]));
  }
  const Operators terms = operators(model.comm(), std::move(matrices));
  const double stiffest = scale_of(terms[0], terms[2], stiffness);
  const Free free = free_motions(terms, stiffest);
  auto modes = oscillating(model, terms, count, 0, free);
  const size_t last = std::min(modes.size(), size_t(count));
  double highest = 0;
  for (size_t k = 0; k < last; ++k) highest = std::max(highest, std::hypot(modes[k].omega, modes[k].beta));
  const double norms = std::sqrt(stiffest);
  for (double scale : {highest, 2 * highest, highest / 2}) {
    if (!(scale > 0) || highest > norms / far) break;
    try {
      return oscillating(model, terms, count, scale, free);
    } catch (PetscFailure const&) {
      // LAPACK may fail on the last directions of a small problem; by another scale it does not
    }
  }
  return modes;
}

}  // namespace

std::vector<LinearMode> damped_modes(Model const& model, int count) {
  auto stiffness = required(model, 0, "stiffness"), damping = terms_of(model, 1);
  for (auto const& contact : model.contacts()) {
    const RestTangent rest = rest_tangent(*contact.law, model.comm());
    const int d = contact.law->components();
    add_contact(stiffness, contact, [&](int c, int i) { return rest.stiffness[size_t(i) * d + c]; });
    add_contact(damping, contact, [&](int c, int i) { return rest.damping[size_t(i) * d + c]; });
  }
  return modes_of(model, count, stiffness, damping);
}

std::vector<LinearMode> circulatory_modes(Model const& model, int count, bool stuck,
                                          std::optional<double> near) {
  if (near)
    throw InputError("modes near a frequency of a structure whose stiffness is not symmetric", "near",
                     "the lowest modes", "leave near out");
  auto stiffness = required(model, 0, "stiffness");
  if (stuck)
    for (auto const& contact : model.contacts()) {
      together(model.comm(), "stuck contact", [&] { refuse_rigid(*contact.law); });
      add_contact(stiffness, contact, [&](int c, int i) { return contact.law->stuck_stiffness(c, i); });
    }
  return modes_of(model, count, stiffness, {});
}

}  // namespace fretwave::model
