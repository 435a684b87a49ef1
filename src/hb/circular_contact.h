#pragma once
#include "hb/continuous_force.h"
#include "hb/normal_contact.h"
#include "hb/slider_period.h"

namespace fretwave::hb {

/// Contact with friction over two tangents, a circle of radius mu N, in continuous time: components (normal,
/// two tangents). Stick, slip and lift-off change where the motion has them; over stick and contact the
/// force's harmonics are integrals in closed form, over slip those of Radau's nodes.
class CircularContact : public DisplacementForce {
 public:
  CircularContact(Harmonics const&, contact::Law const&);

  void force(double const* U, double const* V, double* F) override;
  double mean_stiffness(int pair, int component) const override;
  std::uint64_t piece(bool finely) const override;
  std::optional<std::uint64_t> piece_of(double const* U, bool finely) const override;
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
  void take(double const* U, contact::LinearPair const&, NormalContact&) const;
  void find(double const* U, Pair&);
  void take_nodes(double const* U, Pair&);
  void add_friction(Pair const&, double* F) const;
  void add_friction_blocks(Pair const&, double* D, double* by_gap) const;
  void add_standing_blocks(Pair const&, double* D, double* by_gap) const;
  void linearise() override;

  Harmonics harmonics_;
  contact::Law const& law_;
  PanelGrid grid_;
  int times_;
  std::vector<double> search_;  ///< waves at the times where the approach is looked at: times x m
  std::vector<Pair> pairs_;
};

}  // namespace fretwave::hb
