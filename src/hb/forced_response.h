#pragma once
#include "hb/harmonic_problem.h"

namespace fretwave::hb {

/// Steady response to a periodic excitation, s_n = i n w: y = (Q/a_ref, w/w_ref), w the continuation
/// parameter.
class ForcedResponse : public HarmonicProblem {
 public:
  /// P: excitation as harmonic blocks at level 1; `omega`, `shape`: the linear mode that scales the unknowns.
  /// Collective.
  ForcedResponse(model::Model const&, Harmonics const&, Row row, Vec P, double level, double omega,
                 Vec shape);
  /// Zero motion at angular frequency w: Newton's first step is then the linear response. Collective.
  VecHandle initial(double omega);
  double reference_amplitude() const { return amplitude_; }
  using HarmonicProblem::on;
  std::unique_ptr<HarmonicProblem> on(Harmonics const& h) const override {
    return std::unique_ptr<HarmonicProblem>(new ForcedResponse(*this, h));
  }

  double parameter_value(double entry) const override { return entry * omega_reference_; }
  double parameter_entry(double value) const override { return value / omega_reference_; }
  std::string parameter_text(double value) const override;
  std::string impossible(Vec y) override;
  std::string beyond(Vec y) override;
  /// Of the motion, relative to its size.
  double effect(Vec y, Vec dy) override;
  /// Forces count relative to the excitation.
  double largest_residual() const override { return 1e-6; }
  std::vector<solve::TestFunction> tests(Vec y, Vec tangent) override;

 private:
  ForcedResponse(ForcedResponse const& same, Harmonics const& h)
      : HarmonicProblem(same, h),
        level_(same.level_),
        omega_reference_(same.omega_reference_),
        amplitude_(same.amplitude_) {}
  ScaledMotion motion(std::vector<double> const& z) const override;
  double metric_weight(int) const override { return 100; }  // a step of 0.1 is 1 % of the frequency
  double level_, omega_reference_, amplitude_ = 1;
};

/// What changes on the way to a response.
enum class Way { excitation, gaps };

/// The way to a response that Newton does not find from afar, at its fixed frequency.
/// Excitation, at the share t of the way: R(Q) = P + (1 - t) R_0, with R_0 = R(Q_0) - P what a guess Q_0
/// leaves of the forces. From Q_0 = 0 it is the excitation that grows; from another guess a fictitious force
/// that fades (Newton homotopy, Allgower & Georg 2003). Gaps: R(Q) = P with all gaps wider by t a_ref; from
/// the response that touches nothing they close, to t = 0. A stop without gap is the same at any level:
/// raising the excitation changes nothing there. y = (Q/a_ref, t).
class ForcedStart : public HarmonicProblem {
 public:
  /// From the guess y of a response, whose frequency it keeps. Collective.
  ForcedStart(ForcedResponse&, Vec y, Way);
  VecHandle initial() { return pack(guess_, {way_ == Way::gaps ? out_of_reach : 0.0}); }
  /// Unknowns of the response at the end of the way.
  VecHandle response(Vec y) const;

  double parameter_value(double entry) const override { return entry; }
  double parameter_entry(double value) const override { return value; }
  std::string parameter_text(double value) const override;
  std::string beyond(Vec y) override;
  void metric(Vec y, Vec weights) override;

 private:
  ScaledMotion motion(std::vector<double> const& z) const override;
  Way way_;
  double amplitude_, frequency_;  ///< the response's parameter entry
  Exponents exponents_;
  VecHandle guess_;
};

}  // namespace fretwave::hb
