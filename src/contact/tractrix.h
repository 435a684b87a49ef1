#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

#include "contact/vectorise.h"

namespace fretwave::contact {

/// The slip of one step: the unit vector m from slider to contact at its end, and its derivative: with the
/// arm d0 = u0 - w0 at the step's start, the way v = u1 - u0, what the next way gains on it (a) and R0, R1,
///   d(R1 m) = m dR1 + m' (A dd0 + B dv + G da + r0 dR0 + r1 dR1),  m' = (-m2, m1).
struct Slip {
  double m1, m2, A1, A2, B1, B2, G1, G2, r0, r1;
};

/// A slider w is pulled by the contact u on an arm d = u - w of at most R. Moreau's sweeping process: w' = l
/// n with n = d / |d| and l >= 0, and l = 0 where |d| < R. In a step u goes straight by v while R grows
/// linearly; |d0 + s v| - R(s) is convex, so the slider stays until that is zero and is then pulled to the
/// step's end, along a tractrix. With the angle phi from v to n: R phi' = - |v| sin phi whatever R' is, so
///   tan(phi/2) falls by e^-x,  x = |v| int ds / R.
/// As a map of n (no angles, smooth where v = 0): with Y = v/|v| sinh x and C = cosh x,
///   m = (n + Y (1 + n.Y / (1 + C))) / (C + n.Y).
/// R is replaced by its mean over the slip (third order in a step) and sinh by three terms of its series; C
/// = sqrt(1 + Y^2) keeps |m| = 1. For large x the slider trails straight behind.
///
/// A path that bends is no polygon: pulled along chords in steps of angle h the slider trails at h/2
/// coth(x/2) behind the path's direction instead of at h/x, which is of first order where x is large (a stiff
/// contact in gross slip). So v is turned by coth(x/2)/2 - 1/x, here x / (2 (3 + sqrt(9 + x^2))), of the
/// angle to the next chord, which is v x a / v^2. `landing` 1: R0 = 0 where u meets its slider, so m is v's
/// direction at once; else 0.
FRETWAVE_INLINE Slip slip(double d1, double d2, double v1, double v2, double a1, double a2, double R0,
                          double R1, double landing) {
  constexpr double tiny = std::numeric_limits<double>::min();
  const double rise = R1 - R0, way = std::abs(v1) + std::abs(v2) + std::abs(a1) + std::abs(a2);
  // |d0 + s v|^2 - R(s)^2 = a s^2 + 2 b s + c
  const double c = d1 * d1 + d2 * d2 - R0 * R0, b = d1 * v1 + d2 * v2 - R0 * rise;
  const double v = v1 * v1 + v2 * v2, a = v - rise * rise, square = b * b - a * c;
  const double root = std::sqrt(square > 0 ? square : 0.0);
  const double at = (b > 0 ? -c : root - b) / ((b > 0 ? b + root : a) + tiny);
  const double s = std::max(landing, std::min(at, 1.0));
  const double k1 = d1 + s * v1, k2 = d2 + s * v2, r = std::sqrt(k1 * k1 + k2 * k2);
  const double sum = std::max(R1 + r, 1e-12 * way + tiny), inverse = 1 / (r * sum + tiny);
  const double per_r = sum * inverse, per_sum = r * inverse;
  const double n1 = k1 * per_r, n2 = k2 * per_r, q = 2 * (1 - s) * per_sum;

  const double speed = std::max(std::sqrt(v), 1e-150), wide = std::sqrt(9 + q * q * v),
               sum_wide = speed * (3 + wide);
  const double per_v = 1 / (sum_wide * wide), per_N = 0.5 * q * wide * per_v, g = per_N * (v1 * a2 - v2 * a1);
  const double X1 = q * (v1 - g * v2), X2 = q * (v2 + g * v1), x2 = X1 * X1 + X2 * X2;
  const double series = 1 + x2 * (1.0 / 6 + x2 / 120);
  const double Y1 = series * X1, Y2 = series * X2, C = std::sqrt(1 + Y1 * Y1 + Y2 * Y2);
  const double p = n1 * Y1 + n2 * Y2, all = 1 / (C * (1 + C) * (C + p));
  const double turn = C * (1 + C) * all, half = (C + p) * all;  // 1 / (C + p), 1 / (C (1 + C))
  const double share = (1 + p * C * half) * turn;
  Slip out{n1 * turn + Y1 * share, n2 * turn + Y2 * share, 0, 0, 0, 0, 0, 0, 0, 0};

  // m' . dm = turn n' . dn + zeta . dY, n' = (-n2, n1); of the slip's beginning s almost nothing is seen,
  // for the angle's law is the same before and after: what the mean of R makes of it is `odd`
  const double across = n2 * Y1 - n1 * Y2;
  const double z1 = turn * (-n2 + half * (across * Y1 - C * Y2));
  const double z2 = turn * (n1 + half * (across * Y2 + C * Y1));
  const double bend = 2 * (1.0 / 6 + x2 / 60) * (z1 * X1 + z2 * X2);
  const double xi1 = series * z1 + bend * X1, xi2 = series * z2 + bend * X2;
  const double aside = xi2 * v1 - xi1 * v2, less = 3 * sum_wide * per_v;  // 3 / wide
  const double along = xi1 * v1 + xi2 * v2 + g * (1 + less) * aside;
  const double stretch = g * (2 - less) * aside / (speed * speed), bent = per_N * aside;
  const double odd = turn * (n1 * v2 - n2 * v1) * per_r - along * (2 + q * rise) * per_sum;
  const double pulled = std::max(root * per_r, 1e-10 * way + tiny);  // d(|d| - R)/ds at s
  const double moved = (1 - landing) * odd / pulled, mean = along * q * per_sum;
  out.A1 = R1 * (-turn * n2 * per_r - moved * n1), out.A2 = R1 * (turn * n1 * per_r - moved * n2);
  out.B1 = s * out.A1 + R1 * q * (xi1 + g * xi2 - stretch * v1 + bent * a2);
  out.B2 = s * out.A2 + R1 * q * (xi2 - g * xi1 - stretch * v2 - bent * a1);
  out.G1 = -R1 * q * bent * v2, out.G2 = R1 * q * bent * v1;
  out.r0 = R1 * (1 - s) * (moved - mean), out.r1 = R1 * (s * moved - (1 + s) * mean);
  return out;
}

}  // namespace fretwave::contact
