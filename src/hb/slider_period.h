#pragma once
#include "hb/swept_slider.h"

namespace fretwave::hb {

/// A slider over one period, closed. Where the pair opens each contact begins anew. Else the period is a map
/// P of the slider that never takes two apart, for a convex disc sweeps it. Its fixed points are the common
/// points of all discs (a convex set: shakedown, nothing slips), of which the one nearest to rest is taken:
/// it does not ask where the period begins; or, if there are none, one cycle that slips (discs are strictly
/// convex).
class SliderPeriod {
 public:
  enum class Kind { loose, rests, shaken, cycles, opens };
  Kind kind = Kind::loose;
  SweptSlider path;
  double w[2] = {0, 0};  ///< where it stands all the period, or as the period begins
  double unclosed = 0;   ///< |P(w) - w|
  /// How a shaken w follows (R, u) at the times when `touching` discs hold it, where that is one also their
  /// rates.
  int touching = 0;
  double times[2] = {0, 0}, gain[2][2][3] = {}, gain_of_rates[2][3] = {};

  /// (1 - A)^-1 of A = dP/dw: how a cycle's slider follows what the period makes of one that does not.
  static void invert(double const (&A)[2][2], double (&inverse)[2][2]);

  void clear();
  /// Does not move all the period.
  bool stands() const { return kind == Kind::rests || kind == Kind::shaken; }
  void rest_at(double const* rest) { kind = Kind::rests, w[0] = rest[0], w[1] = rest[1]; }
  /// Always closed, with a slider that rests at `rest`.
  void close(MovingDisc const&, std::array<double, 2> rest);
  /// Closed in these spans.
  void close(MovingDisc const&, std::vector<Span> const&);

 private:
  struct Held {
    double tau, u[2], R;
  };
  bool shake_down(MovingDisc const&, double const* rest, double size);
  bool enter(Held const&, double const* rest, double size);
  void follow(MovingDisc const&, double const* rest);
  void follow_one(MovingDisc const&, double const* rest);
  void cycle(MovingDisc const&, double const* rest, double size);

  std::vector<Held> held_;
};

}  // namespace fretwave::hb
