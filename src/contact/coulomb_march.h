#pragma once

/// The inner loops of `coulomb_3d`: pairs innermost, no branches, no memory but their arguments.
///
/// A slider w with T = kt (u - w) is a point inside the disc of radius R = mu N / kt about u, which sweeps it
/// (Moreau). Between two samples u goes straight and N linearly until the pair opens or from where it closes,
/// and the slider follows its exact path (`slip`). Projecting it onto each sample's disc instead (implicit
/// Euler) is of first order where the path bends.
namespace fretwave::contact {

struct PairConstants;

/// Arrays of the record, samples x these x pairs: of the step that ends at the sample, for the arm d = u - w
/// with dv = du - du', dd' = du' - dw' of the sample before:
///   dd = s (dd' + dv) + reach dN m + m' (A dd' + B dv + G da + r' du_n' + r du_n),  m' = (-m2, m1)
/// s (1 stick, less where it closes within the step, 0 slip, -1 open), m, A, B, G, r', r; the term in dN for
/// s = 0 alone; a is what v gains until the next sample.
constexpr int record_arrays = 11;

/// Forces and record over one period of u (samples x 3 x n); sliders w (2 x n) at its start in, at its end
/// out. The period starts at its last sample, whose disc pulls sliders in that lie outside.
void march(PairConstants const&, int samples, int n, double const* u, double* w, double* f, double* record);

/// The derivative of a march: dw in and out, df unless null. With `pair` >= 0 the n columns are perturbations
/// of that one of the record's `pairs`; else they are the pairs.
void linear_march(PairConstants const&, int samples, int pairs, int pair, int n, double const* record,
                  double const* du, double* dw, double* df);

/// 1 where a pair slipped or opened at any sample of a record, 0 where it stuck all along.
void left_rest(int samples, int n, double const* record, double* left);

/// Sliders over one period of discs (samples x (x, y, R) x n) from `start` (2 x n), which the last disc pulls
/// in, to `end`, and the derivative A (2 x 2 x n) of their end by their start.
void shoot(int samples, int n, double const* discs, double* start, double* end, double* A);

/// The disc that w is farthest outside of, by distance squared less radius squared.
void farthest(int samples, int n, double const* discs, double const* w, double* excess, double* sample);

/// Largest |u| + R (sums of moduli), at least what stands there.
void extent(int samples, int n, double const* discs, double* size);

}  // namespace fretwave::contact
