#include "hb/play.h"

#include <algorithm>
#include <cmath>

namespace fretwave::hb {

/// From a wall's minima to the maxima behind (lower wall; upper: the reverse).
void Play::periodic_pushes(Walls const& walls, int side) {
  std::vector<Root> const& turns = walls.of(side);
  for (size_t i = 0; i < turns.size(); ++i) {
    Root const &to = turns[i], &from = turns[i ? i - 1 : turns.size() - 1];
    if (to.rising == (side < 0))
      pushes_.push_back({i ? from.at : from.at - period, to.at, side, from.value, to.value});
  }
  if (turns.size()) return;
  const double still = walls.wall(side).at(0).d[0];  // a wall that stands
  pushes_.push_back({0, 0, side, still, still});
}

/// The same in a span, whose ends count. There both walls are at u.
void Play::pushes(Walls const& walls, int side, Span const& span, double first, double last) {
  const double end = span.begin + span.length;
  Root from{span.begin, walls.wall(side).at(span.begin + span.length / 2).d[1] > 0, first};
  bool towards = from.rising == (side > 0);  // where it does not turn at all
  for (const double shift : {0.0, period})
    for (Root turn : walls.of(side)) {
      turn.at += shift;
      if (turn.at <= span.begin || turn.at >= end) continue;
      if (turn.rising == (side < 0)) pushes_.push_back({from.at, turn.at, side, from.value, turn.value});
      towards = turn.rising == (side > 0), from = turn;
    }
  if (towards) pushes_.push_back({from.at, end, side, from.value, last});
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
  for (const int side : {1, -1}) periodic_pushes(walls, side);
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
    const Series::Jet lower = walls.lower.at(span.begin), upper = walls.upper.at(span.begin);
    const double first = (lower.d[0] + upper.d[0]) / 2, drift = (lower.d[1] + upper.d[1]) / 2;
    const double last = (walls.lower.at(end).d[0] + walls.upper.at(end).d[0]) / 2;
    pushes_.clear();
    for (const int side : {1, -1}) pushes(walls, side, span, first, last);
    std::ranges::sort(pushes_, {}, &Push::end);
    const double parting = walls.radius.at(span.begin).d[1];
    State now{span.begin, first, 0, parting > 0 ? drift / parting : 0.0, true};
    for (Push const& push : pushes_)
      if (drags(push, now)) slip(walls, push, now);
    stick(now, end - now.since);
  }
}

}  // namespace fretwave::hb
