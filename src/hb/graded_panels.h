#pragma once
#include <array>

#include "hb/trigonometric.h"

namespace fretwave::hb {

/// A series seen from a time T: p(T + s) = p(T) + Re sum_k P_k (e^{i k s} - 1), P_k = p_k e^{i k T}. However
/// short s is, the difference keeps all its digits, which those of T + s are no part of.
struct SeriesFrom {
  SeriesFrom(Series const&, double at, double value);
  Series::Jet jet(double s) const;

  double at, value;
  std::vector<double> re, im;  ///< of P_k
};

/// An arc of the period from T + begin on, over which a function of v is taken at nodes: Gauss's, or evenly
/// spaced ones where all the period is divided so; or at none, where it has its value of large v (side 1) or
/// of large -v (-1).
struct Panel {
  static constexpr int nodes = 16;
  using Values = std::array<double, nodes>;

  double middle, half;  ///< of s
  int side = 0;
  bool even = false;
  /// e^{i s} - 1 at the nodes.
  struct Waves {
    Values x, y;
  };
  Waves waves() const;
  /// Of the series.
  void at_nodes(SeriesFrom const&, Waves const&, Values&) const;
  double integral(Values const&) const;
  /// sum += of e^{i k s} times what has these values at the nodes, k = 0 .. the last of sum.
  void add_integral(Waves const&, Values const&, std::vector<complex>& sum) const;
};

/// Divides the period such that a function f(v) of a series v has its integrals with e^{i k tau} from the
/// panels' nodes, to near rounding: f is analytic but beyond v = +-i width, and constant beyond |v| = end.
///
/// Gauss's quadrature with n nodes errs by rho^{-2n} where the integrand is analytic within the ellipse
/// around the panel whose half axes add up to rho of its half length h. The ellipse lies in the disc of
/// radius r = (rho + 1 / rho) / 2 h about the panel's middle c. f is analytic there if v does not come to its
/// singularities,
///   |v(c + z) - v(c)| <= |v'| r + |v''| r^2 / 2 + sum_k |v_k| (e^{k r} - 1 - k r - (k r)^2 / 2) <= |v(c) -+
///   i width|,
/// so that the panels grow with the distance from a layer that v crosses or touches. Where layers are wide
/// beside v, evenly spaced times are fewer: N of them err by e^{-(N - k) d} in the k-th harmonic where f is
/// analytic for |Im tau| < d, that is where sum_k |v_k| sinh(k d) < width.
class Grading {
 public:
  explicit Grading(int highest);
  void set(Series const&, double width, double end);
  /// Number of even panels that the whole period needs, itself even; 0: graded ones are better.
  int even() const;
  /// Panels from s = 0 to s = length, of either sign.
  void divide(SeriesFrom const&, double length, std::vector<Panel>& out) const;

 private:
  double remainder(double r) const;
  double guess(Series::Jet const&, double direction) const;
  double constant(Series::Jet const&, double direction, double rest) const;
  bool smooth(Series::Jet const&, double half) const;

  static constexpr int radii = 6;
  double longest_;                       ///< half length
  std::vector<int> counts_;              ///< of even panels
  std::vector<double> thirds_, strips_;  ///< e^{k r} - 1 - ..., radii x orders; sinh(k d), counts x orders
  double width_ = 0, end_ = 0;
  std::vector<double> sizes_;             ///< |v_k|
  double third_ = 0;                      ///< sum_k k^3 |v_k|
  std::array<double, radii> remainders_;  ///< at r = largest, and halves of it
};

}  // namespace fretwave::hb
