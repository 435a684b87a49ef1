#include "contact/coulomb_march.h"

#include <cmath>
#include <limits>

#include "contact/coulomb.h"
#include "contact/tractrix.h"
#include "contact/vectorise.h"

namespace fretwave::contact {

namespace {

/// Pulls w onto the disc of radius R about u.
FRETWAVE_INLINE void pull_in(double u1, double u2, double R, double& w1, double& w2) {
  const double d1 = u1 - w1, d2 = u2 - w2, size2 = d1 * d1 + d2 * d2;
  const double s = size2 <= R * R ? 1.0 : R / std::sqrt(size2);
  w1 += d1 - s * d1, w2 += d2 - s * d2;
}

/// What a linearised step gives: the arm u - w, which is the tangential force / kt, and 1 where closed.
struct Arm {
  double y1, y2, closed;
};

FRETWAVE_INLINE Arm linear_step(double const* r, int pairs, int k, double reach, double kn, double dn0,
                                double dn1, double d1, double d2, double v1, double v2, double a1,
                                double a2) {
  const double s = r[k], m1 = r[pairs + k], m2 = r[2 * pairs + k], kept = s > 0 ? s : 0.0;
  const double across = r[3 * pairs + k] * d1 + r[4 * pairs + k] * d2 + r[5 * pairs + k] * v1 +
                        r[6 * pairs + k] * v2 + r[7 * pairs + k] * a1 + r[8 * pairs + k] * a2 +
                        r[9 * pairs + k] * dn0 + r[10 * pairs + k] * dn1;
  const double along = s == 0 ? reach * kn * dn1 : 0.0;
  return {kept * (d1 + v1) + m1 * along - m2 * across, kept * (d2 + v2) + m2 * along + m1 * across,
          s < 0 ? 0.0 : 1.0};
}

template <bool OnePair, bool Force>
FRETWAVE_INLINE void linear_loop(PairConstants const& p, int samples, int pairs, int pair, int n,
                                 double const* record, double const* du, double* dw, double* df) {
  double const *kn = p.kn, *kt = p.kt, *reach = p.reach, *before = du + size_t(samples - 1) * 3 * n,
               *first = du;
  for (int t = 0; t < samples;
       ++t, before = du, du += 3 * n, df += Force ? 3 * n : 0, record += record_arrays * pairs) {
    double const* next = t + 1 < samples ? du + 3 * n : first;
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const int k = OnePair ? pair : i;
      const double x1 = du[n + i] - dw[i], x2 = du[2 * n + i] - dw[n + i];
      const double v1 = du[n + i] - before[n + i], v2 = du[2 * n + i] - before[2 * n + i];
      const Arm to = linear_step(record, pairs, k, reach[k], kn[k], before[i], du[i], before[n + i] - dw[i],
                                 before[2 * n + i] - dw[n + i], v1, v2, next[n + i] - du[n + i] - v1,
                                 next[2 * n + i] - du[2 * n + i] - v2);
      dw[i] += x1 - to.y1, dw[n + i] += x2 - to.y2;
      if constexpr (Force)
        df[i] = to.closed * kn[k] * du[i], df[n + i] = kt[k] * to.y1, df[2 * n + i] = kt[k] * to.y2;
    }
  }
}

}  // namespace

FRETWAVE_VECTORISE void march(PairConstants const& p, int samples, int n, double const* u, double* w,
                              double* f, double* record) {
  double const *kn = p.kn, *kt = p.kt, *reach = p.reach, *load = p.load, *gap = p.gap;
  double const *before = u + size_t(samples - 1) * 3 * n, *first = u;
  constexpr double tiny = std::numeric_limits<double>::min();
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const double elastic = load[i] + kn[i] * (before[i] - gap[i]);
    pull_in(before[n + i], before[2 * n + i], elastic > 0 ? reach[i] * elastic : 0.0, w[i], w[n + i]);
  }
  for (int t = 0; t < samples; ++t, before = u, u += 3 * n, f += 3 * n, record += record_arrays * n) {
    double const* next = t + 1 < samples ? u + 3 * n : first;
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double was = load[i] + kn[i] * (before[i] - gap[i]), is = load[i] + kn[i] * (u[i] - gap[i]);
      const double u1 = u[n + i], u2 = u[2 * n + i], w1 = w[i], w2 = w[n + i];
      const double all1 = u1 - before[n + i], all2 = u2 - before[2 * n + i];
      const double gain1 = (next[n + i] - u1) - all1, gain2 = (next[2 * n + i] - u2) - all2;
      const double arm1 = before[n + i] - w1, arm2 = before[2 * n + i] - w2;
      // of the step its closed part; what was open has its slider at u
      const bool open = is <= 0, lands = (was <= 0) & !open;
      const double normal = open ? 0.0 : is, below = was < 0 ? was : 0.0;
      const double landing = lands ? 1.0 : 0.0, held = 1 - landing, per_rise = 1 / (normal - below + tiny);
      const double share = held + landing * (normal * per_rise);
      const double R0 = reach[i] * (was > 0 ? was : 0.0), R1 = reach[i] * normal;
      const double v1 = share * all1, v2 = share * all2, far1 = u1 - w1, far2 = u2 - w2;
      const double d1 = lands ? v1 : far1, d2 = lands ? v2 : far2;
      const bool stick = (d1 * d1 + d2 * d2 <= R1 * R1) & (R1 > 0), still = stick & !lands;
      const Slip to = slip(held * arm1, held * arm2, v1, v2, gain1, gain2, R0, R1, landing);
      const double slid1 = R1 * to.m1, slid2 = R1 * to.m2;
      const double kept1 = open ? 0.0 : stick ? d1 : slid1, kept2 = open ? 0.0 : stick ? d2 : slid2;
      const double moved1 = u1 - kept1, moved2 = u2 - kept2;
      w[i] = still ? w1 : moved1, w[n + i] = still ? w2 : moved2;
      f[i] = normal, f[n + i] = kt[i] * kept1, f[2 * n + i] = kt[i] * kept2;

      const bool rests = open | stick, touches = stick & lands;  // d = share (u - u') there
      const double slope = rests ? 0.0 : reach[i] * kn[i], rate = touches ? kn[i] * per_rise : 0.0;
      record[i] = open ? -1.0 : stick ? share : 0.0;
      record[n + i] = touches ? all2 : rests ? 0.0 : to.m1;
      record[2 * n + i] = touches ? -all1 : rests ? 0.0 : to.m2;
      record[3 * n + i] = rests ? 0.0 : to.A1, record[4 * n + i] = rests ? 0.0 : to.A2;
      record[5 * n + i] = rests ? 0.0 : share * to.B1, record[6 * n + i] = rests ? 0.0 : share * to.B2;
      const double r0 = lands | rests ? 0.0 : slope * to.r0, r1 = rests ? 0.0 : slope * to.r1;
      record[7 * n + i] = rests ? 0.0 : to.G1, record[8 * n + i] = rests ? 0.0 : to.G2;
      record[9 * n + i] = share * rate + r0, record[10 * n + i] = (1 - share) * rate + r1;
    }
  }
}

FRETWAVE_VECTORISE void linear_march(PairConstants const& p, int samples, int pairs, int pair, int n,
                                     double const* record, double const* du, double* dw, double* df) {
  if (pair >= 0 && df)
    linear_loop<true, true>(p, samples, pairs, pair, n, record, du, dw, df);
  else if (pair >= 0)
    linear_loop<true, false>(p, samples, pairs, pair, n, record, du, dw, df);
  else if (df)
    linear_loop<false, true>(p, samples, pairs, pair, n, record, du, dw, df);
  else
    linear_loop<false, false>(p, samples, pairs, pair, n, record, du, dw, df);
}

/// The record of a sample that sticks begins with (1, 0, 0).
FRETWAVE_VECTORISE void left_rest(int samples, int n, double const* record, double* left) {
  for (int i = 0; i < n; ++i) left[i] = 0;
  for (int t = 0; t < samples; ++t, record += record_arrays * n)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const bool sticks = record[i] == 1 && record[n + i] == 0 && record[2 * n + i] == 0;
      left[i] = sticks ? left[i] : 1.0;
    }
}

FRETWAVE_VECTORISE void shoot(int samples, int n, double const* discs, double* start, double* end,
                              double* A) {
  double const *before = discs + size_t(samples - 1) * 3 * n, *first = discs;
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    pull_in(before[i], before[n + i], before[2 * n + i], start[i], start[n + i]);
    end[i] = start[i], end[n + i] = start[n + i];
    A[i] = A[3 * n + i] = 1, A[n + i] = A[2 * n + i] = 0;
  }
  for (int t = 0; t < samples; ++t, before = discs, discs += 3 * n) {
    double const* next = t + 1 < samples ? discs + 3 * n : first;
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double w1 = end[i], w2 = end[n + i], R = discs[2 * n + i];
      const double d1 = discs[i] - w1, d2 = discs[n + i] - w2;
      const bool stick = (d1 * d1 + d2 * d2 <= R * R) & (R > 0);
      const double v1 = discs[i] - before[i], v2 = discs[n + i] - before[n + i];
      const Slip to = slip(before[i] - w1, before[n + i] - w2, v1, v2, next[i] - discs[i] - v1,
                           next[n + i] - discs[n + i] - v2, before[2 * n + i], R, 0);
      end[i] = stick ? w1 : discs[i] - R * to.m1, end[n + i] = stick ? w2 : discs[n + i] - R * to.m2;
      const double one = to.A1 * A[i] + to.A2 * A[2 * n + i], two = to.A1 * A[n + i] + to.A2 * A[3 * n + i];
      A[i] = stick ? A[i] : -to.m2 * one, A[n + i] = stick ? A[n + i] : -to.m2 * two;
      A[2 * n + i] = stick ? A[2 * n + i] : to.m1 * one, A[3 * n + i] = stick ? A[3 * n + i] : to.m1 * two;
    }
  }
}

FRETWAVE_VECTORISE void farthest(int samples, int n, double const* discs, double const* w, double* excess,
                                 double* sample) {
  for (int i = 0; i < n; ++i) excess[i] = -std::numeric_limits<double>::infinity(), sample[i] = 0;
  for (int t = 0; t < samples; ++t, discs += 3 * n)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double d1 = discs[i] - w[i], d2 = discs[n + i] - w[n + i], R = discs[2 * n + i];
      const double now = d1 * d1 + d2 * d2 - R * R;
      const bool more = now > excess[i];
      sample[i] = more ? double(t) : sample[i];
      excess[i] = more ? now : excess[i];
    }
}

FRETWAVE_VECTORISE void extent(int samples, int n, double const* discs, double* size) {
  for (int t = 0; t < samples; ++t, discs += 3 * n)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double now = std::abs(discs[i]) + std::abs(discs[n + i]) + discs[2 * n + i];
      size[i] = now > size[i] ? now : size[i];
    }
}

}  // namespace fretwave::contact
