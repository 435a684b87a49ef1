#include "hb/nonlinear_mode.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "solve/vectors.h"
#include "text.h"

namespace fretwave::hb {

namespace {

constexpr double growth = 3;          // of the logarithm of the amplitude in a step of Newton's, at the most
constexpr double no_damping = 1e-10;  // a ratio that is rounding (as in post/mode_curve.py)

/// phi^H M phi w^2 / phi^H phi, with multiply(x, M x).
template <class Multiply>
double inertia_per_displacement(Multiply multiply, double omega, Vec shape, Vec imaginary) {
  double modal_mass = 0, square = 0;
  for (Vec part : {shape, imaginary}) {
    if (!part) continue;
    VecHandle Mx = like(part);
    multiply(part, Mx);
    modal_mass += solve::dot(part, Mx), square += solve::dot(part, part);
  }
  return omega * omega * modal_mass / square;
}

}  // namespace

double reference_stiffness(model::Model const& model, double omega, Vec shape, Vec imaginary) {
  const MatHandle M = model.sum(2);
  const double k =
      inertia_per_displacement([&](Vec x, Vec Mx) { check(MatMult(M, x, Mx)); }, omega, shape, imaginary);
  if (!(k > 0) || !(omega > 0))
    throw InputError("the starting mode has no modal mass or no frequency",
                     "stiffness " + short_text(k) + ", " + short_text(omega) + " rad/s", "both > 0",
                     "start from an elastic mode of the model");
  return k;
}

NonlinearMode::NonlinearMode(model::Model const& model, Harmonics const& h, Method method, Row row,
                             double omega, Vec shape, Vec imaginary)
    : HarmonicProblem(model, h, 3, std::move(row), reference_stiffness(model, omega, shape, imaginary)),
      method_(method),
      omega_reference_(omega),
      starting_stiffness_(stiffness_scale()),
      masses_(like(shape)),
      shape_(like(shape)),
      imaginary_(like(shape)) {
  double at_dof[2] = {};
  PetscInt begin, end;
  check(VecGetOwnershipRange(shape, &begin, &end));
  {
    const ReadArray re(shape), im(imaginary);
    for (auto const& [dof, weight] : this->row())
      if (dof >= begin && dof < end)
        at_dof[0] += weight * re[dof - begin], at_dof[1] += weight * im[dof - begin];
  }
  MPI_Allreduce(MPI_IN_PLACE, at_dof, 2, MPI_DOUBLE, MPI_SUM, comm());
  double largest, largest_imaginary;
  check(VecNorm(shape, NORM_INFINITY, &largest));
  check(VecNorm(imaginary, NORM_INFINITY, &largest_imaginary));
  largest = std::max(largest, largest_imaginary);
  double heaviest = 0;  // weights may have any unit
  for (auto const& [dof, weight] : this->row()) heaviest = std::max(heaviest, std::abs(weight));
  largest *= heaviest;
  const complex normal(at_dof[0], at_dof[1]);
  if (std::abs(normal) < 1e-10 * largest)
    throw InputError("what is normalised does not move in the starting mode",
                     short_text(std::abs(normal) / largest) + " of the largest displacement", "> 1e-10",
                     "normalise on a dof or row that takes part in the mode");
  const complex scale = 1.0 / normal;
  check(VecAXPBYPCZ(shape_, scale.real(), -scale.imag(), 0, shape, imaginary));
  check(VecAXPBYPCZ(imaginary_, scale.imag(), scale.real(), 0, shape, imaginary));
  check(MatGetDiagonal(model.sum(2), masses_));
}

NonlinearMode::NonlinearMode(NonlinearMode const& same, Harmonics const& h)
    : HarmonicProblem(same, h),
      method_(same.method_),
      omega_reference_(same.omega_reference_),
      starting_stiffness_(same.starting_stiffness_),
      masses_(solve::copy(same.masses_)),
      shape_(solve::copy(same.shape_)),
      imaginary_(solve::copy(same.imaginary_)) {}

VecHandle NonlinearMode::initial(double amplitude) {
  if (!(amplitude > 0))
    throw InputError("modal amplitude is not positive", short_text(amplitude), "> 0",
                     "start at a small positive amplitude");
  const PetscInt m = harmonics().block_size(), fundamental = harmonics().offset(harmonics().fundamental());
  VecHandle q = make_vector(comm(), model().local_dofs() * m);
  {
    WriteArray out(q);
    ReadArray re(shape_), im(imaginary_);
    for (PetscInt i = 0; i < model().local_dofs(); ++i)  // q_1 = Qc - i Qs
      out[i * m + fundamental] = re[i], out[i * m + fundamental + 1] = -im[i];
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

bool NonlinearMode::scale(Vec y) {
  const PetscInt m = harmonics().block_size(), fundamental = harmonics().offset(harmonics().fundamental());
  VecHandle re = like(shape_), im = like(shape_);
  {
    ReadArray in(y);
    WriteArray cosine(re), sine(im);
    for (PetscInt i = 0; i < model().local_dofs(); ++i)
      cosine[i] = in[i * m + fundamental], sine[i] = in[i * m + fundamental + 1];
  }
  const auto z = scalars(y);
  const auto by_diagonal = [&](Vec x, Vec Mx) { check(VecPointwiseMult(Mx, masses_, x)); };
  const double now =
      inertia_per_displacement(by_diagonal, std::hypot(z[0], z[1]) * omega_reference_, re, im) /
      inertia_per_displacement(by_diagonal, omega_reference_, shape_, imaginary_);
  if (!(now > 0) || !std::isfinite(now)) return false;
  const double steps = std::round(std::log2(now) / 4);
  return measure_in(starting_stiffness_ * std::exp2(4 * steps));
}

double NonlinearMode::effect(Vec y, Vec dy) {
  const auto z = scalars(y), dz = scalars(dy);
  const double omega = std::abs(z[1]), beta = std::max(std::abs(z[0]), 1e-4 * omega);
  return std::max(std::abs(dz[1]) / omega, 0.01 * std::abs(dz[0]) / beta);
}

double NonlinearMode::bearable(Vec, Vec dy) { return std::min(1.0, growth / std::abs(scalars(dy)[2])); }

bool NonlinearMode::damped(Vec y) {
  constexpr double rounding = 1e-7;  // what a last step may leave in beta
  const auto z = scalars(y);
  return std::abs(z[0]) > rounding * std::abs(z[1]);
}

double NonlinearMode::parameter_value(double entry) const { return std::exp(entry); }
double NonlinearMode::parameter_entry(double value) const { return std::log(value); }

std::string NonlinearMode::parameter_text(double value) const { return "amplitude " + short_text(value); }

std::string NonlinearMode::impossible(Vec y) {
  const auto z = scalars(y);
  if (!std::isfinite(z[0]) || !std::isfinite(z[1]) || !std::isfinite(std::exp(z[2])))
    return "frequency, damping or amplitude is not finite";
  if (z[1] <= 0) return "the frequency falls below zero";
  const bool still =
      method_ == Method::CNM && z[1] <= 1e-6 * std::abs(z[0]);  // exp(-beta t) alone solves it too
  return still ? "overdamped: the motion does not oscillate any more" : "";
}

std::vector<solve::TestFunction> NonlinearMode::tests(Vec y, Vec tangent) {
  const auto z = scalars(y), dz = scalars(tangent);
  // zeta = beta/w0 grows with beta/w in both variants: its change along the branch has the sign of w dbeta -
  // beta dw; a damping that is rounding has none
  const bool damped = std::abs(z[0]) > no_damping * std::abs(z[1]);
  return {{"zero_damping", z[0]}, {"peak_damping", damped ? z[1] * dz[0] - z[0] * dz[1] : 0, true, true}};
}

ModeStart::ModeStart(model::Model const& model, Harmonics const& h, Method method, Row row, double omega,
                     Vec shape, Vec imaginary, double amplitude)
    : NonlinearMode(model, h, method, std::move(row), omega, shape, imaginary), amplitude_(amplitude) {}

VecHandle ModeStart::initial() {
  VecHandle y = NonlinearMode::initial(amplitude_);
  solve::set_last_entry(y, out_of_reach);
  return y;
}

VecHandle ModeStart::mode(Vec y) const {
  VecHandle out = solve::copy(y);
  solve::set_last_entry(out, std::log(amplitude_));
  return out;
}

ScaledMotion ModeStart::motion(std::vector<double> const& z) const {
  ScaledMotion out = NonlinearMode::motion({z[0], z[1], std::log(amplitude_)});
  out.dlog_amplitude[2] = 0;
  out.stand_off = amplitude_ * z[2], out.dstand_off = amplitude_;
  return out;
}

std::string ModeStart::parameter_text(double value) const { return gap_text(value * amplitude_); }

void ModeStart::metric(Vec y, Vec weights) {
  NonlinearMode::metric(y, weights);
  solve::set_last_entry(weights, gap_weight(solve::last_entry(y)));
}

std::string ModeStart::impossible(Vec y) {
  const auto z = scalars(y);
  if (!std::isfinite(z[0]) || !std::isfinite(z[1]) || !std::isfinite(z[2]))
    return "frequency or damping is not finite";
  return z[1] > 0 ? "" : "the frequency falls below zero";
}

}  // namespace fretwave::hb
