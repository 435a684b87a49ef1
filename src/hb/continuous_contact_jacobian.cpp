/// Derivatives of contact in continuous time.
#include "hb/continuous_contact.h"
#include "hb/indicator.h"

namespace fretwave::hb {

void ContinuousContact::linearise() {
  const size_t size = block(1, 0), normal = normal_ < 0 ? 0 : block(0, normal_);
  blocks_.clear(pairs_.size(), int(size));
  for (size_t k = 0; k < pairs_.size(); ++k) {
    double *D = blocks_.of(k), *by_gap = blocks_.by_gap_of(k);
    if (normal_ >= 0) pairs_[k].normal.add_blocks(harmonics_, D + normal * (size + 1), size, by_gap + normal);
    for (size_t t = 0; t < pairs_[k].tangents.size(); ++t) tangential_blocks(pairs_[k], int(t), D, by_gap);
  }
}

/// dT = kt (du - dw) in stick, with dw = du - share dR at its begin, +- mu dN in slip.
void ContinuousContact::tangential_blocks(Pair const& pair, int tangent, double* D, double* by_gap) const {
  Tangent const& now = pair.tangents[tangent];
  contact::LinearPair const& law = pair.law;
  const double kt = law.tangential_stiffness, slope = law.friction_coefficient * law.normal_stiffness;
  const int m = harmonics_.block_size();
  const size_t ld = block(1, 0), at = block(0, tangent + (normal_ >= 0)),
               normal = block(0, normal_ < 0 ? 0 : normal_);
  Indicator stick(harmonics_), slip(harmonics_);
  Arc arc;
  if (now.play.stuck) stick.fill();
  for (Play::Stick const& piece : now.play.sticks) {
    Indicator here(harmonics_);
    if (now.play.stuck) {
      here.fill();
    } else {
      arc.set(2 * harmonics_.highest(), piece.begin, piece.length);
      here.add(arc, 1), stick.add(arc, 1);
    }
    if (!piece.follows) continue;
    std::vector<double> force(m);
    here.add_coefficients(kt, force.data());
    std::vector<double> wave(m);
    waves(harmonics_, piece.begin, wave.data());
    const double share = piece.share * law.reach();
    for (int r = 0; r < m; ++r) {
      double* row = D + (at + r) * ld;
      for (int c = 0; c < m; ++c) row[at + c] -= force[r] * wave[c];
      for (int c = 0; c < m && share != 0; ++c) row[normal + c] += share * force[r] * wave[c];
      by_gap[at + r] -= share * force[r];
    }
  }
  stick.add_multiplication(kt, D + at * ld + at, ld);
  if (slope == 0) return;
  for (Play::Slip const& piece : now.play.slips) {
    arc.set(2 * harmonics_.highest(), piece.begin, piece.length);
    slip.add(arc, piece.side);
  }
  slip.add_multiplication(slope, D + at * ld + normal, ld);
  slip.add_coefficients(-slope, by_gap + at);
}

}  // namespace fretwave::hb
