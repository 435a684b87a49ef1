#pragma once
#include "hb/trigonometric.h"

namespace fretwave::hb {

/// A function of time that is constant in pieces, by G_p = (1 / 2 pi) int g e^{-i p tau}, p = 0 .. 2H: what
/// force, tangent and mean of a piecewise linear contact are made of.
class Indicator {
 public:
  explicit Indicator(Harmonics const& h) : harmonics_(h), G_(2 * h.highest() + 1) {}
  /// 1 at all times.
  void fill() { G_[0] += 1; }
  /// `weight` over an arc.
  void add(Arc const& arc, double weight);
  /// What is not constant, by its G_p itself.
  void add(std::vector<complex> const& G) {
    for (size_t p = 0; p < G_.size(); ++p) G_[p] += G[p];
  }
  complex operator()(int p) const { return p < 0 ? std::conj(G_[-p]) : G_[p]; }

  /// F += weight x the coefficients (orders > 0) of f with f' = g p': a continuous force of which p moves a
  /// share.
  void add_force(Series const& p, double weight, double* F) const;
  /// The same of f = g p, which must be continuous too: where p is zero at the ends of a short piece, what
  /// rounding leaves of p there counts no more than the piece is long.
  void add_product(Series const& p, double weight, double* F) const;
  /// D += weight x the matrix that takes the coefficients of x to those of g x; rows of length ld.
  void add_multiplication(double weight, double* D, size_t ld) const;
  /// Coefficients of g.
  void add_coefficients(double weight, double* F) const;

 private:
  /// sum_k G_{n-k} x_k + G_{n+k} conj(x_k), k > 0
  std::vector<complex> times(std::vector<complex> const& x) const;

  Harmonics const& harmonics_;
  std::vector<complex> G_;
};

}  // namespace fretwave::hb
