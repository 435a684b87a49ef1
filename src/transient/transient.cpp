#include "transient/transient.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "text.h"

namespace fretwave::transient {

using TsHandle = Handle<TS, TSDestroy>;

constexpr int look = 5000;               // steps between two looks at how many there will be
constexpr double explicit_share = 0.25;  // of all steps allowed: an implicit one costs several explicit ones
constexpr int most_rejections = 100;  // of one step: at the onset of sticking it falls by many orders at once

namespace {

/// Runs a callback's body; PETSc must not see a C++ exception.
template <class Body>
PetscErrorCode guarded(std::exception_ptr& exception, Body body) {
  try {
    body();
  } catch (...) {
    exception = std::current_exception();
    return PETSC_ERR_USER;
  }
  return PetscErrorCode(0);
}

/// M is positive definite: no pivots needed, and none is zero, however small masses are in the units of the
/// model. PETSc's own LU takes 2.2e-14 for zero unless told.
void use_lu_without_pivots(KSP ksp, bool redundant) {
  PC pc;
  check(KSPGetPC(ksp, &pc));
  if (redundant) {
    check(PCSetType(pc, PCREDUNDANT));
    check(PCRedundantGetKSP(pc, &ksp));
    check(KSPGetPC(ksp, &pc));
  }
  check(PCSetType(pc, PCLU));
  check(PCFactorSetZeroPivot(pc, 0));
}

}  // namespace

Transient::Transient(model::Model const& model, std::vector<Excitation> excitation, double omega,
                     std::string const& prefix)
    : model_(model),
      excitation_(std::move(excitation)),
      omega_(omega),
      prefix_(prefix),
      M_(model.sum(2)),
      K_(model.sum(0)),
      C_(model.sum(1)),
      tangents_(model.contacts().size()) {
  for (auto const& contact : model.contacts())
    if (contact.law->hereditary())
      throw InputError("time integration knows no contact law with a memory",
                       contact.name.empty() ? "" : "contact '" + contact.name + "'",
                       "a law of the present motion, such as regularised_coulomb",
                       "leave the time integration out, or take such a law");
  for (auto* v : {&x_, &v_, &force_, &acceleration_}) *v = model.displacement();
  for (size_t i = 0; i < tangents_.size(); ++i) {
    Tangents& at = tangents_[i];
    check(MatCreateVecs(model.contacts()[i].B, nullptr, at.u.out()));
    at.v = like(at.u), at.f = like(at.u);
    for (auto* samples : {&at.displacement, &at.velocity, &at.force})
      samples->resize(size_t(local_size(at.u)));
  }
  check(KSPCreate(model.comm(), mass_.out()));
  check(KSPSetOptionsPrefix(mass_, (prefix + "mass_").c_str()));
  check(KSPSetOperators(mass_, M_, M_));
  check(KSPSetType(mass_, KSPPREONLY));
  use_lu_without_pivots(mass_, comm_size(model.comm()) > 1);
  check(KSPSetFromOptions(mass_));
  check(KSPSetUp(mass_));
}

namespace {

/// Components of pairs from innermost to outermost.
void pairs_innermost(double const* rows, int d, int n, std::vector<double>& out) {
  for (int c = 0; c < d; ++c)
    for (int i = 0; i < n; ++i) out[size_t(c) * n + i] = rows[size_t(i) * d + c];
}

}  // namespace

void Transient::contact_force(model::Contact const& contact, Tangents& at, Vec force) {
  check(MatMult(contact.B, x_, at.u));
  check(MatMult(contact.B, v_, at.v));
  const int d = contact.law->components(), n = contact.law->pairs();
  pairs_innermost(ReadArray(at.u).data(), d, n, at.displacement);
  pairs_innermost(ReadArray(at.v).data(), d, n, at.velocity);
  contact.law->force({.samples = 1,
                      .components = d,
                      .pairs = n,
                      .u = at.displacement.data(),
                      .v = at.velocity.data(),
                      .step = 0},
                     at.force.data(), at.record);
  {
    WriteArray rows(at.f);
    for (int c = 0; c < d; ++c)
      for (int i = 0; i < n; ++i) rows[size_t(i) * d + c] = at.force[size_t(c) * n + i];
  }
  check(MatMultTransposeAdd(contact.B, at.f, force, force));
}

/// force_ = C v + K x + B^T f - p, with x_, v_ and the contacts' tangents at the state.
void Transient::forces(double t, Vec state) {
  const PetscInt n = model_.local_dofs();
  {
    ReadArray in(state);
    WriteArray x(x_), v(v_);
    std::copy_n(in.data(), n, x.data());
    std::copy_n(in.data() + n, n, v.data());
  }
  check(MatMult(K_, x_, force_));
  if (C_) check(MatMultAdd(C_, v_, force_, force_));
  for (size_t i = 0; i < tangents_.size(); ++i) contact_force(model_.contacts()[i], tangents_[i], force_);
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
  return guarded(self.exception_, [&] {
    self.forces(t, state);
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
  return guarded(self.exception_, [&] {
    self.forces(t, state);
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
  return guarded(self.exception_, [&] {
    self.forces(t, state);
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

PetscErrorCode Transient::after_step(TS ts) {
  Transient* self;
  PetscErrorCode code = TSGetApplicationContext(ts, &self);
  if (code) return code;
  return guarded(self->exception_, [&] {
    self->record(ts);
    self->watch(ts);
  });
}

/// Ends a run that would take too many steps, as soon as that can be told.
void Transient::watch(TS ts) {
  double t;
  PetscInt steps;
  check(TSGetTime(ts, &t));
  check(TSGetStepNumber(ts, &steps));
  const bool told = steps % look == 0 && double(steps) * end_ > most_steps_ * t;
  exhausted_ = t < end_ && (told || double(steps) >= most_steps_);
  if (exhausted_) check(TSSetConvergedReason(ts, TS_CONVERGED_USER));
}

void Transient::sample(double t, Vec state) {
  const PetscInt n = model_.local_dofs();
  ReadArray in(state);
  history_.t.push_back(t);
  history_.x.emplace_back(in.data(), in.data() + n);
  history_.v.emplace_back(in.data() + n, in.data() + 2 * n);
}

/// Samples up to the step's end, by the method's own interpolation; ends the run where the motion exceeds the
/// limit.
void Transient::record(TS ts) {
  double t;
  check(TSGetTime(ts, &t));
  for (double next = interval_ * double(history_.t.size()); next <= std::min(t, end_) * (1 + 1e-14);
       next = interval_ * double(history_.t.size())) {
    check(TSInterpolate(ts, std::min(next, t), interpolated_));
    sample(next, interpolated_);
  }
  double largest = 0;
  for (double x : history_.x.back()) largest = std::max(largest, std::abs(x));
  MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, model_.comm());
  if (largest > limit_) check(TSSetConvergedReason(ts, TS_CONVERGED_USER));
}

void Transient::use_explicit(TS ts) {
  check(TSSetType(ts, TSRK));
  check(TSRKSetType(ts, TSRK5DP));
  check(TSSetRHSFunction(ts, nullptr, right_side, this));
}

void Transient::use_implicit(TS ts) {
  if (!jacobian_) {
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
  SNES snes;
  KSP ksp;
  PC pc;
  check(TSSetType(ts, TSROSW));
  check(TSSetIFunction(ts, nullptr, residual, this));
  check(TSSetIJacobian(ts, jacobian_, jacobian_, jacobian, this));
  check(TSGetSNES(ts, &snes));
  check(SNESGetKSP(snes, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCLU));
  check(PCFactorSetMatSolverType(pc, comm_size(model_.comm()) > 1 ? MATSOLVERMUMPS : MATSOLVERKLU));
}

History Transient::run(Vec x0, Vec v0, double t_end, double dt_out, double tolerance, double limit,
                       double most_steps) {
  if (!(dt_out > 0) || !(t_end > 0))
    throw InputError("time integration needs a positive duration and sampling interval",
                     short_text(t_end) + ", " + short_text(dt_out), "> 0", "give t_end and dt_out above 0");
  interval_ = dt_out, end_ = t_end, limit_ = limit, most_steps_ = explicit_share * most_steps;
  if (!stiff_) {
    History history = integrate(x0, v0, tolerance, false);
    stiff_ = exhausted_;
    if (!stiff_) return history;
  }
  most_steps_ = most_steps;
  return integrate(x0, v0, tolerance, true);
}

/// Absolute errors of the velocities below the band in which friction changes its sign: a step that may miss
/// the band would jump over it for ever, to and fro, where the true motion sticks in it. The band is that of
/// a law that saturates: its force at the largest velocity over its tangent at rest.
void Transient::resolve_sticking(double tolerance, double size, Vec allowed) {
  double band = size;
  for (auto const& contact : model_.contacts()) {
    const int d = contact.law->components(), n = contact.law->pairs();
    const size_t count = size_t(d) * n;
    const std::vector<double> rest(count, 0.0), fast(count, size);
    std::vector<double> f(count);
    contact::Record record;
    const auto evaluate = [&](std::vector<double> const& v) {
      contact.law->force(
          {.samples = 1, .components = d, .pairs = n, .u = rest.data(), .v = v.data(), .step = 0}, f.data(),
          record);
    };
    evaluate(rest);
    const std::vector<double> tangent = record.df_dv;
    evaluate(fast);
    if (tangent.empty()) continue;
    for (int c = 0; c < d; ++c)
      for (int i = 0; i < n; ++i) {
        const double slope = tangent[size_t(c * d + c) * n + i], force = std::abs(f[size_t(c) * n + i]);
        if (slope > 0 && force > 0) band = std::min(band, force / slope);
      }
  }
  MPI_Allreduce(MPI_IN_PLACE, &band, 1, MPI_DOUBLE, MPI_MIN, model_.comm());
  const PetscInt n = model_.local_dofs();
  WriteArray out(allowed);
  std::fill_n(out.data() + n, n, std::min(tolerance * size, band / 10));
}

/// The step control weighs displacements and velocities each by their own size, or by what the other makes of
/// them in a sampling interval, of which a radian has ten; from rest by that of the first interval. One size
/// for both would weigh them by the unit of time. With the contacts' forces at the state.
Transient::Sizes Transient::sizes(Vec state) {
  const PetscInt n = model_.local_dofs();
  double largest[2] = {}, start;
  {
    ReadArray in(state);
    for (PetscInt i = 0; i < 2 * n; ++i) largest[i / n] = std::max(largest[i / n], std::abs(in.data()[i]));
  }
  MPI_Allreduce(MPI_IN_PLACE, largest, 2, MPI_DOUBLE, MPI_MAX, model_.comm());
  solve_mass(force_, acceleration_);
  check(VecNorm(acceleration_, NORM_INFINITY, &start));
  const auto [x, v] = largest;
  if (x > 0 || v > 0) return {std::max(x, v * interval_), std::max(v, x / (10 * interval_))};
  return start > 0 ? Sizes{start * interval_ * interval_, start * interval_} : Sizes{1, 1};
}

History Transient::integrate(Vec x0, Vec v0, double tolerance, bool implicit) {
  history_ = {};
  history_.implicit = implicit;
  exception_ = nullptr;
  exhausted_ = false;
  const PetscInt n = model_.local_dofs();
  VecHandle state = make_vector(model_.comm(), 2 * n);
  interpolated_ = like(state);
  {
    WriteArray out(state);
    std::copy_n(ReadArray(x0).data(), n, out.data());
    std::copy_n(ReadArray(v0).data(), n, out.data() + n);
  }
  forces(0, state);  // the contacts' tangents say which entries the Jacobian has
  const Sizes size = sizes(state);
  TsHandle ts;
  TSAdapt adapt;
  check(TSCreate(model_.comm(), ts.out()));
  check(TSSetOptionsPrefix(ts, prefix_.c_str()));
  check(TSSetProblemType(ts, TS_NONLINEAR));
  implicit ? use_implicit(ts) : use_explicit(ts);
  check(TSSetApplicationContext(ts, this));
  check(TSSetPostStep(ts, after_step));
  check(TSSetMaxTime(ts, end_));
  check(TSSetMaxSteps(ts, PETSC_MAX_INT));
  check(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_STEPOVER));
  check(TSSetTimeStep(ts, interval_ / 10));
  VecHandle allowed = like(state);
  {
    WriteArray out(allowed);
    std::fill_n(out.data(), n, tolerance * size.x);
    std::fill_n(out.data() + n, n, tolerance * size.v);
  }
  if (implicit) resolve_sticking(tolerance, size.v, allowed);
  check(TSSetTolerances(ts, PETSC_DECIDE, allowed, tolerance, nullptr));
  check(TSGetAdapt(ts, &adapt));
  check(TSAdaptSetType(adapt, TSADAPTBASIC));
  check(TSSetMaxSNESFailures(ts, -1));
  check(TSSetMaxStepRejections(ts, most_rejections));
  check(TSSetErrorIfStepFails(ts, PETSC_FALSE));
  check(TSSetFromOptions(ts));
  sample(0, state);
  const PetscErrorCode code = TSSolve(ts, state);
  if (exception_) std::rethrow_exception(exception_);
  check(code);
  TSConvergedReason reason;
  PetscInt steps;
  check(TSGetConvergedReason(ts, &reason));
  check(TSGetStepNumber(ts, &steps));
  history_.steps = int(steps);
  history_.finished = reason == TS_CONVERGED_TIME;
  history_.reason = history_.finished                          ? "end"
                    : exhausted_ || reason == TS_CONVERGED_ITS ? "steps"
                    : reason == TS_CONVERGED_USER              ? "limit"
                                                               : TSConvergedReasons[reason];
  return std::move(history_);
}

}  // namespace fretwave::transient
