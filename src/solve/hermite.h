#pragma once
#include <cmath>
#include <utility>
#include <vector>

#include "solve/vectors.h"

namespace fretwave::solve {

/// The polynomial through points of a branch with their derivatives, of degree 2 n - 1 through n points: the
/// cubic through the ends of a step over s in [0, length], to which points inside it can be added (Hermite's
/// form of Lagrange's polynomials: l_i^2 (1 - 2 l_i'(s_i) (s - s_i)) and l_i^2 (s - s_i)).
class Hermite {
 public:
  /// Derivatives by s: the first is `t0`, the second `scale1 t1`. The vectors must outlive the polynomial.
  Hermite(Vec y0, Vec t0, Vec y1, Vec t1, double length, double scale1 = 1)
      : knots_{{0, y0, t0, 1}, {length, y1, t1, scale1}} {}
  /// A point, whose derivative is `scale` times `t`.
  struct Knot {
    double at;
    Vec y, t;
    double scale;
  };
  /// In place of another as good as at the same place: two would be one counted twice.
  Hermite with(Knot knot) const {
    Hermite out = *this;
    const double same = 1e-9 * std::abs(knots_[1].at - knots_[0].at);
    for (Knot& other : out.knots_)
      if (std::abs(other.at - knot.at) <= same) {
        other = knot;
        return out;
      }
    out.knots_.push_back(knot);
    return out;
  }
  /// The cubic through the last point up to `a` and the first one from `b` on.
  Hermite between(double a, double b) const {
    Knot low = knots_[0], high = knots_[1];
    for (Knot const& knot : knots_) {
      if (knot.at <= a && knot.at > low.at) low = knot;
      if (knot.at >= b && knot.at < high.at) high = knot;
    }
    return Hermite({low, high});
  }
  VecHandle value(double s) const {
    return combine(
        [&](Knot const& knot, Lagrange const& l) {
          const double square = l.value * l.value;
          return Share{square * (1 - 2 * l.own_slope * (s - knot.at)), square * (s - knot.at)};
        },
        s);
  }
  VecHandle derivative(double s) const {
    return combine(
        [&](Knot const& knot, Lagrange const& l) {
          const double square = l.value * l.value, twice = 2 * l.value * l.slope, off = s - knot.at;
          return Share{twice * (1 - 2 * l.own_slope * off) - 2 * l.own_slope * square, twice * off + square};
        },
        s);
  }

 private:
  explicit Hermite(std::vector<Knot> knots) : knots_(std::move(knots)) {}
  /// l_i and its derivative at s, and the latter at its own knot.
  struct Lagrange {
    double value = 1, slope = 0, own_slope = 0;
  };
  /// Of a knot's point and of its derivative.
  struct Share {
    double y, t;
  };
  Lagrange lagrange(Knot const& own, double s) const {
    Lagrange l;
    for (Knot const& other : knots_) {
      if (other.at == own.at) continue;
      const double between = own.at - other.at;
      l.slope = (l.slope * (s - other.at) + l.value) / between;
      l.value *= (s - other.at) / between;
      l.own_slope += 1 / between;
    }
    return l;
  }
  template <class Of>
  VecHandle combine(Of share, double s) const {
    VecHandle out = zero_like(knots_[0].y);
    for (Knot const& knot : knots_) {
      const Share of = share(knot, lagrange(knot, s));
      const double factors[] = {of.y, of.t * knot.scale};
      Vec parts[] = {knot.y, knot.t};
      check(VecMAXPY(out, 2, factors, parts));
    }
    return out;
  }

  std::vector<Knot> knots_;
};

}  // namespace fretwave::solve
