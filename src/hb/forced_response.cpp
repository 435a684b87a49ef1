#include "hb/forced_response.h"

#include <cmath>

#include "error.h"
#include "hb/nonlinear_mode.h"

namespace fretwave::hb {

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

ForcedState ForcedResponse::state(Vec y) {
  const auto z = scalars(y);
  const double cosine = amplitude_ * z[1], sine = amplitude_ * z[2];
  return {level_, z[0] * omega_reference_, std::hypot(cosine, sine), std::atan2(-sine, cosine)};
}

}  // namespace fretwave::hb
