#include "hb/forced_response.h"

#include <cmath>

#include "error.h"
#include "hb/nonlinear_mode.h"
#include "text.h"

namespace fretwave::hb {

namespace {

// Motion in units of the static deflection at the reference stiffness: a resonance of zeta = 5e-9.
constexpr double unbounded = 1e8;

}  // namespace

ForcedResponse::ForcedResponse(model::Model const& model, Harmonics const& h, PetscInt dof, Vec P,
                               double level, double omega, Vec shape)
    : HarmonicProblem(model, h, 1, dof, reference_stiffness(model, omega, shape)),
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
    throw InputError("excitation frequency is not positive", std::to_string(omega) + " rad/s", "> 0",
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

std::string ForcedResponse::beyond(Vec y) {
  double largest;
  check(VecNorm(y, NORM_INFINITY, &largest));
  return largest > unbounded ? "the response grows without bound" : "";
}

/// a da/ds > 0 before a peak of the observed amplitude a, with a^2 = c^2 + s^2 of its fundamental.
std::vector<solve::TestFunction> ForcedResponse::tests(Vec y, Vec tangent) {
  const auto z = scalars(y), dz = scalars(tangent);
  const double square = z[1] * z[1] + z[2] * z[2];
  return {{"peak", square > 0 ? (z[1] * dz[1] + z[2] * dz[2]) / square : 0, true, true}};
}

ForcedState ForcedResponse::state(Vec y) {
  const auto z = scalars(y);
  const double cosine = amplitude_ * z[1], sine = amplitude_ * z[2];
  return {level_, z[0] * omega_reference_, std::hypot(cosine, sine), std::atan2(-sine, cosine)};
}

}  // namespace fretwave::hb
