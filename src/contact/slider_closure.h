#pragma once
#include "contact/law.h"

namespace fretwave::contact {

/// Pairs of `coulomb_3d` whose sliders leave their rest position and never open, pairs innermost.
///
/// One period is a map P of the slider: it is swept by a convex disc, so P never takes two sliders apart, and
/// it starts inside the disc of the last sample. A slider inside the discs of two samples is inside all
/// between them, for |u - w| - R is convex on a step. Its fixed points are either the common points of all
/// discs (a convex set: shakedown, nothing slips) or a single cycle that slips, for discs are strictly
/// convex. Of the common points the one nearest to rest is taken, which is what two periods give on a
/// straight path and does not ask where the period begins.
class SliderClosure {
 public:
  SliderClosure(int samples, int pairs);

  /// Disc of a pair at a sample: centre u, radius R.
  double* disc(int sample) { return discs_.data() + size_t(3) * sample * pairs_; }
  /// Per pair: slider at rest and after one period from there, dR/du_n; 2 x pairs each, and pairs.
  std::vector<double> rest, first, slope;

  /// Periodic sliders into `w` (2 x pairs) and how they follow the motion. Once: the discs are used up.
  void close(std::vector<double>& w, std::vector<SliderStart>& starts);

 private:
  struct Point {
    double x, y;
  };
  struct Disc {
    Point centre;
    double radius;
    int sample;
  };
  /// Shakedown of a pair: nearest point to rest inside the discs met so far, on one or two of them.
  struct Nearest {
    Point at;
    std::vector<Disc> active;
    bool searching = true, empty = false;
  };
  Disc disc(int sample, int pair) const;
  double touches(Disc const&, int pair) const;
  void shake_down(std::vector<double>& w, std::vector<SliderStart>& starts);
  bool enter(Nearest&, Disc const&, int pair) const;
  SliderStart follow(Nearest const&, int pair) const;
  static void keep(std::vector<int> const& lanes, int n, std::vector<double>& rows);
  void cycle(std::vector<double>& w, std::vector<SliderStart>& starts);

  int samples_, pairs_;
  std::vector<double> discs_;
  std::vector<double> size_;  ///< of the motion, as `extent` gives it
  std::vector<char> cycles_;
};

}  // namespace fretwave::contact
