#include "hb/radau.h"

#include <cmath>
#include <numbers>

#include "hb/legendre.h"

namespace fretwave::hb {

namespace {

constexpr int s = Radau::stages;

}  // namespace

/// Nodes are the zeros of P_s - P_{s-1} of 2 c - 1, in which 1 is one.
Radau::Radau() {
  constexpr int most = 40;
  for (int j = 0; j < s; ++j) {
    double x = -std::cos(std::numbers::pi * (2 * j + 1.0) / (2 * s - 1));
    for (int k = 0; k < most && j + 1 < s; ++k) {
      const auto [p, dp] = legendre(s, x);
      const auto [q, dq] = legendre(s - 1, x);
      x -= (p - q) / (dp - dq);
    }
    if (j + 1 == s) x = 1;
    const double value = x < 1 ? legendre(s - 1, x).first : 1;
    nodes[j] = (1 + x) / 2, weights[j] = (1 + x) / (2.0 * s * s * value * value);
  }
  double leading = 1;  // of P_s(2 c - 1): binomial(2 s, s)
  for (int k = 1; k <= s; ++k) leading *= double(s + k) / k;
  // Lagrange's polynomials on 0 and the nodes
  for (int i = 0; i < s; ++i) {
    double product = nodes[i], diagonal = 1 / nodes[i];
    for (int k = 0; k < s; ++k)
      if (k != i) product *= nodes[i] - nodes[k], diagonal += 1 / (nodes[i] - nodes[k]);
    last[i] = 1 / (product * leading);
    for (int j = 0; j < s; ++j) {
      double others = nodes[j];
      for (int k = 0; k < s; ++k) others *= k != i && k != j ? nodes[j] - nodes[k] : 1;
      derivative[j][i] = i == j ? diagonal : others / product;
    }
  }
  // what is left without the last is of an order that the weights integrate with P_{s-1} exactly
  for (int i = 0; i < s; ++i) {
    last_but_one[i] = 0;
    for (int j = 0; j < s; ++j) {
      const double x = 2 * nodes[j] - 1, now = x < 1 ? legendre(s, x).first : 1;
      const double before = x < 1 ? legendre(s - 1, x).first : 1;
      last_but_one[i] += (2 * s - 1) * weights[j] * before * ((i == j) - now * last[i]);
    }
  }
}

double Radau::at(Stages const& p, double x) const {
  double sum = 0;
  for (int i = 0; i < s; ++i) {
    double term = p[i] * x / nodes[i];
    for (int k = 0; k < s; ++k)
      if (k != i) term *= (x - nodes[k]) / (nodes[i] - nodes[k]);
    sum += term;
  }
  return sum;
}

Radau const& radau() {
  static const Radau method;
  return method;
}

}  // namespace fretwave::hb
