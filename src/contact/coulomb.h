#pragma once
#include "contact/registry.h"

namespace fretwave::contact {

/// Parameters of elastic Coulomb contact, one value per pair.
struct CoulombParameters {
  std::vector<double> normal_stiffness, tangential_stiffness, friction_coefficient, normal_load, gap;
};

/// Elastic Coulomb contact: components (normal, one tangent or two), u_n > 0 closes.
///   N = max(0, N0 + kn (u_n - gap)),  T = kt (u_t - w),  |T| <= mu N,  T = 0 and w free when open.
/// Worn depth adds to the gap. What |T| <= mu N is to two tangents, and how their sliders w move within it,
/// is each law's own: `limit`, `hold`.
class Coulomb : public Law {
 public:
  Coulomb(CoulombParameters, int tangents);
  int components() const override { return 1 + tangents_; }
  int pairs() const override { return int(p_.gap.size()); }
  bool uses_velocity() const override { return false; }
  bool hereditary() const override { return true; }
  std::vector<double> sliders() const override { return slider_; }
  bool wears() const override { return true; }
  int normal() const override { return 0; }
  Limit limit() const override = 0;
  double stuck_stiffness(int component, int pair) const override;
  LinearPair linear_pair(int pair) const override;
  void diagnose(Motion const&, double const* f, Diagnosis&) const override;

 protected:
  /// One step to u: the sliders of a pair to where they are no farther from it than R = mu N / kt, by exactly
  /// nothing where they stick.
  virtual void hold(int pair, double const* u, double R) = 0;
  void set_rest(double const* u) override;
  void set_sliders(std::vector<double> const& sliders) override { slider_ = sliders; }
  void set_wear(double const* depth) override;
  void set_stand_off(double distance) override;

  std::vector<double> slider_;  ///< w at rest, tangents x pairs

 private:
  int tangents_;
  CoulombParameters p_;                ///< their gap with wear and stand-off
  std::vector<double> closed_;         ///< 1 where closed at rest
  std::vector<double> unworn_, worn_;  ///< gap without wear, and with it [length]
};

/// A law of these parameters by its name.
Entry coulomb_entry(std::string name, std::string doc, int components,
                    std::function<std::unique_ptr<Law>(CoulombParameters)> make);

}  // namespace fretwave::contact
