#include "model/modes.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "model/damped_modes.h"
#include "model/eigenproblem.h"
#include "model/lowest_pairs.h"
#include "model/mode_orientation.h"
#include "model/phases.h"

namespace fretwave::model {

namespace {

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
  VecHandle scales;
  if (G) {
    scales = balance(K, M);
    K = scaled(K, scales, scales), M = scaled(M, scales, scales), G = scaled(G, nullptr, scales);
  }
  const double scale = trace_ratio(K, M);
  std::vector<MatHandle> pair;
  pair.push_back(saddle(K, G, 1));
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
    const VecHandle shape = scales ? scaled_back(x, scales, AB.offset) : VecHandle::share(x);
    take_shape(model, AB, shape, nullptr, modes.back());
    found.push_back(std::move(x));
  }
  return modes;
}

}  // namespace

std::vector<LinearMode> linear_modes(Model const& model, int count, ContactState state,
                                     std::optional<double> near) {
  auto modes = state == ContactState::linearised ? damped_modes(model, count)
                                                 : undamped(model, count, state == ContactState::stuck, near);
  std::sort(modes.begin(), modes.end(), [](auto const& a, auto const& b) { return a.omega < b.omega; });
  if (modes.size() > size_t(count)) modes.resize(size_t(count));
  return modes;
}

}  // namespace fretwave::model
