#pragma once
#include "hb/harmonic_problem.h"

namespace fretwave::hb {

/// Which exponents the motion of a mode has; all results say which one it is.
enum class Method {
  CNM,  ///< complex nonlinear mode, s_n = n (-beta + i w) (Laxalde et al. 2008, eq. 4)
  EPMC  ///< extended periodic motion concept, s_n = i n w0, damping C - 2 zeta w0 M (Krack 2015)
};

/// A family of decaying motions over the modal amplitude a: y = (Q/a, beta/w_ref, w/w_ref, log a), w = w0 for
/// EPMC. What these say of frequency and damping is in python/fretwave/hb/states.py.
class NonlinearMode : public HarmonicProblem {
 public:
  /// Started from a linear mode, angular frequency and complex shape (real and imaginary part), normalised on
  /// a row. Collective.
  NonlinearMode(model::Model const&, Harmonics const&, Method, Row row, double omega, Vec shape,
                Vec imaginary);
  /// The linear mode at amplitude a. Collective.
  VecHandle initial(double amplitude);
  Method method() const { return method_; }
  using HarmonicProblem::on;
  std::unique_ptr<HarmonicProblem> on(Harmonics const& h) const override {
    return std::unique_ptr<HarmonicProblem>(new NonlinearMode(*this, h));
  }
  /// k_ref of the motion at y in place of the starting mode's, by powers of 16, as the diagonal of M tells: a
  /// contact far stiffer than what moves once it slips would hide every other force behind its own.
  bool scale(Vec y) override;
  /// Of omega, and a hundredth of the relative one of beta (of 1e-4 omega where it is smaller).
  double effect(Vec y, Vec dy) override;
  /// The amplitude is an exponential of its entry.
  double bearable(Vec y, Vec dy) override;
  bool damped(Vec y) override;

  double parameter_value(double entry) const override;
  double parameter_entry(double value) const override;
  std::string parameter_text(double value) const override;
  std::string impossible(Vec y) override;
  std::vector<solve::TestFunction> tests(Vec y, Vec tangent) override;

 protected:
  ScaledMotion motion(std::vector<double> const& z) const override;

 private:
  NonlinearMode(NonlinearMode const& same, Harmonics const&);
  Method method_;
  double omega_reference_, starting_stiffness_;
  VecHandle masses_;  ///< diagonal of M
  VecHandle shape_, imaginary_;
};

/// The way to a mode with stops, at its fixed amplitude a: all gaps are wider by t a; from the mode that
/// touches nothing they close, to t = 0. A stop without gap is the same at any amplitude: a smaller one
/// changes nothing there.
class ModeStart : public NonlinearMode {
 public:
  ModeStart(model::Model const&, Harmonics const&, Method, Row row, double omega, Vec shape, Vec imaginary,
            double amplitude);
  using HarmonicProblem::keep_loads;
  VecHandle initial();
  /// Unknowns of the mode at the end of the way.
  VecHandle mode(Vec y) const;

  double parameter_value(double entry) const override { return entry; }
  double parameter_entry(double value) const override { return value; }
  std::string parameter_text(double value) const override;
  std::string impossible(Vec y) override;
  double bearable(Vec, Vec) override { return 1; }
  std::vector<solve::TestFunction> tests(Vec, Vec) override { return {}; }
  void metric(Vec y, Vec weights) override;

 private:
  ScaledMotion motion(std::vector<double> const& z) const override;
  double amplitude_;
};

/// phi^H M phi w^2 / phi^H phi: the inertia force per displacement that force rows are measured in
/// [force/length]; of a sector's mass its own part alone. `imaginary` may be null. Collective.
double reference_stiffness(model::Model const&, double omega, Vec shape, Vec imaginary = nullptr);

}  // namespace fretwave::hb
