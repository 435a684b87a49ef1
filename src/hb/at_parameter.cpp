/// Along the branch from where a step leads to the parameter that it began with.
#include "hb/at_parameter.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "tuned.h"

namespace fretwave::hb {

namespace {

const Tuned reach("error_reach", 0.3, "arclength by which the branch is followed to the same parameter");

/// Sum of squares of all but the parameter, the last of `count`.
double size_beside(std::vector<double> v, int count) {
  v[count - 1] = 0;
  return std::inner_product(v.begin(), v.end(), v.begin(), 0.0);
}

/// Whether the branch leads straight to where `off` of the parameter is made up for; it turns back at folds,
/// as one of curvature 1 does in the second of these.
bool straight(double off, double t) {
  return std::abs(off) <= reach * std::abs(t) && std::abs(off) <= t * t / 2;
}

/// Ways s along a branch of these slope and curvature at which off + slope s + curvature s^2 / 2 vanishes.
/// Beside a fold, where the sign of the slope is rounding's, both of its sides; where nothing vanishes, as
/// far to both of them as it would from the fold.
std::vector<double> ways(double off, double slope, double curvature) {
  const double root = slope * slope - 2 * curvature * off, far = std::sqrt(2 * std::abs(off / curvature));
  const bool leads_there = root >= 0 && slope * slope > 2 * std::abs(curvature * off);
  std::vector<double> found = {far, -far};
  if (leads_there) found = {-2 * off / (slope + std::copysign(std::sqrt(root), slope))};
  for (double& s : found) s = std::clamp<double>(s, -reach, reach);
  return found;
}

}  // namespace

double farthest() { return reach; }

std::vector<double> at_parameter(std::vector<double> const& change, std::vector<double> const& tangent,
                                 std::function<double()> const& curvature, int count) {
  const double off = change[count - 1], slope = tangent[count - 1];
  std::vector<double> most;
  std::vector<double> all = {off == 0 ? 0 : -off / slope};
  if (!straight(off, slope)) {
    const double bend = curvature();
    all = bend == 0 || !std::isfinite(bend) ? std::vector<double>{reach, -reach} : ways(off, slope, bend);
  }
  for (double s : all) {
    std::vector<double> there = change;
    for (size_t j = 0; j < there.size(); ++j) there[j] += s * tangent[j];
    if (most.empty() || size_beside(there, count) > size_beside(most, count)) most = std::move(there);
  }
  return most;
}

}  // namespace fretwave::hb
