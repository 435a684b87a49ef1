/// Kinks of contact laws that a step passes between its ends and leaves again: a mass that touches a stop for
/// less than a step. No stage of a method sees them, and no estimate of its error.
#include <algorithm>
#include <array>
#include <cmath>

#include "transient/transient.h"

namespace fretwave::transient {

namespace {

/// Shares of a step in which the cubic through (u0, u1) of slopes (m0, m1) turns:
///   u'(s) = m0 + 2 s (3 (u1 - u0) - 2 m0 - m1) + 3 s^2 (m0 + m1 - 2 (u1 - u0)) = 0,   0 < s < 1.
std::array<double, 2> turns(double u0, double u1, double m0, double m1) {
  const double a = 3 * (m0 + m1 - 2 * (u1 - u0)), half = 3 * (u1 - u0) - 2 * m0 - m1;
  const double square = half * half - a * m0;
  if (!(square >= 0)) return {};
  const double q = -(half + std::copysign(std::sqrt(square), half));
  std::array<double, 2> found = {a == 0 ? 0 : q / a, q == 0 ? 0 : m0 / q};
  for (double& s : found)
    if (!(s > 0 && s < 1)) s = 0;
  return found;
}

double cubic(double s, double u0, double u1, double m0, double m1) {
  const double r = 1 - s;
  return r * r * (u0 * (1 + 2 * s) + m0 * s) + s * s * (u1 * (1 + 2 * r) - m1 * r);
}

}  // namespace

/// The contacts in a state [x, v]; nothing of those whose forces do not depend on displacements. Collective.
std::vector<Transient::Seen> Transient::see(Vec state) {
  place(state);
  std::vector<Seen> out(tangents_.size());
  for (size_t i = 0; i < out.size(); ++i) {
    auto const& contact = model_.contacts()[i];
    if (!contact.law->uses_displacement()) continue;
    Tangents& at = tangents_[i];
    meet(contact, at, true);
    out[i] = {at.displacement, at.velocity, at.force, at.record.df_du};
  }
  return out;
}

namespace {

/// The share of the step in which a component of each pair turns, for the first or the second time; 0 where
/// it does not.
std::vector<double> shares_of_turns(Transient::Seen const& one, Transient::Seen const& other, double h,
                                    size_t n, size_t component, size_t which) {
  std::vector<double> out(n);
  for (size_t i = 0; i < n; ++i) {
    const size_t k = component * n + i;
    out[i] = turns(one.u[k], other.u[k], h * one.v[k], h * other.v[k])[which];
  }
  return out;
}

/// A contact at rest at a share of the step for each pair.
Transient::Seen at_turn(contact::Law const& law, Transient::Seen const& one, Transient::Seen const& other,
                        double h, std::vector<double> const& shares) {
  const size_t d = law.components(), n = law.pairs();
  Transient::Seen out{one.u, std::vector<double>(d * n, 0.0), std::vector<double>(d * n), {}};
  for (size_t k = 0; k < d * n; ++k)
    out.u[k] = cubic(shares[k % n], one.u[k], other.u[k], h * one.v[k], h * other.v[k]);
  contact::Record record;
  law.force(
      {.samples = 1, .components = int(d), .pairs = int(n), .u = out.u.data(), .v = out.v.data(), .step = 0},
      out.f.data(), record);
  out.tangent = std::move(record.df_du);
  return out;
}

/// How far a pair's component went behind a kink since a state, if its force and tangent here are not those
/// that the state tells: of a law of two straight pieces exactly so far.
double behind(Transient::Seen const& here, Transient::Seen const& from, size_t d, size_t n, size_t component,
              size_t pair) {
  const auto tangent = [&](Transient::Seen const& at, size_t column) {
    return at.tangent[(component * d + column) * n + pair];
  };
  const double now = tangent(here, component), then = tangent(from, component);
  if (std::abs(now - then) <= 0.5 * std::max(std::abs(now), std::abs(then))) return 0;
  const size_t row = component * n + pair;
  double told = from.f[row];
  for (size_t c = 0; c < d; ++c) told += tangent(from, c) * (here.u[c * n + pair] - from.u[c * n + pair]);
  return std::abs((here.f[row] - told) / (now - then));
}

/// Whether a contact goes behind a kink, and comes back, between the ends of a step of length h, by more than
/// displacements may be off.
bool passes_kink(contact::Law const& law, Transient::Seen const& one, Transient::Seen const& other, double h,
                 double allowed) {
  const size_t d = law.components(), n = law.pairs();
  if (one.tangent.size() != d * d * n || other.tangent.size() != d * d * n) return false;
  for (size_t turn = 0; turn < 2 * d; ++turn) {
    const size_t component = turn / 2;
    const auto shares = shares_of_turns(one, other, h, n, component, turn % 2);
    if (std::ranges::all_of(shares, [](double share) { return share == 0; })) continue;
    const auto here = at_turn(law, one, other, h, shares);
    if (here.tangent.size() != d * d * n) continue;
    for (size_t i = 0; i < n; ++i)
      if (std::min(behind(here, one, d, n, component, i), behind(here, other, d, n, component, i)) > allowed)
        return true;
  }
  return false;
}

}  // namespace

/// Whether a trial step, of which this is the state at its end, passes a kink: it is taken shorter, until an
/// end of one lies behind the kink. Collective.
bool Transient::passes_kinks(TS ts, double t, Vec end) {
  double begin, h;
  check(TSGetTime(ts, &begin));
  check(TSGetTimeStep(ts, &h));
  if (tangents_.empty() || t < begin + (1 - 1e-9) * h || h <= 1e-12 * interval_) return false;
  const auto reached = see(end);
  int passed = 0;
  for (size_t i = 0; i < reached.size() && !passed; ++i)
    passed = passes_kink(*model_.contacts()[i].law, begun_[i], reached[i], h, allowed_);
  MPI_Allreduce(MPI_IN_PLACE, &passed, 1, MPI_INT, MPI_LOR, model_.comm());
  return passed != 0;
}

}  // namespace fretwave::transient
