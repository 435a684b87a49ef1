/// What lies above the harmonics that an estimate takes in, by how the contact force falls there.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "hb/discretisation_error.h"
#include "solve/vectors.h"
#include "tuned.h"

namespace fretwave::hb {

namespace {

const Tuned slowest("error_slowest", 1, "exponent of H at the least by which what lies above falls");
const Tuned fastest("error_fastest", 3, "the same at the most: resonances of high orders are slower");

}  // namespace

/// Of a force's coefficients of the finer orders up to one.
double DiscretisationError::square_up_to(int highest, Vec force) const {
  Harmonics const& finer = finer_->harmonics();
  std::vector<int> orders;
  std::ranges::copy_if(finer.orders(), std::back_inserter(orders), [&](int n) { return n <= highest; });
  if (orders.empty()) return 0;
  const Harmonics lower(orders, finer.samples());
  return std::pow(solve::norm(embedded(finer_->model(), finer, lower, force)), 2);
}

/// 2 a of coefficients n^-a above H, by the mean squares of a lower and an upper half of the new orders, in
/// pairs of an even and an odd one: motions are often nearly odd. None of fewer than two pairs.
std::optional<double> DiscretisationError::fall(Vec force) const {
  const int H = problem_.harmonics().highest(), pairs = (finer_->harmonics().highest() - H) / 2;
  if (pairs < 2) return {};
  const double from = bound(H), to = bound(H + 2 * pairs);
  const int half = std::clamp(int(std::lround((std::sqrt(from * to) - from) / 2)), 1, pairs - 1);
  const double middle = bound(H + 2 * half), below = square_up_to(H + 2 * half, force),
               low = below - square_up_to(H, force),
               high = std::max(square_up_to(H + 2 * pairs, force) - below, 0.0);
  if (!(low > 0)) return {};
  return std::log(low / (middle - from) * (to - middle) / high) / std::log(std::sqrt(to / from));
}

/// What an order stands for ends halfway to the next one.
double DiscretisationError::bound(int order) const {
  return order + (finer_->harmonics().odd_only() ? 1.0 : 0.5);
}

/// All that lies above H over what the finer set has of it. Coefficients n^-a of a contact force move the
/// motion by n^-(a + 2), its velocity by n^-(a + 1). The force's derivative has n^-(a - 1): what lies above
/// H' moves the retained force by (H / H')^2a of what lies above H where the force follows the motion (with a
/// kink: a = 2), by (H / H')^(2 a - 1) where it follows the velocity (a jump: a = 1).
double DiscretisationError::all_above(Vec force) const {
  const auto twice_a = fall(force);
  const double least = slowest, most = std::max(least, double(fastest)),
               unknown = of_velocity_ ? (least + most) / 2 : most,
               told = twice_a ? *twice_a - (of_velocity_ ? 1 : 0) : unknown,
               share = bound(problem_.harmonics().highest()) / bound(finer_->harmonics().highest());
  return 1 / (1 - std::pow(share, std::clamp(told, least, most)));
}

}  // namespace fretwave::hb
