#include "hb/pair_correction.h"

#include <algorithm>

#include "lapack.h"

namespace fretwave::hb {

namespace {

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
    : size_(d * h.block_size()), E_(std::move(D)) {
  const size_t n = size_;
  for_entries(h, d, tangents, [&](int row, int col, double t) { E_[row * n + col] -= t; });
  // Column-major sight of the row-major dD is dD^T: (I + dD^T G^T) E^T = dD^T.
  std::vector<double> T(n * n, 0.0);
  for (size_t k = 0; k < n; ++k) T[k * n + k] = 1;
  for_entries(h, d, G, [&](int row, int col, double g) {
    for (size_t i = 0; i < n; ++i) T[row * n + i] += g * E_[col * n + i];
  });
  std::vector<int> pivots(n);
  int info;
  dgesv_(&size_, &size_, T.data(), &size_, pivots.data(), E_.data(), &size_, &info);
  if (info != 0) std::fill(E_.begin(), E_.end(), 0.0);  // the harmonic blocks alone serve this pair
}

void PairCorrection::apply(double const* u, double* f) const {
  const int step = 1;
  const double one = 1, zero = 0;
  dgemv_("T", &size_, &size_, &one, E_.data(), &size_, u, &step, &zero, f, &step);
}

}  // namespace fretwave::hb
