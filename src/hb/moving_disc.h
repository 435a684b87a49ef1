#pragma once
#include "hb/radau.h"
#include "hb/trigonometric.h"

namespace fretwave::hb {

/// The period cut into panels of Radau's nodes, with cosines and sines there.
class PanelGrid {
 public:
  explicit PanelGrid(Harmonics const&);
  int panels() const { return panels_; }
  int nodes() const { return panels_ * Radau::stages; }
  double length() const { return length_; }
  /// Of a node, which may lie in another period.
  double time(int node) const;
  /// First node of a slider's panel that is one of the grid's but for rounding, else -1.
  int first_node(double begin, double length) const;
  /// nodes x block size: 1, cos n tau, sin n tau, and their rates.
  std::vector<double> const& waves() const { return waves_; }
  std::vector<double> const& rates() const { return rates_; }

 private:
  int panels_;
  double length_;
  std::vector<double> waves_, rates_;
};

/// The disc of a pair's slider: its centre u, about its mean, and radius R = mu N / kt move with tau.
struct MovingDisc {
  struct Instant {
    double u[2], v[2], R, dR;  ///< v, dR: rates
  };
  /// |u - w|^2 - R^2 and its first two derivatives: the slider w is dragged where it would be positive.
  struct Excess {
    double tau, value, rate, bend;
  };
  Series u[2], radius;
  PanelGrid const* grid = nullptr;
  std::vector<Instant> at_nodes;

  /// u and R with their first two rates.
  std::array<Series::Jet, 3> jets(double tau) const { return hb::jets<3>({&u[0], &u[1], &radius}, tau); }
  Instant at(double tau) const;
  Instant const& node(int k) const { return at_nodes[size_t(k) % at_nodes.size()]; }
  Excess excess(double tau, double const* w) const;
  static Excess excess(double tau, Instant const&, double const* w);
  /// Of all times the one at which the slider is farthest outside.
  Excess farthest(double const* w) const;
  /// When a slider that stands from `begin` on comes to the edge; `end` if it does not. It began inside or
  /// `at_edge`, which it does not leave at once.
  double exit(double begin, double end, double const* w, bool at_edge) const;
  /// Largest |u| + R at the nodes.
  double size() const;

 private:
  static double room(Excess const& before, Excess const& after);
  Excess highest(Excess const& before, Excess const& after, double const* w) const;
};

}  // namespace fretwave::hb
