#pragma once
#include <algorithm>
#include <array>
#include <cmath>

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

/// Solves A X = B in place of the rows of B (stages x columns), by Gauss elimination; false if A is singular.
inline bool solve_stages(std::array<Radau::Stages, Radau::stages>& A, double* B, int columns = 1) {
  constexpr int n = Radau::stages;
  const auto row = [&](int i) { return B + size_t(i) * columns; };
  const auto subtract = [&](double factor, double const* from, double* to) {
    for (int c = 0; c < columns; ++c) to[c] -= factor * from[c];
  };
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(A[i][k]) > std::abs(A[best][k])) best = i;
    if (A[best][k] == 0) return false;
    if (best != k) std::swap(A[k], A[best]), std::swap_ranges(row(k), row(k) + columns, row(best));
    for (int i = k + 1; i < n; ++i) {
      const double factor = A[i][k] / A[k][k];
      for (int j = k + 1; j < n; ++j) A[i][j] -= factor * A[k][j];
      subtract(factor, row(k), row(i));
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    for (int j = k + 1; j < n; ++j) subtract(A[k][j], row(j), row(k));
    for (int c = 0; c < columns; ++c) row(k)[c] /= A[k][k];
  }
  return true;
}

}  // namespace fretwave::hb
