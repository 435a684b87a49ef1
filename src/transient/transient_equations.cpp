/// Equations of motion as first-order ones, and their Jacobian.
#include <algorithm>
#include <cmath>

#include "transient/transient.h"

namespace fretwave::transient {

namespace {

/// Components of pairs from innermost to outermost.
void pairs_innermost(double const* rows, int d, int n, std::vector<double>& out) {
  for (int c = 0; c < d; ++c)
    for (int i = 0; i < n; ++i) out[size_t(c) * n + i] = rows[size_t(i) * d + c];
}

}  // namespace

void Transient::place(Vec state) {
  const PetscInt n = model_.local_dofs();
  ReadArray in(state);
  WriteArray x(x_), v(v_);
  std::copy_n(in.data(), n, x.data());
  std::copy_n(in.data() + n, n, v.data());
}

/// What a contact does at x_ and v_; its law's tangents are those of the last state that asked for them, or
/// none.
void Transient::meet(model::Contact const& contact, Tangents& at, bool tangents) {
  check(MatMult(contact.B, x_, at.u));
  check(MatMult(contact.B, v_, at.v));
  const int d = contact.law->components(), n = contact.law->pairs();
  pairs_innermost(ReadArray(at.u).data(), d, n, at.displacement);
  pairs_innermost(ReadArray(at.v).data(), d, n, at.velocity);
  const contact::Motion motion = {.samples = 1,
                                  .components = d,
                                  .pairs = n,
                                  .u = at.displacement.data(),
                                  .v = at.velocity.data(),
                                  .step = 0};
  if (tangents) return contact.law->force(motion, at.force.data(), at.record);
  contact.law->force_alone(motion, at.force.data(), at.record);
}

void Transient::contact_force(model::Contact const& contact, Tangents& at, Vec force, bool tangents) {
  meet(contact, at, tangents);
  const int d = contact.law->components(), n = contact.law->pairs();
  {
    WriteArray rows(at.f);
    for (int c = 0; c < d; ++c)
      for (int i = 0; i < n; ++i) rows[size_t(i) * d + c] = at.force[size_t(c) * n + i];
  }
  check(MatMultTransposeAdd(contact.B, at.f, force, force));
}

/// force_ = C v + K x + B^T f - p, with x_, v_ and, where they are asked for, the contacts' tangents at the
/// state.
void Transient::forces(double t, Vec state, bool tangents) {
  place(state);
  check(MatMult(K_, x_, force_));
  if (C_) check(MatMultAdd(C_, v_, force_, force_));
  for (size_t i = 0; i < tangents_.size(); ++i)
    contact_force(model_.contacts()[i], tangents_[i], force_, tangents);
  for (auto const& part : excitation_) {
    check(VecAXPY(force_, -std::cos(part.order * omega_ * t), part.cosine));
    check(VecAXPY(force_, -std::sin(part.order * omega_ * t), part.sine));
  }
}

/// The factors alone, unless options ask for iterations: a KSP looks through all options at every solve.
void Transient::solve_mass(Vec force, Vec acceleration) {
  PC pc;
  PetscBool direct;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(KSP(mass_)), KSPPREONLY, &direct));
  if (!direct) return check(KSPSolve(mass_, force, acceleration));
  check(KSPGetPC(mass_, &pc));
  check(PCApply(pc, force, acceleration));
}

/// (x, v)' = (v, -M^-1 force)
PetscErrorCode Transient::right_side(TS, PetscReal t, Vec state, Vec rate, void* context) {
  auto& self = *static_cast<Transient*>(context);
  return self.guard_.run([&] {
    self.forces(t, state, false);
    self.solve_mass(self.force_, self.acceleration_);
    const PetscInt n = self.model_.local_dofs();
    ReadArray v(self.v_), a(self.acceleration_);
    WriteArray out(rate);
    std::copy_n(v.data(), n, out.data());
    for (PetscInt i = 0; i < n; ++i) out[n + i] = -a[i];
  });
}

/// (x' - v, M v' + force)
PetscErrorCode Transient::residual(TS, PetscReal t, Vec state, Vec rate, Vec out, void* context) {
  auto& self = *static_cast<Transient*>(context);
  return self.guard_.run([&] {
    self.forces(t, state, false);
    const PetscInt n = self.model_.local_dofs();
    {
      ReadArray in(rate);
      WriteArray a(self.acceleration_);
      std::copy_n(in.data() + n, n, a.data());
    }
    check(MatMultAdd(self.M_, self.acceleration_, self.force_, self.force_));
    ReadArray dx(rate), v(self.v_), force(self.force_);
    WriteArray r(out);
    for (PetscInt i = 0; i < n; ++i) r[i] = dx[i] - v[i], r[n + i] = force[i];
  });
}

PetscErrorCode Transient::jacobian(TS, PetscReal t, Vec state, Vec, PetscReal shift, Mat, Mat A,
                                   void* context) {
  auto& self = *static_cast<Transient*>(context);
  return self.guard_.run([&] {
    self.forces(t, state, true);
    check(MatZeroEntries(A));
    self.assemble(shift, A);
  });
}

std::pair<PetscInt, PetscInt> Transient::places(PetscInt dof) const {
  PetscInt const* begin;
  check(MatGetOwnershipRanges(K_, &begin));
  const auto* end = std::upper_bound(begin, begin + comm_size(model_.comm()) + 1, dof);
  return {dof + end[-1], dof + *end};
}

/// [[shift, -1], [K + B^T f_u B, shift M + C + B^T f_v B]]
void Transient::assemble(double shift, Mat A) {
  const auto add = [A](PetscInt row, PetscInt column, double value) {
    check(MatSetValue(A, row, column, value, ADD_VALUES));
  };
  const PetscInt first = model_.first_dof();
  for (PetscInt dof = first; dof < first + model_.local_dofs(); ++dof) {
    const auto [x, v] = places(dof);
    add(x, x, shift), add(x, v, -1);
  }
  for_entries(K_, [&](PetscInt i, PetscInt j, double k) { add(places(i).second, places(j).first, k); });
  for_entries(M_,
              [&](PetscInt i, PetscInt j, double m) { add(places(i).second, places(j).second, shift * m); });
  if (C_)
    for_entries(C_, [&](PetscInt i, PetscInt j, double c) { add(places(i).second, places(j).second, c); });
  for (size_t i = 0; i < tangents_.size(); ++i) assemble_contact(i, A);
  check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
}

void Transient::assemble_contact(size_t number, Mat A) {
  auto const& law = *model_.contacts()[number].law;
  auto const& rows = tangents_[number].rows;
  auto const& record = tangents_[number].record;
  const int d = law.components(), n = law.pairs();
  for (int which = 0; which < 2; ++which) {
    auto const& tangent = which ? record.df_dv : record.df_du;
    for (size_t k = 0; k < tangent.size(); ++k) {
      const size_t pair = k % n, column = k / n % d, row = k / n / d;
      for (auto const& [i, left] : rows[pair * d + row])
        for (auto const& [j, right] : rows[pair * d + column]) {
          const auto [x, v] = places(j);
          check(MatSetValue(A, places(i).second, which ? v : x, left * tangent[k] * right, ADD_VALUES));
        }
    }
  }
}

/// out += B^T f_u B x. Collective: a rank without pairs has no tangents.
void Transient::add_tangent(size_t number, Vec x, Vec out) {
  auto const& contact = model_.contacts()[number];
  Tangents& at = tangents_[number];
  const int d = contact.law->components(), n = contact.law->pairs();
  check(MatMult(contact.B, x, at.u));
  {
    const ReadArray u(at.u);
    WriteArray f(at.f);
    for (PetscInt i = 0; i < PetscInt(d) * n; ++i) f[i] = 0;
    if (!at.record.df_du.empty())
      for (int row = 0; row < d; ++row)
        for (int column = 0; column < d; ++column)
          for (int pair = 0; pair < n; ++pair)
            f[pair * d + row] +=
                at.record.df_du[(size_t(row) * d + column) * n + pair] * u[pair * d + column];
  }
  check(MatMultTransposeAdd(contact.B, at.f, out, out));
}

/// B by rows, and the Jacobian with room for all its entries; the contacts' tangents say which.
void Transient::prepare_jacobian() {
  for (size_t i = 0; i < tangents_.size(); ++i) {
    auto const& contact = model_.contacts()[i];
    PetscInt begin, end;
    check(MatGetOwnershipRange(contact.B, &begin, &end));
    tangents_[i].rows.resize(size_t(end - begin));
    for_entries(contact.B, [&](PetscInt row, PetscInt column, double value) {
      tangents_[i].rows[size_t(row - begin)].emplace_back(column, value);
    });
  }
  const PetscInt n = 2 * model_.local_dofs();
  MatHandle pattern;
  for (Mat* A : {pattern.out(), jacobian_.out()}) {
    check(MatCreate(model_.comm(), A));
    check(MatSetSizes(*A, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
  }
  check(MatSetType(pattern, MATPREALLOCATOR));
  check(MatSetUp(pattern));
  assemble(1, pattern);
  check(MatSetType(jacobian_, MATAIJ));
  check(MatPreallocatorPreallocate(pattern, PETSC_TRUE, jacobian_));
}

}  // namespace fretwave::transient
