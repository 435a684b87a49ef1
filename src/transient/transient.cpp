#include "transient/transient.h"

#include <algorithm>
#include <cmath>

#include "error.h"

namespace fretwave::transient {

using TsHandle = Handle<TS, TSDestroy>;

Transient::Transient(model::Model const& model, std::vector<Excitation> excitation, double omega,
                     std::string const& prefix)
    : model_(model),
      excitation_(std::move(excitation)),
      omega_(omega),
      prefix_(prefix),
      K_(model.sum(0)),
      C_(model.sum(1)) {
  for (auto* v : {&x_, &v_, &force_, &acceleration_}) *v = model.displacement();
  PC pc;
  check(KSPCreate(model.comm(), mass_.out()));
  check(KSPSetOptionsPrefix(mass_, (prefix + "mass_").c_str()));
  MatHandle M = model.sum(2);
  check(KSPSetOperators(mass_, M, M));
  check(KSPSetType(mass_, KSPPREONLY));
  check(KSPGetPC(mass_, &pc));
  check(PCSetType(
      pc, comm_size(model.comm()) > 1 ? PCREDUNDANT : PCLU));  // M is positive definite: no pivots needed
  check(KSPSetFromOptions(mass_));
  check(KSPSetUp(mass_));
}

void Transient::contact_force(model::Contact const& contact, Vec force) {
  VecHandle u, v, f;
  check(MatCreateVecs(contact.B, nullptr, u.out()));
  v = like(u), f = like(u);
  check(MatMult(contact.B, x_, u));
  check(MatMult(contact.B, v_, v));
  const int d = contact.law->components(), n = contact.law->pairs();
  const auto transpose = [d, n](double const* in, std::vector<double>& out, bool pairs_innermost) {
    for (int c = 0; c < d; ++c)
      for (int i = 0; i < n; ++i)
        pairs_innermost ? out[size_t(c) * n + i] = in[size_t(i) * d + c]
                        : out[size_t(i) * d + c] = in[size_t(c) * n + i];
  };
  std::vector<double> uu(size_t(d) * n), vv(uu.size()), ff(uu.size()), rows(uu.size());
  transpose(ReadArray(u).data(), uu, true);
  transpose(ReadArray(v).data(), vv, true);
  contact::Record record;
  contact.law->force({.samples = 1, .components = d, .pairs = n, .u = uu.data(), .v = vv.data(), .step = 0},
                     ff.data(), record);
  transpose(ff.data(), rows, false);
  {
    WriteArray out(f);
    std::copy(rows.begin(), rows.end(), out.data());
  }
  check(MatMultTransposeAdd(contact.B, f, force, force));
}

/// (x, v)' = (v, M^-1 (p - C v - K x - B^T f))
void Transient::rate(double t, Vec state, Vec rate) {
  const PetscInt n = model_.local_dofs();
  {
    ReadArray in(state);
    WriteArray x(x_), v(v_);
    std::copy_n(in.data(), n, x.data());
    std::copy_n(in.data() + n, n, v.data());
  }
  check(MatMult(K_, x_, force_));
  if (C_) check(MatMultAdd(C_, v_, force_, force_));
  for (auto const& contact : model_.contacts()) contact_force(contact, force_);
  for (auto const& part : excitation_) {
    check(VecAXPY(force_, -std::cos(part.order * omega_ * t), part.cosine));
    check(VecAXPY(force_, -std::sin(part.order * omega_ * t), part.sine));
  }
  check(KSPSolve(mass_, force_, acceleration_));
  ReadArray v(v_), a(acceleration_);
  WriteArray out(rate);
  std::copy_n(v.data(), n, out.data());
  for (PetscInt i = 0; i < n; ++i) out[n + i] = -a[i];
}

PetscErrorCode Transient::right_side(TS, PetscReal t, Vec state, Vec rate, void* context) {
  auto& self = *static_cast<Transient*>(context);
  try {
    self.rate(t, state, rate);
  } catch (...) {
    self.exception_ = std::current_exception();
    return PETSC_ERR_USER;
  }
  return PetscErrorCode(0);
}

PetscErrorCode Transient::after_step(TS ts) {
  Transient* self;
  PetscErrorCode code = TSGetApplicationContext(ts, &self);
  if (code) return code;
  try {
    self->record(ts);
  } catch (...) {
    self->exception_ = std::current_exception();
    return PETSC_ERR_USER;
  }
  return PetscErrorCode(0);
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

History Transient::run(Vec x0, Vec v0, double t_end, double dt_out, double tolerance, double limit) {
  if (!(dt_out > 0) || !(t_end > 0))
    throw InputError("time integration needs a positive duration and sampling interval",
                     std::to_string(t_end) + ", " + std::to_string(dt_out), "> 0",
                     "give t_end and dt_out above 0");
  history_ = {};
  interval_ = dt_out, end_ = t_end, limit_ = limit;
  exception_ = nullptr;
  const PetscInt n = model_.local_dofs();
  VecHandle state = make_vector(model_.comm(), 2 * n);
  interpolated_ = like(state);
  {
    WriteArray out(state);
    std::copy_n(ReadArray(x0).data(), n, out.data());
    std::copy_n(ReadArray(v0).data(), n, out.data() + n);
  }
  // the step control weighs displacements and velocities by their own size
  double size;
  check(VecNorm(state, NORM_INFINITY, &size));
  TsHandle ts;
  TSAdapt adapt;
  check(TSCreate(model_.comm(), ts.out()));
  check(TSSetOptionsPrefix(ts, prefix_.c_str()));
  check(TSSetProblemType(ts, TS_NONLINEAR));
  check(TSSetType(ts, TSRK));
  check(TSRKSetType(ts, TSRK5DP));
  check(TSSetRHSFunction(ts, nullptr, right_side, this));
  check(TSSetApplicationContext(ts, this));
  check(TSSetPostStep(ts, after_step));
  check(TSSetMaxTime(ts, t_end));
  check(TSSetMaxSteps(ts, PETSC_MAX_INT));
  check(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_STEPOVER));
  check(TSSetTimeStep(ts, dt_out / 10));
  check(TSSetTolerances(ts, tolerance * std::max(size, 1e-12), nullptr, tolerance, nullptr));
  check(TSGetAdapt(ts, &adapt));
  check(TSAdaptSetType(adapt, TSADAPTBASIC));
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
  history_.finished = reason == TS_CONVERGED_TIME || reason == TS_CONVERGED_ITS;
  history_.reason = TSConvergedReasons[reason];
  return std::move(history_);
}

}  // namespace fretwave::transient
