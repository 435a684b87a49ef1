#pragma once
#include <array>

namespace fretwave::hb {

/// Radau IIA, a collocation at `stages` nodes of [0, 1] with the last at 1: order 2 stages - 1, stable
/// however stiff the equation is (Hairer and Wanner, Solving ODEs II, IV.5).
struct Radau {
  static constexpr int stages = 7;
  using Stages = std::array<double, stages>;
  Stages nodes, weights;
  std::array<Stages, stages> derivative;  ///< p'(c_j) of the polynomial with p(0) = 0 by its p(c_i)
  /// Its coefficients of the Legendre polynomials of orders stages - 1 and stages: how far its series falls.
  Stages last_but_one, last;

  /// That polynomial at x in [0, 1].
  double at(Stages const& p, double x) const;

 private:
  friend Radau const& radau();
  Radau();
};

Radau const& radau();

}  // namespace fretwave::hb
