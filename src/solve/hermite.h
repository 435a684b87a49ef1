#pragma once
#include "solve/vectors.h"

namespace fretwave::solve {

/// The cubic through two points of a branch with their derivatives, over s in [0, length].
class Hermite {
 public:
  /// Derivatives by s: the first is `t0`, the second `scale1 t1`. The vectors must outlive the polynomial.
  Hermite(Vec y0, Vec t0, Vec y1, Vec t1, double length, double scale1 = 1)
      : parts_{y0, t0, y1, t1}, length_(length), scale1_(scale1) {}
  VecHandle value(double s) const {
    const double x = s / length_, h = length_;
    return combine({(1 + 2 * x) * (1 - x) * (1 - x), h * x * (1 - x) * (1 - x), x * x * (3 - 2 * x),
                    h * x * x * (x - 1) * scale1_});
  }
  VecHandle derivative(double s) const {
    const double x = s / length_, h = length_;
    return combine(
        {6 * x * (x - 1) / h, (1 - x) * (1 - 3 * x), 6 * x * (1 - x) / h, x * (3 * x - 2) * scale1_});
  }

 private:
  struct Factors {
    double f[4];
  };
  VecHandle combine(Factors factors) const {
    VecHandle y = zero_like(parts_[0]);
    check(VecMAXPY(y, 4, factors.f, const_cast<Vec*>(parts_)));
    return y;
  }

  Vec parts_[4];
  double length_, scale1_;
};

}  // namespace fretwave::solve
