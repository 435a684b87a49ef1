#include "precondition/pair_correction.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapack.h"

namespace fretwave::precondition {

namespace {

constexpr double negligible = 1e-7;  // of D: single precision has no more

double largest(std::vector<double> const& D) {
  double most = 0;
  for (const double d : D) most = std::max(most, std::abs(d));
  return most;
}

/// Calls visit(row, col, value) for the entries of a pair's per-harmonic 2x2 blocks in its (d m)^2 block.
template <class Visit>
void for_entries(Harmonics const& h, int d, Rotation const* blocks, Visit visit) {
  const int m = h.block_size();
  for (int i = 0; i < h.count(); ++i)
    for (int r = 0; r < d; ++r)
      for (int c = 0; c < d; ++c, ++blocks) {
        const int row = r * m + h.offset(i), col = c * m + h.offset(i);
        visit(row, col, blocks->cc);
        if (h.orders()[i] == 0) continue;
        visit(row, col + 1, blocks->cs), visit(row + 1, col, blocks->sc), visit(row + 1, col + 1, blocks->ss);
      }
}

}  // namespace

std::vector<Rotation> harmonic_tangents(Harmonics const& h, int d, double const* D, bool real_fundamental) {
  const size_t m = h.block_size(), ld = d * m;
  std::vector<Rotation> out;
  for (int i = 0; i < h.count(); ++i)
    for (int r = 0; r < d; ++r)
      for (int c = 0; c < d; ++c) {
        double const* at = D + (r * m + h.offset(i)) * ld + c * m + h.offset(i);
        if (h.orders()[i] == 0) {
          out.push_back({.cc = at[0]});
          continue;
        }
        const Rotation exact{at[0], at[1], at[ld], at[ld + 1]};
        out.push_back(real_fundamental && i == h.fundamental() ? exact : Rotation::of(exact.nearest()));
      }
  return out;
}

PairCorrection::PairCorrection(Harmonics const& h, int d, std::vector<double> D, Rotation const* tangents,
                               Rotation const* G)
    : size_(d * h.block_size()) {
  const size_t n = size_;
  const double all = largest(D);
  for_entries(h, d, tangents, [&](int row, int col, double t) { D[row * n + col] -= t; });
  if (!(largest(D) > negligible * all)) return;
  // Column-major sight of the row-major dD is dD^T: (I + dD^T G^T) E^T = dD^T.
  std::vector<float> T(n * n, 0.0f), E(D.begin(), D.end());
  for (size_t k = 0; k < n; ++k) T[k * n + k] = 1;
  for_entries(h, d, G, [&](int row, int col, double g) {
    for (size_t i = 0; i < n; ++i) T[row * n + i] += float(g) * float(D[col * n + i]);
  });
  if (lapack::solve(T, size_, E, size_) == 0)
    E_ = std::move(E);  // else the harmonic blocks alone serve this pair
}

void PairCorrection::apply(float const* u, float* f) const {
  const int step = 1;
  const float one = 1, zero = 0;
  sgemv_("T", &size_, &size_, &one, E_.data(), &size_, u, &step, &zero, f, &step);
}

}  // namespace fretwave::precondition
