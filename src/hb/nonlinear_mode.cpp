#include "hb/nonlinear_mode.h"

#include <cmath>

#include "error.h"

namespace fretwave::hb {

double reference_stiffness(model::Model const& model, double omega, Vec shape) {
  VecHandle Mx = like(shape);
  double modal_mass, square;
  check(MatMult(model.sum(2), shape, Mx));
  check(VecDot(shape, Mx, &modal_mass));
  check(VecDot(shape, shape, &square));
  if (!(modal_mass > 0) || !(omega > 0))
    throw InputError("the starting mode has no modal mass or no frequency",
                     std::to_string(modal_mass) + ", " + std::to_string(omega) + " rad/s", "both > 0",
                     "start from an elastic mode of the model");
  return omega * omega * modal_mass / square;
}

NonlinearMode::NonlinearMode(model::Model const& model, Harmonics const& h, Method method, PetscInt dof,
                             double omega, Vec shape)
    : HarmonicProblem(model, h, 3, dof, reference_stiffness(model, omega, shape)),
      method_(method),
      omega_reference_(omega),
      shape_(like(shape)) {
  check(VecCopy(shape, shape_));
  double at_dof = 0;
  PetscInt begin, end;
  check(VecGetOwnershipRange(shape_, &begin, &end));
  if (dof >= begin && dof < end) at_dof = ReadArray(shape_)[dof - begin];
  MPI_Allreduce(MPI_IN_PLACE, &at_dof, 1, MPI_DOUBLE, MPI_SUM, comm());
  double largest;
  check(VecNorm(shape_, NORM_INFINITY, &largest));
  if (std::abs(at_dof) < 1e-10 * largest)
    throw InputError("the normalised dof does not move in the starting mode",
                     std::to_string(at_dof / largest) + " of the largest displacement", "> 1e-10",
                     "normalise on a dof that takes part in the mode");
  check(VecScale(shape_, 1 / at_dof));
}

VecHandle NonlinearMode::initial(double amplitude) {
  if (!(amplitude > 0))
    throw InputError("modal amplitude is not positive", std::to_string(amplitude), "> 0",
                     "start at a small positive amplitude");
  const PetscInt m = harmonics().block_size();
  VecHandle q = make_vector(comm(), model().local_dofs() * m);
  {
    WriteArray out(q);
    ReadArray phi(shape_);
    for (PetscInt i = 0; i < model().local_dofs(); ++i)
      out[i * m + harmonics().offset(harmonics().fundamental())] = phi[i];
  }
  return pack(q, {0.0, 1.0, std::log(amplitude)});
}

ScaledMotion NonlinearMode::motion(std::vector<double> const& z) const {
  const double beta = z[0] * omega_reference_, omega = z[1] * omega_reference_;
  const complex i(0, 1);
  // lambda, its derivatives by beta and w, and the inertia damping g per beta
  const complex lambda = method_ == Method::CNM ? complex(-beta, omega) : complex(0, omega);
  const complex by_beta = method_ == Method::CNM ? -1.0 : 0.0;
  const double g = method_ == Method::CNM ? 0 : 2;
  ScaledMotion out{std::exp(z[2]), {{}, g * beta}, {0, 0, 1}, {{{}, g * omega_reference_}, {{}, 0}, {{}, 0}}};
  for (int n : harmonics().orders()) {
    out.exponents.s.push_back(double(n) * lambda);
    out.dexponents[0].s.push_back(double(n) * by_beta * omega_reference_);
    out.dexponents[1].s.push_back(double(n) * i * omega_reference_);
    out.dexponents[2].s.push_back(0);
  }
  return out;
}

ModalState NonlinearMode::state(Vec y) {
  const auto z = scalars(y);
  const double beta = z[0] * omega_reference_, w = z[1] * omega_reference_;
  if (method_ == Method::CNM) {
    const double omega0 = std::hypot(beta, w);
    return {std::exp(z[2]), w, omega0, beta, beta / omega0};
  }
  const double zeta = beta / w;  // reported as w = w0 sqrt(1 - zeta^2)
  return {std::exp(z[2]), w * std::sqrt(1 - zeta * zeta), w, beta, zeta};
}

double NonlinearMode::parameter_value(double entry) const { return std::exp(entry); }
double NonlinearMode::parameter_entry(double value) const { return std::log(value); }

std::vector<solve::TestFunction> NonlinearMode::tests(Vec y, Vec tangent) {
  const auto z = scalars(y), dz = scalars(tangent);
  // zeta = beta/w0 grows with beta/w in both variants: its change along the branch has the sign of w dbeta -
  // beta dw
  return {{"zero_damping", z[0]}, {"peak_damping", z[1] * dz[0] - z[0] * dz[1], true, true}};
}

}  // namespace fretwave::hb
