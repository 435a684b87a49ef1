#pragma once
#include "hb/continuous_force.h"
#include "hb/normal_contact.h"
#include "hb/slider_period.h"

namespace fretwave::hb {

/// Contact with friction over two tangents, a circle of radius mu N, in continuous time: components (normal,
/// two tangents). Stick, slip and lift-off change where the motion has them; over stick and contact the
/// force's harmonics are integrals in closed form, over slip those of Radau's nodes.
class CircularContact : public ContinuousForce {
 public:
  CircularContact(Harmonics const&, contact::Law const&);

  void force(double const* U, double const* V, double* F) override;
  void blocks(Exponents const&, double* D) override;
  void product(double const* dU, double const* dV, double* dF) override;
  void gap_product(double const* dgap, double* dF) override;
  double mean_stiffness(int pair, int component) const override;
  std::uint64_t piece() const override;
  void sample(int samples, double const* u, double const* v, double* f) const override;
  void measure(contact::Diagnosis&, double omega) const override;
  double unclosed() const override;

 private:
  struct Pair {
    contact::LinearPair law;
    NormalContact normal;
    double mean[2] = {0, 0};  ///< of the tangents
    MovingDisc disc;
    SliderPeriod slider;
  };
  size_t size() const { return 3 * size_t(harmonics_.block_size()); }
  void take(double const* U, Pair&);
  void find(double const* U, Pair&);
  void take_nodes(double const* U, Pair&);
  void add_friction(Pair const&, double* F) const;
  void add_friction_blocks(Pair const&, double* D, double* by_gap) const;
  void add_standing_blocks(Pair const&, double* D, double* by_gap) const;
  void linearise();

  Harmonics harmonics_;
  contact::Law const& law_;
  PanelGrid grid_;
  std::vector<double> search_;  ///< waves at the times where the approach is looked at: times x m
  int times_;
  std::vector<Pair> pairs_;
  std::vector<double> D_, by_gap_;
  bool linearised_ = false;
};

}  // namespace fretwave::hb
