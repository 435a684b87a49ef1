#pragma once
#include "contact/coulomb_march.h"
#include "contact/registry.h"

namespace fretwave::contact {

/// Parameters of the 3-D law, one value per pair.
struct Coulomb3dParameters {
  std::vector<double> normal_stiffness, tangential_stiffness, friction_coefficient, normal_load, gap;
};

/// Elastic Coulomb contact in three dimensions: components (normal, tangent, tangent), u_n > 0 closes.
///   N = max(0, N0 + kn (u_n - gap)),  T = kt (u_t - w),  |T| <= mu N,  T = w' free when open.
/// Worn depth adds to the gap.
/// Circular slip limit over both tangents, or each tangent limited by itself (Coupled = false), as some other
/// codes do.
template <bool Coupled>
class Coulomb3d : public Law {
 public:
  explicit Coulomb3d(Coulomb3dParameters);
  int components() const override { return 3; }
  int pairs() const override { return int(p_.gap.size()); }
  bool uses_velocity() const override { return false; }
  bool hereditary() const override { return true; }
  std::vector<double> sliders() const override { return slider_; }
  bool wears() const override { return true; }
  int normal() const override { return 0; }
  Limit limit() const override { return Coupled ? Limit::circle : Limit::each; }
  double stuck_stiffness(int component, int pair) const override;
  bool piecewise_linear() const override { return !Coupled; }
  LinearPair linear_pair(int pair) const override;
  void force(Motion const&, double* f, Record&) const override;
  void product(Motion const&, Record const&, double const* du, double const* dv, double* df) const override;
  void pair_product(Motion const&, Record const&, int pair, int columns, double const* du,
                    double* df) const override;
  void diagnose(Motion const&, double const* f, Diagnosis&) const override;
  std::uint64_t piece(Motion const&, Record const&) const override;

 protected:
  void set_rest(double const* u) override;
  void set_sliders(std::vector<double> const& sliders) override { slider_ = sliders; }
  void set_wear(double const* depth) override;
  void set_stand_off(double distance) override;

 private:
  PairConstants constants(int first) const;
  double flight(int pair, double before, double now) const;
  void last_slip(Motion const&, Record&) const;
  void close(Motion const&, std::vector<double> const& rest, std::vector<double> const& left, double const* f,
             std::vector<double>& w, Record&) const;
  void linearised(Motion const&, Record const&, int pair, int n, double const* du, double* df) const;

  Coulomb3dParameters p_;
  std::vector<double> unworn_, worn_;    ///< gap without wear, and with it [m]; p_.gap has the stand-off too
  std::vector<double> reach_;            ///< mu / kt [m/N]
  std::vector<double> slider_, closed_;  ///< at rest: w (2 x pairs), 1 where closed
};

Entry coulomb_3d_entry();
Entry coulomb_3d_uncoupled_entry();

}  // namespace fretwave::contact
