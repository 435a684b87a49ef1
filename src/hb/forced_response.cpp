#include "hb/forced_response.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "hb/nonlinear_mode.h"
#include "solve/vectors.h"
#include "text.h"

namespace fretwave::hb {

using solve::dot, solve::last_entry, solve::set_last_entry;

namespace {

// Motion in units of the static deflection at the reference stiffness: a resonance of zeta = 5e-9.
constexpr double unbounded = 1e8;

}  // namespace

ForcedResponse::ForcedResponse(model::Model const& model, Harmonics const& h, Row row, Vec P, double level,
                               double omega, Vec shape)
    : HarmonicProblem(model, h, 1, std::move(row), reference_stiffness(model, omega, shape)),
      level_(level),
      omega_reference_(omega) {
  check(VecCopy(P, excitation()));
  check(VecScale(excitation(), level));
  double force;
  check(VecNorm(excitation(), NORM_2, &force));
  if (!(force > 0))
    throw InputError("the excitation is zero", "0", "a force at one dof at least",
                     "give 'force' and a level > 0");
  amplitude_ = force / reference_stiffness(model, omega, shape);
}

VecHandle ForcedResponse::initial(double omega) {
  if (!(omega > 0))
    throw InputError("excitation frequency is not positive", short_text(omega) + " rad/s", "> 0",
                     "give a frequency range above 0");
  VecHandle q = make_vector(comm(), model().local_dofs() * harmonics().block_size());
  check(VecSet(q, 0));
  return pack(q, {omega / omega_reference_});
}

ScaledMotion ForcedResponse::motion(std::vector<double> const& z) const {
  ScaledMotion out{amplitude_, {}, {0}, {{}}};
  for (int n : harmonics().orders()) {
    out.exponents.s.push_back(complex(0, n * z[0] * omega_reference_));
    out.dexponents[0].s.push_back(complex(0, n * omega_reference_));
  }
  return out;
}

std::string ForcedResponse::parameter_text(double value) const { return short_text(value) + " rad/s"; }

std::string ForcedResponse::impossible(Vec y) {
  const auto z = scalars(y);
  if (!std::isfinite(z[0]) || !std::isfinite(z[1]) || !std::isfinite(z[2])) return "the motion is not finite";
  return z[0] > 0 ? "" : "the frequency falls below zero";
}

double ForcedResponse::effect(Vec y, Vec dy) {
  VecHandle weights = unknowns();
  metric(y, weights);
  return solve::weighted_norm(weights, dy);
}

std::string ForcedResponse::beyond(Vec y) {
  double largest;
  check(VecNorm(y, NORM_INFINITY, &largest));
  return largest > unbounded ? "the response grows without bound" : "";
}

/// a da/ds > 0 before a peak of the observed amplitude a, with a^2 = c^2 + s^2 of its fundamental.
std::vector<solve::TestFunction> ForcedResponse::tests(Vec y, Vec tangent) {
  const auto z = scalars(y), dz = scalars(tangent);
  const double square = z[1] * z[1] + z[2] * z[2];
  return {{"peak", square > 0 ? (z[1] * dz[1] + z[2] * dz[2]) / square : 0, true, false}};
}

ForcedStart::ForcedStart(ForcedResponse& to, Vec y, Way way)
    : HarmonicProblem(to.model(), to.harmonics(), 1, to.row(), to.stiffness_scale()),
      way_(way),
      amplitude_(to.reference_amplitude()),
      frequency_(last_entry(y)),
      exponents_(to.scaled(y).exponents) {
  VecHandle left = to.equations();
  to.residual(y, left);
  guess_ = like(excitation());
  {
    const PetscInt n = local_size(guess_);
    const ReadArray r(left), q(y);
    const double force = stiffness_scale() * amplitude_;
    WriteArray rest(excitation()), guess(guess_);
    for (PetscInt i = 0; i < n; ++i) rest[i] = way_ == Way::excitation ? force * r[i] : 0, guess[i] = q[i];
  }
  keep_loads(to);
}

VecHandle ForcedStart::response(Vec y) const {
  VecHandle q = like(guess_);
  {
    const PetscInt n = local_size(q);
    const ReadArray in(y);
    std::copy_n(in.data(), n, WriteArray(q).data());
  }
  return pack(q, {frequency_});
}

ScaledMotion ForcedStart::motion(std::vector<double> const& z) const {
  Exponents none{std::vector<complex>(harmonics().count()), 0};
  ScaledMotion out{
      .amplitude = amplitude_, .exponents = exponents_, .dlog_amplitude = {0}, .dexponents = {none}};
  if (way_ == Way::excitation)
    out.load = 1 - z[0], out.dload = {-1};
  else
    out.stand_off = amplitude_ * z[0], out.dstand_off = amplitude_;
  return out;
}

std::string ForcedStart::parameter_text(double value) const {
  return way_ == Way::gaps ? gap_text(value * amplitude_)
                           : short_text(100 * value) + " % of the way to the start";
}

std::string ForcedStart::beyond(Vec y) {
  double largest;
  check(VecNorm(y, NORM_INFINITY, &largest));
  return largest > unbounded ? "the response grows without bound" : "";
}

/// The motion counts relative to its own size, but not below the static deflection.
void ForcedStart::metric(Vec y, Vec weights) {
  const double t = last_entry(y);
  double square = dot(y, y) - t * t;
  check(VecSet(weights, 1 / std::max(square, 1.0)));
  set_last_entry(weights, way_ == Way::gaps ? gap_weight(t) : 1);
}

}  // namespace fretwave::hb
