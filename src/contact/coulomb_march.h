#pragma once
#include <cstddef>

/// The inner loops of 3-D Coulomb contact: pairs innermost, no branches, no memory but their arguments.
///
/// A slider w with T = kt (u - w) is a point inside the disc of radius R = mu N / kt about u: it stays while
/// it is inside and is else projected onto the disc (each tangent onto its own interval in the uncoupled
/// law).
namespace fretwave::contact {

/// Of the pairs in a march, one value each; reach = mu / kt.
struct PairConstants {
  double const *kn, *kt, *reach, *load, *gap;
};

/// Arrays of the record, samples x these x pairs. Coupled: s = R / |u - w| (1 stick, -1 open) and the slip
/// direction e (0 unless it slips). Uncoupled: 1 if closed; for each tangent 2 stick, +-1 slip, 0 open.
constexpr int record_arrays = 3;

/// What the linearised march does at a sample: dT / kt = s (I - e e^T) (du - dw) + e reach dN; alone: without
/// e e^T.
struct SampleTangent {
  double closed, s1, s2, e1, e2;
};
template <bool Coupled>
inline SampleTangent sample_tangent(double a, double b, double c) {
  if constexpr (Coupled) {
    const double s = a < 0 ? 0.0 : a;
    return {a < 0 ? 0.0 : 1.0, s, s, b, c};
  } else {
    return {a, b == 2 ? 1.0 : 0.0, c == 2 ? 1.0 : 0.0, b == 2 ? 0.0 : b, c == 2 ? 0.0 : c};
  }
}

/// Forces and record over one period of u (samples x 3 x n); sliders w (2 x n) at its start in, at its end
/// out.
using March = void(PairConstants const&, int samples, int n, double const* u, double* w, double* f,
                   double* record);
March march_coupled, march_alone;

/// The derivative of a march: dw in and out, df unless null. With `pair` >= 0 the n columns are perturbations
/// of that one of the record's `pairs`; else they are the pairs.
using LinearMarch = void(PairConstants const&, int samples, int pairs, int pair, int n, double const* record,
                         double const* du, double* dw, double* df);
LinearMarch linear_coupled, linear_alone;

/// 1 where a pair slipped or opened at any sample of a record, 0 where it stuck all along.
using LeftRest = void(int samples, int n, double const* record, double* left);
LeftRest left_coupled, left_alone;

// Plain functions, because the compiler clones no templates for several processors.
template <bool Coupled>
constexpr March* march = Coupled ? march_coupled : march_alone;
template <bool Coupled>
constexpr LinearMarch* linear_march = Coupled ? linear_coupled : linear_alone;
template <bool Coupled>
constexpr LeftRest* left_rest = Coupled ? left_coupled : left_alone;

/// Sliders over one period of discs (samples x (x, y, R) x n) and the derivative A (2 x 2 x n) of their end
/// by their start.
void shoot(int samples, int n, double const* discs, double* w, double* A);

/// The disc that w is farthest outside of, by distance squared less radius squared.
void farthest(int samples, int n, double const* discs, double const* w, double* excess, double* sample);

/// Largest |u| + R (sums of moduli), at least what stands there.
void extent(int samples, int n, double const* discs, double* size);

}  // namespace fretwave::contact
