#pragma once
#include "hb/moving_disc.h"

namespace fretwave::hb {

/// A slider w that a disc of radius R about u sweeps (Moreau): it stands (stick) but at the disc's edge where
/// that would leave it, d = u - w = R e; there w' = l e with l = u'.e - R' >= 0 (slip) and e = (cos phi, sin
/// phi) turns by
///   R phi' = u' . e', e' = (-sin phi, cos phi).
/// From e0 at a panel's begin by p = tan((phi - phi0) / 2), whose equation is a polynomial (Riccati's),
///   R p' = (1 - p^2) / 2 u'.e0' - p u'.e0,
/// collocated at Radau's nodes. When it leaves stick, and when slip ends, is found inside the panels.
class SweptSlider {
 public:
  using Instant = MovingDisc::Instant;
  /// How a piece begins: as the last one ended, at the edge; at rest, or where the period does; closing, at R
  /// = 0; behind u, where e has forgotten all before.
  enum class Start { follows, given, closes, trails };
  struct Stick {
    Start start;
    double begin, length, w[2];
  };
  struct Slip {
    Start start;
    double begin, length, e[2];  ///< e0
    Radau::Stages p;
    std::array<Instant, Radau::stages> at;
    bool onset;  ///< from stick
    std::array<double, 2> direction(int node) const { return turned(p[node]); }
    std::array<double, 2> turned(double p) const;
  };
  /// In the order of time: of `sticks` or of `slips`.
  struct Piece {
    bool slips;
    int number;
  };
  std::vector<Stick> sticks;
  std::vector<Slip> slips;
  std::vector<Piece> pieces;

  /// e in a slip at any of its times, as exact as at its end: the last node of a panel that ends there.
  static std::array<double, 2> direction(MovingDisc const&, Slip const&, double tau);
  void clear() { sticks.clear(), slips.clear(), pieces.clear(); }
  /// From w at `begin`, inside or on the edge; where it stands at `end`.
  std::array<double, 2> march(MovingDisc const&, double begin, double end, std::array<double, 2> w);
  /// From where the pair closes.
  void land(MovingDisc const&, double begin, double end);

 private:
  struct State {
    double tau;
    bool slips;
    Start start;
    double w[2], e[2];
    bool at_edge = true, onset = false;
    int chatter = 0;  ///< pieces of no length, one behind the other
  };
  std::array<double, 2> go(MovingDisc const&, double end, State);
  void stick(MovingDisc const&, double end, State&);
  void slip(MovingDisc const&, double end, State&, double& trial);
  /// Of the panel's error to what is allowed; infinite where there is no solution.
  static double collocate(MovingDisc const&, Slip&);
  static bool pushed_back(MovingDisc const&, Slip const&, double& low, double& high);
  static void stop(MovingDisc const&, Slip&, double low, double high);

  bool end_opens_ = false;
  double radius_ = 0;  ///< largest R
};

}  // namespace fretwave::hb
