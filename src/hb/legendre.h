#pragma once
#include <utility>

namespace fretwave::hb {

/// Legendre's P_n and its derivative at x within (-1, 1), n > 0.
inline std::pair<double, double> legendre(int n, double x) {
  double before = 1, now = x;
  for (int k = 2; k <= n; ++k) {
    const double next = ((2 * k - 1) * x * now - (k - 1) * before) / k;
    before = now, now = next;
  }
  return {now, n * (x * now - before) / (x * x - 1)};
}

}  // namespace fretwave::hb
