#include "transient/transient.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "text.h"

namespace fretwave::transient {

using TsHandle = Handle<TS, TSDestroy>;

constexpr int look = 5000;               // steps between two looks at how many there will be
constexpr double explicit_share = 0.25;  // of all steps allowed: an implicit one costs several explicit ones
constexpr double largest_cubed = 1e75;   // its cube, by a stiffness and a rate, is a number
constexpr int most_rejections = 100;  // of one step: at the onset of sticking it falls by many orders at once

namespace {

/// The PC that has the factor: of each rank's own copy, if there are copies.
PC factor_of(KSP ksp) {
  PC pc;
  PetscBool copies;
  check(KSPGetPC(ksp, &pc));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCREDUNDANT, &copies));
  if (!copies) return pc;
  check(PCRedundantGetKSP(pc, &ksp));
  check(KSPGetPC(ksp, &pc));
  return pc;
}

/// M is positive definite: no pivots needed. What is zero of them goes by its smallest entry, for PETSc's own
/// 2.2e-14 would be a mass in some units.
void use_lu_without_pivots(KSP ksp, Mat M) {
  constexpr double singular = 1e-13;
  PC pc;
  MPI_Comm comm;
  double smallest;
  VecHandle diagonal;
  check(MatCreateVecs(M, diagonal.out(), nullptr));
  check(MatGetDiagonal(M, diagonal));
  check(VecMin(diagonal, nullptr, &smallest));
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(M), &comm));
  check(KSPGetPC(ksp, &pc));
  if (comm_size(comm) > 1) check(PCSetType(pc, PCREDUNDANT));
  pc = factor_of(ksp);
  check(PCSetType(pc, PCLU));
  check(PCFactorSetZeroPivot(pc, singular * std::max(smallest, 0.0)));
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
  use_lu_without_pivots(mass_, M_);
  check(KSPSetFromOptions(mass_));
  check(KSPSetUp(mass_));
  PCFailedReason reason;
  KSPConvergedReason solved;
  check(PCGetFailedReason(factor_of(mass_), &reason));  // options may have chosen another PC
  check(VecSet(force_, 1));
  check(KSPSolve(mass_, force_, acceleration_));  // copies of several ranks tell only then (PETSc 3.26)
  check(KSPGetConvergedReason(mass_, &solved));
  if (reason != PC_NOERROR || solved < 0)
    throw InputError("the mass matrix is singular", "a pivot that is zero beside its smallest diagonal entry",
                     "a mass for every motion", "give every dof a mass, or reduce the model");
}

PetscErrorCode Transient::after_step(TS ts) {
  Transient* self;
  PetscErrorCode code = TSGetApplicationContext(ts, &self);
  if (code) return code;
  return self->guard_.run([&] {
    self->record(ts);
    self->watch(ts);
    Vec state;
    check(TSGetSolution(ts, &state));
    self->begun_ = self->see(state);
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

/// Largest displacement of this rank's dofs in a state [x, v].
double Transient::largest(Vec state) const {
  double out = 0;
  ReadArray in(state);
  for (PetscInt i = 0; i < model_.local_dofs(); ++i) out = std::max(out, std::abs(in[i]));
  return out;
}

/// Samples up to the step's end, by the method's own interpolation; ends the run where the motion exceeds the
/// limit, if it does so between two samples with that state: to infinity in a finite time the last way is
/// shorter.
void Transient::record(TS ts) {
  double t, reached[2] = {};  // by the samples, at the step's end
  check(TSGetTime(ts, &t));
  for (double next = interval_ * double(history_.t.size()); next <= std::min(t, end_) * (1 + 1e-14);
       next = interval_ * double(history_.t.size())) {
    check(TSInterpolate(ts, std::min(next, t), interpolated_));
    sample(next, interpolated_);
    reached[0] = std::max(reached[0], largest(interpolated_));
  }
  Vec state;
  check(TSGetSolution(ts, &state));
  reached[1] = t < end_ ? largest(state) : 0;
  MPI_Allreduce(MPI_IN_PLACE, reached, 2, MPI_DOUBLE, MPI_MAX, model_.comm());
  if (reached[1] > limit_ && reached[0] <= limit_) sample(t, state);
  if (std::max(reached[0], reached[1]) > limit_) check(TSSetConvergedReason(ts, TS_CONVERGED_USER));
}

/// A trial step towards a state whose forces would be no numbers is taken shorter, and one that passes a kink
/// between its ends.
PetscErrorCode Transient::expect_sound(TS ts, PetscReal t, Vec state, PetscBool* accept) {
  Transient* self;
  PetscErrorCode code = TSGetApplicationContext(ts, &self);
  if (code) return code;
  return self->guard_.run([&] {
    int numbers = 1;
    {
      ReadArray in(state);
      for (PetscInt i = 0; i < local_size(state); ++i)
        if (!(std::abs(in[i]) <= largest_cubed)) numbers = 0;  // nor nan, which a maximum over ranks loses
    }
    MPI_Allreduce(MPI_IN_PLACE, &numbers, 1, MPI_INT, MPI_LAND, self->model_.comm());
    *accept = numbers && !self->passes_kinks(ts, t, state) ? PETSC_TRUE : PETSC_FALSE;
  });
}

void Transient::use_explicit(TS ts) {
  check(TSSetType(ts, TSRK));
  check(TSRKSetType(ts, TSRK5DP));
  check(TSSetRHSFunction(ts, nullptr, right_side, this));
}

void Transient::use_implicit(TS ts) {
  if (!jacobian_) prepare_jacobian();
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

/// w of a motion of this shape, by Rayleigh's quotient with the contacts' tangents; a sample's tenth of a
/// radian where nothing holds it.
double Transient::rate(Vec shape) {
  VecHandle product = like(shape);
  double stiffness, mass;
  check(MatMult(K_, shape, product));
  for (size_t i = 0; i < tangents_.size(); ++i) add_tangent(i, shape, product);
  check(VecDot(shape, product, &stiffness));
  check(MatMult(M_, shape, product));
  check(VecDot(shape, product, &mass));
  const double least = 0.1 / interval_;
  return stiffness > 0 && mass > 0 ? std::max(std::sqrt(stiffness / mass), least) : least;
}

/// The step control weighs displacements and velocities each by their own size: what the state has, and what
/// the forces there, and those that vary, make of it at the rate of such a motion. A static displacement
/// makes no velocity, and no unit of time weighs one against the other. With the contacts' forces at the
/// state.
Transient::Sizes Transient::sizes(Vec state) {
  const PetscInt n = model_.local_dofs();
  double largest[2] = {};
  {
    ReadArray in(state);
    for (PetscInt i = 0; i < 2 * n; ++i) largest[i / n] = std::max(largest[i / n], std::abs(in[i]));
  }
  MPI_Allreduce(MPI_IN_PLACE, largest, 2, MPI_DOUBLE, MPI_MAX, model_.comm());
  Sizes size = {largest[0], largest[1]};
  if (size.v > 0) size.x = std::max(size.x, size.v / rate(v_));
  const auto take = [&](Vec force) {
    double a;
    solve_mass(force, acceleration_);
    check(VecNorm(acceleration_, NORM_INFINITY, &a));
    if (!(a > 0)) return;
    const double w = rate(acceleration_);
    size.v = std::max(size.v, a / w), size.x = std::max(size.x, a / (w * w));
  };
  take(force_);
  for (auto const& part : excitation_)
    if (part.order > 0) take(part.cosine), take(part.sine);
  if (size.x == 0) return {1, 1};
  return {size.x, size.v > 0 ? size.v : size.x * rate(x_)};
}

void Transient::set_up(TS ts, Vec state, double tolerance, bool implicit) {
  TSAdapt adapt;
  check(TSSetOptionsPrefix(ts, prefix_.c_str()));
  check(TSSetProblemType(ts, TS_NONLINEAR));
  implicit ? use_implicit(ts) : use_explicit(ts);
  check(TSSetApplicationContext(ts, this));
  check(TSSetPostStep(ts, after_step));
  check(TSSetFunctionDomainError(ts, expect_sound));
  check(TSSetMaxTime(ts, end_));
  check(TSSetMaxSteps(ts, PETSC_MAX_INT));
  check(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_STEPOVER));
  check(TSSetTimeStep(ts, interval_ / 10));
  const Sizes size = sizes(state);
  const PetscInt n = model_.local_dofs();
  VecHandle allowed = like(state);
  allowed_ = tolerance * size.x;
  {
    WriteArray out(allowed);
    std::fill_n(out.data(), n, tolerance * size.x);
    std::fill_n(out.data() + n, n, tolerance * size.v);
  }
  resolve_sticking(tolerance, size.v, allowed);
  check(TSSetTolerances(ts, PETSC_DECIDE, allowed, tolerance, nullptr));
  check(TSGetAdapt(ts, &adapt));
  check(TSAdaptSetType(adapt, TSADAPTBASIC));
  check(TSSetMaxSNESFailures(ts, -1));
  check(TSSetMaxStepRejections(ts, most_rejections));
  check(TSSetErrorIfStepFails(ts, PETSC_FALSE));
  check(TSSetFromOptions(ts));
}

/// How the run ended.
void Transient::conclude(TS ts) {
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
}

History Transient::integrate(Vec x0, Vec v0, double tolerance, bool implicit) {
  history_ = {};
  history_.implicit = implicit;
  guard_.clear();
  exhausted_ = false;
  const PetscInt n = model_.local_dofs();
  VecHandle state = make_vector(model_.comm(), 2 * n);
  interpolated_ = like(state);
  {
    WriteArray out(state);
    std::copy_n(ReadArray(x0).data(), n, out.data());
    std::copy_n(ReadArray(v0).data(), n, out.data() + n);
  }
  begun_ = see(state);
  forces(0, state, true);  // the contacts' tangents say which entries the Jacobian has
  TsHandle ts;
  check(TSCreate(model_.comm(), ts.out()));
  set_up(ts, state, tolerance, implicit);
  sample(0, state);
  const PetscErrorCode code = TSSolve(ts, state);
  guard_.rethrow();
  check(code);
  conclude(ts);
  return std::move(history_);
}

}  // namespace fretwave::transient
