#include "hb/play.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fretwave::hb {

namespace {

constexpr double period = 2 * std::numbers::pi;

}  // namespace

/// From a wall's minima to the maxima behind (lower wall; upper: the reverse). In a span its ends count.
void Play::pushes(Walls const& walls, int side, double begin, double end, bool periodic) {
  Series const& wall = walls.wall(side);
  std::vector<Root> const& turns = walls.of(side);
  const auto at = [&](double tau) {  // both walls are at u where the pair closes or opens
    const double here = wall.at(tau).d[0];
    return periodic || (tau != begin && tau != end) ? here : (here + walls.wall(-side).at(tau).d[0]) / 2;
  };
  const auto add = [&](double from, double to) { pushes_.push_back({from, to, side, at(from), at(to)}); };
  const auto turns_away = [side](Root const& turn) { return turn.rising == (side < 0); };
  if (periodic) {
    const size_t n = turns.size();
    for (size_t i = 0; i < n; ++i)
      if (turns_away(turns[i])) add(i ? turns[i - 1].at : turns[n - 1].at - period, turns[i].at);
    if (n == 0) add(0, 0);  // a wall that stands still
    return;
  }
  double from = begin;
  bool any = false;
  for (const double shift : {0.0, period})
    for (Root const& turn : turns) {
      const double tau = turn.at + shift;
      if (tau <= begin || tau >= end) continue;
      if (turns_away(turn)) add(from, tau);
      from = tau, any = !turns_away(turn);
    }
  if (any || (from == begin && side * wall.at((begin + end) / 2).d[1] > 0)) add(from, end);
}

/// How long the slider stands until the push moves it: its wall has to come to it, from where both were then.
double Play::waiting(Walls const& walls, Push const& push, State const& now) const {
  Series const& wall = walls.wall(push.side);
  if (now.side == 0 && push.begin == now.since) return 0;
  // of w from the wall at that time, where the walls are 2 R apart
  const double away = now.side == -push.side ? push.side * 2 * walls.radius.at(now.since).d[0] : 0.0;
  // a cubic with the wall's slopes, none at both ends
  const double done = std::clamp((now.slider - push.from) / (push.to - push.from), 0.0, 1.0);
  const double guess = 0.5 - std::sin(std::asin(1 - 2 * done) / 3);
  const double low = std::max(push.begin, now.since) - now.since, high = push.end - now.since;
  const auto f = [&](double s) {
    const auto [moved, slope] = wall.difference(now.since, s);
    return std::pair(moved - away, slope);
  };
  const double s = push.begin + guess * (push.end - push.begin) - now.since;
  return root(f, low, high, std::clamp(s, low, high), push.side);
}

void Play::slip(Walls const& walls, Push const& push, State& now) {
  const double wait = waiting(walls, push, now);
  stick(now, wait);
  const double begin = now.since + wait;
  slips.push_back({begin, push.end - begin, push.side, std::abs(push.to - now.slider)});
  now = {push.end, push.to, push.side, double(push.side), true};
}

/// Two periods: a slider forgets all before its last slip, so that one closes it.
void Play::close(Walls const& walls, double rest) {
  clear(), pushes_.clear();
  for (const int side : {1, -1}) pushes(walls, side, 0, period, true);
  std::ranges::sort(pushes_, {}, &Push::end);
  State now{0, rest, 0, 0, false};
  for (Push const& push : pushes_)
    if (drags(push, now)) now = {push.end - period, push.to, push.side, double(push.side), true};
  const State first = now;
  for (Push const& push : pushes_)
    if (drags(push, now)) slip(walls, push, now);
  stuck = slips.empty();
  if (stuck) sticks = {{first.since, period, first.share, first.slider, first.follows}};
}

/// Closing, w = u between two walls that part: it is dragged at once, or stands while they go to either side.
void Play::close(Walls const& walls, std::vector<Span> const& spans) {
  clear();
  for (Span const& span : spans) {
    const double end = span.begin + span.length;
    pushes_.clear();
    for (const int side : {1, -1}) pushes(walls, side, span.begin, end, false);
    std::ranges::sort(pushes_, {}, &Push::end);
    const Series::Jet lower = walls.lower.at(span.begin), upper = walls.upper.at(span.begin);
    const double parting = walls.radius.at(span.begin).d[1], drift = (upper.d[1] + lower.d[1]) / 2;
    State now{span.begin, (lower.d[0] + upper.d[0]) / 2, 0, parting > 0 ? drift / parting : 0.0, true};
    for (Push const& push : pushes_)
      if (drags(push, now)) slip(walls, push, now);
    stick(now, end - now.since);
  }
}

}  // namespace fretwave::hb
