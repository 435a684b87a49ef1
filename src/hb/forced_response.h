#pragma once
#include "hb/harmonic_problem.h"

namespace fretwave::hb {

struct ForcedState {
  double level, omega, amplitude, phase;
};

/// Steady response to a periodic excitation, s_n = i n w: y = (Q/a_ref, w/w_ref), w the continuation
/// parameter.
class ForcedResponse : public HarmonicProblem {
 public:
  /// P: excitation as harmonic blocks at level 1; `omega`, `shape`: the linear mode that scales the unknowns.
  /// Collective.
  ForcedResponse(model::Model const&, Harmonics const&, PetscInt dof, Vec P, double level, double omega,
                 Vec shape);
  /// Zero motion at angular frequency w: Newton's first step is then the linear response. Collective.
  VecHandle initial(double omega);
  /// Amplitude and phase of the observed dof's fundamental, x = A cos(w t + phase).
  ForcedState state(Vec y);

  double parameter_value(double entry) const override { return entry * omega_reference_; }
  double parameter_entry(double value) const override { return value / omega_reference_; }
  std::string parameter_text(double value) const override;
  std::string impossible(Vec y) override;
  std::string beyond(Vec y) override;
  std::vector<solve::TestFunction> tests(Vec y, Vec tangent) override;

 private:
  ScaledMotion motion(std::vector<double> const& z) const override;
  double metric_weight(int) const override { return 100; }  // a step of 0.1 is 1 % of the frequency
  double level_, omega_reference_, amplitude_ = 1;
};

}  // namespace fretwave::hb
