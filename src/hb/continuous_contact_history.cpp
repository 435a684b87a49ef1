/// What is read from contact in continuous time: its sequence of states, samples, work and slip.
#include <algorithm>
#include <cmath>

#include "hb/continuous_contact.h"
#include "scramble.h"

namespace fretwave::hb {

namespace {

/// Integral over an arc of p q': 2 Re(a) Re(b) = Re(a b + a conj(b)).
double integral(Arc const& arc, Series const& p, Series const& q) {
  double sum = 0;
  for (size_t j = 0; j < p.q.size(); ++j)
    for (size_t k = 1; k < q.q.size(); ++k) {
      const complex rate = complex(0, double(k)) * q.q[k], over = arc.integral(std::abs(int(j) - int(k)));
      sum += (p.q[j] * rate * arc.integral(int(j + k))).real();
      sum += (p.q[j] * std::conj(rate) * (j < k ? std::conj(over) : over)).real();
    }
  return sum / 2;
}

/// Of the period in any of these, wherever they begin.
double union_length(std::vector<Span> spans) {
  for (size_t i = spans.size(); i-- > 0;) {
    Span& span = spans[i];
    span.begin -= period * std::floor(span.begin / period);
    const double beyond = span.begin + span.length - period;
    if (beyond <= 0) continue;
    span.length -= beyond;
    spans.push_back({0, beyond});
  }
  std::ranges::sort(spans, {}, &Span::begin);
  double sum = 0, end = 0;
  for (Span const& span : spans) {
    sum += std::max(0.0, span.begin + span.length - std::max(end, span.begin));
    end = std::max(end, span.begin + span.length);
  }
  return sum;
}

}  // namespace

double ContinuousContact::mean_stiffness(int number, int component) const {
  Pair const& pair = pairs_[number];
  double length = 0;
  if (component == normal_) return pair.normal.mean_stiffness();
  for (auto const& piece : pair.tangents[component - (normal_ >= 0)].play.sticks) length += piece.length;
  return pair.law.tangential_stiffness * length / period;
}

/// By the states that follow each other in the period, wherever it begins.
std::uint64_t ContinuousContact::piece(bool) const {
  std::uint64_t sum = 0;
  for (size_t k = 0; k < pairs_.size(); ++k) {
    Pair const& pair = pairs_[k];
    const std::uint64_t own = scrambled(k);
    sum += scrambled(own + pair.normal.sequence());
    for (size_t t = 0; t < pair.tangents.size(); ++t) {
      Play const& play = pair.tangents[t].play;
      std::vector<std::pair<double, int>> states;
      for (auto const& piece : play.slips) states.emplace_back(piece.begin, 1 + piece.side);
      for (auto const& piece : play.sticks) states.emplace_back(piece.begin, piece.follows ? 1 : 3);
      std::ranges::sort(states);
      for (size_t i = 0; i < states.size(); ++i)
        sum += scrambled(scrambled(own + 16 * (t + 1)) + 4 * states[i].second +
                         states[(i + 1) % states.size()].second);
    }
  }
  return sum;
}

void ContinuousContact::sample(int samples, double const* u, double const*, double* f) const {
  const size_t n = pairs_.size(), step = n * components_;
  std::fill_n(f, size_t(samples) * step, 0.0);
  for (size_t k = 0; k < n; ++k) {
    Pair const& pair = pairs_[k];
    contact::LinearPair const& law = pair.law;
    std::vector<double> limit(samples, law.friction_limit);
    for (int t = 0; t < samples && normal_ >= 0; ++t) {
      const size_t at = t * step + normal_ * n + k;
      f[at] = std::max(0.0, law.load + law.normal_stiffness * u[at]);
      limit[t] += law.friction_coefficient * f[at];
    }
    for (size_t c = 0; c < pair.tangents.size(); ++c) {
      Tangent const& now = pair.tangents[c];
      const size_t at = (c + (normal_ >= 0)) * n + k;
      for (auto const& piece : now.play.sticks)
        for_samples(samples, piece.begin, piece.length, [&](size_t t, double) {
          const double force = law.tangential_stiffness * (u[t * step + at] - now.mean - piece.slider);
          f[t * step + at] = std::clamp(force, -limit[t], limit[t]);
        });
      for (auto const& piece : now.play.slips)
        for_samples(samples, piece.begin, piece.length,
                    [&](size_t t, double) { f[t * step + at] = piece.side * limit[t]; });
    }
  }
}

void ContinuousContact::measure(contact::Diagnosis& out, double /*omega*/) const {
  std::ranges::fill(out.work, 0.0);
  for (size_t k = 0; k < pairs_.size(); ++k) {
    contact::LinearPair const& law = pairs_[k].law;
    // what two tangents do together, and what nothing holds, is left as it was sampled
    const auto slips = [](Tangent const& now) { return now.play.slips.size() > 0; };
    std::vector<Span> slip;
    for (Tangent const& now : pairs_[k].tangents)
      for (Play::Slip const& piece : now.play.slips) slip.push_back({piece.begin, piece.length});
    const double contact = normal_ < 0 ? 1 : pairs_[k].normal.length() / period;
    const bool free = pairs_[k].tangents.size() && !law.rubs();
    contact::set_shares(out, k, contact, free ? contact : union_length(std::move(slip)) / period);
    const bool straight = law.rubs() && std::ranges::count_if(pairs_[k].tangents, slips) < 2;
    if (straight) out.slip_path[k] = 0;
    if (straight && out.archard.size()) out.archard[k] = 0;
    for (Tangent const& now : pairs_[k].tangents)
      for (Play::Slip const& piece : now.play.slips) {
        if (straight) out.slip_path[k] += piece.path;
        out.work[k] += law.friction_limit * piece.path;
        if (law.friction_coefficient == 0) continue;
        const Arc arc(2 * harmonics_.highest(), piece.begin, piece.length);
        const double along = integral(arc, pairs_[k].normal.approach, now.walls.wall(piece.side));
        const double wear = std::max(0.0, piece.side * law.normal_stiffness * along);
        out.work[k] += law.friction_coefficient * wear;
        if (straight && out.archard.size()) out.archard[k] += wear;
      }
  }
}

}  // namespace fretwave::hb
