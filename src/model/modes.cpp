#include "model/modes.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "model/damped_modes.h"
#include "model/eigenproblem.h"
#include "model/lowest_pairs.h"
#include "model/mode_orientation.h"
#include "model/phases.h"
#include "model/stiff_contact.h"

namespace fretwave::model {

namespace {

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

/// Where modes near a frequency are looked for: not so far beyond all of them that K is lost beside its M.
double shift_near(double omega, double rounding) {
  constexpr double far = 1e6 / PETSC_MACHINE_EPSILON;  // 3e7 times the highest K_ii / M_ii
  const double square = (1 - 1e-9) * omega * omega;    // nor on a frequency given: K - shift M is regular
  return rounding > 0 ? std::min(square, far * rounding) : square;
}

/// (K + B^H kt B) phi = w^2 M phi, far stiffer contact by its forces (`StiffContact`).
std::vector<LinearMode> undamped(Model const& model, int count, bool stuck, std::optional<double> near,
                                 bool stable) {
  const bool travelling = model.travelling();
  const int copies = travelling ? 2 : 1;
  auto stiffness = required(model, 0, "stiffness");
  MatHandle M = real_form(required(model, 2, "mass"), model.theta(), travelling);
  std::optional<StiffContact> stiff;
  if (stuck) {
    stiff.emplace(model, real_form(stiffness, model.theta(), travelling));
    for (auto const& contact : model.contacts())
      add_contact(stiffness, contact, [&](int component, int pair) {
        return stiff->takes(contact, component, pair) ? 0 : contact.law->stuck_stiffness(component, pair);
      });
  }
  const bool constrained = stiff && stiff->rows() > 0;
  MatHandle K = real_form(stiffness, model.theta(), travelling);
  cancel(K, stiffness);
  VecHandle scales;
  if (constrained) {
    scales = balance(K, M);
    K = scaled(K, scales, scales), M = scaled(M, scales, scales);
    stiff->scale(scales);
  }
  const double scale = scale_of(K, M, stiffness);
  std::vector<MatHandle> pair;
  pair.push_back(constrained ? stiff->beside(K) : MatHandle::share(K));
  pair.push_back(constrained ? stiff->beside_mass(M) : MatHandle::share(M));
  const Operators AB = operators(model.comm(), std::move(pair));
  const PetscInt rows = constrained ? stiff->rows() : 0, rigid = constrained ? stiff->rigid() : 0;
  const PetscInt wanted = std::min<PetscInt>(count, model.dofs() - rigid / copies);
  if (wanted < 1)
    throw InputError("the stuck contact leaves no degree of freedom", "0", ">= 1", "use contact = \"free\"");
  const double noise = rounding(K, M);
  // a little below zero: K may be singular (rigid motions), K - shift M is not
  const Pencil pencil = {.K = AB[0],
                         .M = AB[1],
                         .size = copies * model.dofs() - rigid,
                         .constraints = rows,
                         .shift = near ? shift_near(*near, noise) : -1e-8 * scale,
                         .rounding = noise,
                         .stable = stable};
  const auto pairs =
      near ? nearest_pairs(pencil, copies * wanted) : lowest_beside_zero(pencil, copies * wanted);
  if (stable) expect_stable(pencil, pairs);
  std::vector<LinearMode> modes;
  std::vector<VecHandle> found;
  for (auto const& [value, vector] : pairs) {
    if (PetscInt(modes.size()) == wanted) break;
    VecHandle x = like(vector);
    check(VecCopy(vector, x));
    if (!orthonormalise(AB[1], found, travelling, x)) continue;
    modes.push_back({is_rigid(AB[0], scale, value, x) ? 0 : std::sqrt(value), 0, {}, {}});
    const VecHandle shape = scales ? scaled_back(x, scales, AB.offset) : VecHandle::share(x);
    take_shape(model, AB, shape, nullptr, modes.back());
    found.push_back(std::move(x));
  }
  return modes;
}

}  // namespace

std::vector<LinearMode> linear_modes(Model const& model, int count, ContactState state,
                                     std::optional<double> near, bool stable) {
  const bool stuck = state == ContactState::stuck;
  auto modes = state == ContactState::linearised ? damped_modes(model, count)
               : hermitian(required(model, 0, "stiffness"), model.theta())
                   ? undamped(model, count, stuck, near, stable)
                   : circulatory_modes(model, count, stuck, near);
  std::sort(modes.begin(), modes.end(), [](auto const& a, auto const& b) { return a.omega < b.omega; });
  if (modes.size() > size_t(count)) modes.resize(size_t(count));
  return modes;
}

}  // namespace fretwave::model
