#include "contact/coulomb_march.h"

#include <cmath>
#include <limits>

#include "contact/vectorise.h"

namespace fretwave::contact {

namespace {

/// A projection onto a disc of radius R about d = u - w: d shrinks by s = R / |d|.
struct Projection {
  double s, e1, e2;
};

FRETWAVE_INLINE Projection project(double d1, double d2, double R) {
  const double size2 = d1 * d1 + d2 * d2;
  const double inverse = 1 / std::sqrt(size2 + std::numeric_limits<double>::min());  // d = 0 too
  const bool stick = size2 <= R * R && R > 0;  // without friction nothing sticks
  const double along = stick || R == 0 ? 0.0 : inverse;
  return {stick ? 1.0 : R * inverse, d1 * along, d2 * along};
}

/// Clipped d, and the uncoupled law's record.
struct Clip {
  double d, code;
};

FRETWAVE_INLINE Clip clip(double d, double R) {
  const bool stick = std::abs(d) <= R && R > 0;
  const double sign = std::copysign(R > 0 ? 1.0 : 0.0, d);
  return {stick ? d : std::copysign(R, d), stick ? 2.0 : sign};
}

template <bool Coupled>
FRETWAVE_INLINE void march_loop(PairConstants const& p, int samples, int n, double const* u, double* w,
                                double* f, double* record) {
  double const *kn = p.kn, *kt = p.kt, *reach = p.reach, *load = p.load, *gap = p.gap;
  for (int t = 0; t < samples; ++t, u += 3 * n, f += 3 * n, record += 3 * n)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double elastic = load[i] + kn[i] * (u[i] - gap[i]), normal = elastic > 0 ? elastic : 0.0;
      const double R = reach[i] * normal, d1 = u[n + i] - w[i], d2 = u[2 * n + i] - w[n + i];
      double kept1, kept2;
      if constexpr (Coupled) {
        const Projection to = project(d1, d2, R);
        kept1 = to.s * d1, kept2 = to.s * d2;
        record[i] = elastic > 0 ? to.s : -1.0, record[n + i] = to.e1, record[2 * n + i] = to.e2;
      } else {
        const Clip one = clip(d1, R), two = clip(d2, R);
        kept1 = one.d, kept2 = two.d;
        record[i] = elastic > 0 ? 1.0 : 0.0, record[n + i] = one.code, record[2 * n + i] = two.code;
      }
      w[i] += d1 - kept1, w[n + i] += d2 - kept2;  // by exactly nothing where it sticks
      f[i] = normal, f[n + i] = kt[i] * kept1, f[2 * n + i] = kt[i] * kept2;
    }
}

template <bool Coupled, bool OnePair, bool Force>
FRETWAVE_INLINE void linear_loop(PairConstants const& p, int samples, int pairs, int pair, int n,
                                 double const* record, double const* du, double* dw, double* df) {
  double const *kn = p.kn, *kt = p.kt, *reach = p.reach;
  for (int t = 0; t < samples; ++t, du += 3 * n, df += Force ? 3 * n : 0, record += 3 * pairs)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const int k = OnePair ? pair : i;
      const SampleTangent r = sample_tangent<Coupled>(record[k], record[pairs + k], record[2 * pairs + k]);
      const double dN = r.closed * kn[k] * du[i], dR = reach[k] * dN;
      const double x1 = du[n + i] - dw[i], x2 = du[2 * n + i] - dw[n + i];
      const double along = Coupled ? r.e1 * x1 + r.e2 * x2 : 0.0;
      const double y1 = r.s1 * (x1 - r.e1 * along) + r.e1 * dR, y2 = r.s2 * (x2 - r.e2 * along) + r.e2 * dR;
      dw[i] += x1 - y1, dw[n + i] += x2 - y2;
      if constexpr (Force) df[i] = dN, df[n + i] = kt[k] * y1, df[2 * n + i] = kt[k] * y2;
    }
}

template <bool Coupled>
FRETWAVE_INLINE void linear_choice(PairConstants const& p, int samples, int pairs, int pair, int n,
                                   double const* record, double const* du, double* dw, double* df) {
  if (pair >= 0 && df)
    linear_loop<Coupled, true, true>(p, samples, pairs, pair, n, record, du, dw, df);
  else if (pair >= 0)
    linear_loop<Coupled, true, false>(p, samples, pairs, pair, n, record, du, dw, df);
  else if (df)
    linear_loop<Coupled, false, true>(p, samples, pairs, pair, n, record, du, dw, df);
  else
    linear_loop<Coupled, false, false>(p, samples, pairs, pair, n, record, du, dw, df);
}

/// A sample that sticks is (1, 0, 0) in the coupled record, (1, 2, 2) in the other.
template <bool Coupled>
FRETWAVE_INLINE void left_loop(int samples, int n, double const* record, double* left) {
  constexpr double stuck = Coupled ? 0 : 2;
  for (int i = 0; i < n; ++i) left[i] = 0;
  for (int t = 0; t < samples; ++t, record += record_arrays * n)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const bool sticks = record[i] == 1 && record[n + i] == stuck && record[2 * n + i] == stuck;
      left[i] = sticks ? left[i] : 1.0;
    }
}

}  // namespace

FRETWAVE_VECTORISE void left_coupled(int samples, int n, double const* record, double* left) {
  left_loop<true>(samples, n, record, left);
}
FRETWAVE_VECTORISE void left_alone(int samples, int n, double const* record, double* left) {
  left_loop<false>(samples, n, record, left);
}
FRETWAVE_VECTORISE void march_coupled(PairConstants const& p, int samples, int n, double const* u, double* w,
                                      double* f, double* record) {
  march_loop<true>(p, samples, n, u, w, f, record);
}
FRETWAVE_VECTORISE void march_alone(PairConstants const& p, int samples, int n, double const* u, double* w,
                                    double* f, double* record) {
  march_loop<false>(p, samples, n, u, w, f, record);
}
FRETWAVE_VECTORISE void linear_coupled(PairConstants const& p, int samples, int pairs, int pair, int n,
                                       double const* record, double const* du, double* dw, double* df) {
  linear_choice<true>(p, samples, pairs, pair, n, record, du, dw, df);
}
FRETWAVE_VECTORISE void linear_alone(PairConstants const& p, int samples, int pairs, int pair, int n,
                                     double const* record, double const* du, double* dw, double* df) {
  linear_choice<false>(p, samples, pairs, pair, n, record, du, dw, df);
}

FRETWAVE_VECTORISE void shoot(int samples, int n, double const* discs, double* w, double* A) {
  for (int i = 0; i < n; ++i) A[i] = A[3 * n + i] = 1, A[n + i] = A[2 * n + i] = 0;
  for (int t = 0; t < samples; ++t, discs += 3 * n)
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const double d1 = discs[i] - w[i], d2 = discs[n + i] - w[n + i];
      const Projection to = project(d1, d2, discs[2 * n + i]);
      w[i] += d1 - to.s * d1, w[n + i] += d2 - to.s * d2;
      const double one = to.e1 * A[i] + to.e2 * A[2 * n + i], two = to.e1 * A[n + i] + to.e2 * A[3 * n + i];
      A[i] = to.s * (A[i] - to.e1 * one), A[n + i] = to.s * (A[n + i] - to.e1 * two);
      A[2 * n + i] = to.s * (A[2 * n + i] - to.e2 * one), A[3 * n + i] = to.s * (A[3 * n + i] - to.e2 * two);
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
