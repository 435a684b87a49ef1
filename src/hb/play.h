#pragma once
#include "hb/trigonometric.h"

namespace fretwave::hb {

/// A slider of one tangent in continuous time: the play operator. Where the pair is closed, w stands (stick)
/// but where one of two walls drags it (slip): the lower one, u - R, up and the upper one, u + R, down, with
/// R = (limit + mu N) / kt. Where it is open, w = u.
///
/// A wall moves w last where it turns. So w is known from the walls' turning points alone: between them
/// they are monotone, w at their end is w at their beginning, clipped, and when slip began is one root.
class Play {
 public:
  struct Walls {
    Series lower, upper, radius;  ///< u - R and u + R about the mean of u; R
    std::vector<Root> turns[2];   ///< of lower and upper, rising: a minimum
    std::vector<Root> const& of(int side) const { return turns[side > 0 ? 0 : 1]; }
    Series const& wall(int side) const { return side > 0 ? lower : upper; }
  };
  /// Stands from `begin` on. There T = share x limit; perturbed, w follows the walls at that time: dw = du -
  /// share dR, or nothing where it never left its rest.
  struct Stick {
    double begin, length, share, slider;
    bool follows;
  };
  struct Slip {
    double begin, length;
    int side;  ///< 1: w = u - R rises, T = limit; -1: the opposite
    double path;
  };
  std::vector<Stick> sticks;  ///< one after the other, a slip between two
  std::vector<Slip> slips;
  bool stuck = false;  ///< all the period: one stick

  void clear() { sticks.clear(), slips.clear(), stuck = false; }
  /// Always closed, and the slider at `rest` out of the walls' reach.
  void stand(double rest) {
    clear();
    stuck = true, sticks = {{0, period, 0, rest, false}};
  }
  /// Always closed, from a slider at `rest` (about the mean of u): the closed period that it ends in.
  void close(Walls const&, double rest);
  /// Closed in these spans.
  void close(Walls const&, std::vector<Span> const&);

 private:
  /// A wall's monotone way towards the slider.
  struct Push {
    double begin, end;
    int side;
    double from, to;  ///< the wall
  };
  /// Since when the slider stands, and where.
  struct State {
    double since, slider;
    int side;  ///< of the wall that left it there; 0: contact closed
    double share;
    bool follows;
  };
  void periodic_pushes(Walls const&, int side);
  void pushes(Walls const&, int side, Span const&, double first, double last);
  static bool drags(Push const& push, State const& now) { return push.side * (push.to - now.slider) > 0; }
  double waiting(Walls const&, Push const&, State const&) const;
  void slip(Walls const&, Push const&, State&);
  void stick(State const& now, double length) {
    if (length > 0) sticks.push_back({now.since, length, now.share, now.slider, now.follows});
  }

  std::vector<Push> pushes_;
};

}  // namespace fretwave::hb
