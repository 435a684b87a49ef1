#include "hb/continuous_contact.h"

#include <algorithm>
#include <cmath>

#include "hb/indicator.h"

namespace fretwave::hb {

namespace {

constexpr int tile = 32;  // pairs whose times fit the cache

/// a + factor b
Series sum(Series a, double factor, Series const& b) {
  for (size_t k = 0; k < a.q.size(); ++k) a.q[k] += factor * b.q[k];
  return a;
}

}  // namespace

ContinuousContact::ContinuousContact(Harmonics const& h, contact::Law const& law)
    : harmonics_(h),
      times_(search_times(h)),
      law_(law),
      components_(law.components()),
      normal_(law.normal()),
      tile_(std::clamp(law.pairs(), 1, tile)),
      transform_(times_, components_ * tile_, components_),
      wave_(times_.samples()),
      pairs_(law.pairs()) {
  const size_t blocks = size_t(tile_) * components_ * h.block_size();
  grid_.U.resize(blocks), grid_.V.resize(blocks);
  grid_.values.resize(size_t(times_.samples()) * components_ * tile_);
  grid_.rates.resize(grid_.values.size());
  for (Pair& pair : pairs_) pair.tangents.resize(components_ - (normal_ >= 0));
}

/// Displacements and their rates by tau of a tile.
void ContinuousContact::evaluate(double const* U, int first, int pairs) {
  const int m = harmonics_.block_size(), columns = pairs * components_;
  std::ranges::fill(grid_.U, 0.0);
  std::copy_n(U + block(first, 0), size_t(columns) * m, grid_.U.data());
  std::vector<complex> rate(harmonics_.count());
  for (int i = 0; i < harmonics_.count(); ++i) rate[i] = complex(0, harmonics_.orders()[i]);
  multiply(harmonics_, rate, grid_.U.data(), grid_.V.data(), tile_ * components_);
  if (normal_ >= 0) transform_.to_time(grid_.U.data(), grid_.values.data());
  transform_.to_time(grid_.V.data(), grid_.rates.data());
}

void ContinuousContact::force(double const* U, double const*, double* F) {
  blocks_.made = false;
  for (int first = 0; first < int(pairs_.size()); first += tile_) {
    const int pairs = std::min(tile_, int(pairs_.size()) - first);
    evaluate(U, first, pairs);
    for (int i = 0; i < pairs; ++i) {
      Pair& pair = pairs_[first + i];
      take(U, first + i);
      find_spans(pair, i);
      std::fill_n(F + block(first + i, 0), block(1, 0), 0.0);
      if (normal_ >= 0) pair.normal.add_force(harmonics_, F + block(first + i, normal_));
      for (size_t t = 0; t < pair.tangents.size(); ++t) {
        find_play(pair, int(t), i);
        tangential_force(pair, pair.tangents[t], F + block(first + i, int(t) + (normal_ >= 0)));
      }
    }
  }
}

/// Its constants and its motion.
void ContinuousContact::take(double const* U, int number) {
  Pair& pair = pairs_[number];
  pair.law = law_.linear_pair(number);
  if (normal_ >= 0) pair.normal.take(harmonics_, pair.law, U + block(number, normal_));
  for (size_t t = 0; t < pair.tangents.size(); ++t) {
    double const* u = U + block(number, int(t) + (normal_ >= 0));
    pair.tangents[t].u = series(harmonics_, u);
    pair.tangents[t].mean = mean(harmonics_, u);
  }
}

/// When the pair is closed.
void ContinuousContact::find_spans(Pair& pair, int place) {
  if (normal_ < 0) return;
  const int N = times_.samples(), step = components_ * tile_;
  const double interference = pair.law.interference();
  for (int t = 0; t < N; ++t)
    wave_[t] = interference + grid_.values[size_t(t) * step + size_t(normal_) * tile_ + place];
  pair.normal.find_spans(wave_.data(), N);
}

/// Walls u -+ R with R = (limit + mu N) / kt, about the mean of u, and the play between them: where they turn
/// is looked for only if they can come to the slider.
void ContinuousContact::find_play(Pair& pair, int tangent, int place) {
  Tangent& now = pair.tangents[tangent];
  contact::LinearPair const& law = pair.law;
  const double reach = law.reach();
  now.walls.radius.q.assign(harmonics_.moving() + 1, 0.0);
  now.walls.radius.q[0] = law.friction_limit / law.tangential_stiffness;
  if (reach > 0) now.walls.radius = sum(now.walls.radius, reach, pair.normal.approach);
  now.play.clear();
  if (!law.rubs() || !pair.normal.touches()) return;
  const double rest = law.slider[tangent] - now.mean;
  if (pair.normal.closed &&
      std::abs(rest) + now.u.bound() + now.walls.radius.bound() < now.walls.radius.q[0].real())
    return now.play.stand(rest);
  now.walls.lower = sum(now.u, -1, now.walls.radius), now.walls.upper = sum(now.u, 1, now.walls.radius);
  const int N = times_.samples(), step = components_ * tile_;
  double const* rates = grid_.rates.data() + place;
  for (const int side : {1, -1}) {
    std::vector<Root>& turns = now.walls.turns[side > 0 ? 0 : 1];
    if (side < 0 && reach == 0) {
      turns = now.walls.turns[0];  // the walls are 2 R apart
      for (Root& turn : turns) turn.value += 2 * now.walls.radius.q[0].real();
      continue;
    }
    for (int t = 0; t < N; ++t) {
      double const* rate = rates + size_t(t) * step;
      wave_[t] = rate[size_t(tangent + (normal_ >= 0)) * tile_];
      if (reach > 0) wave_[t] -= side * reach * rate[size_t(normal_) * tile_];
    }
    find_roots(now.walls.wall(side), 1, wave_.data(), N, turns);
  }
  if (pair.normal.closed)
    now.play.close(now.walls, rest);
  else
    now.play.close(now.walls, pair.normal.spans);
}

/// T' = kt u_t' in stick, +- mu kn u_n' in slip.
void ContinuousContact::tangential_force(Pair const& pair, Tangent const& now, double* F) const {
  contact::LinearPair const& law = pair.law;
  const double kt = law.tangential_stiffness;
  if (now.play.stuck) {
    add_series(harmonics_, now.u, kt, F);
    add_mean(harmonics_, -kt * now.play.sticks[0].slider, F);
    return;
  }
  Indicator stick(harmonics_), slip(harmonics_);
  Arc arc;
  for (Play::Stick const& piece : now.play.sticks) {
    arc.set(2 * harmonics_.highest(), piece.begin, piece.length);
    stick.add(arc, 1);
    const double limit = kt * now.walls.radius.at(piece.begin).d[0];
    const double area = piece.share * limit * piece.length + kt * arc.integral_from_begin(now.u);
    add_mean(harmonics_, area / period, F);
  }
  stick.add_force(now.u, kt, F);
  const double slope = law.friction_coefficient * law.normal_stiffness;
  for (Play::Slip const& piece : now.play.slips) {
    add_mean(harmonics_, piece.side * law.friction_limit * piece.length / period, F);
    if (slope == 0) continue;
    arc.set(2 * harmonics_.highest(), piece.begin, piece.length);
    slip.add(arc, piece.side);
    add_mean(harmonics_, piece.side * slope * arc.integral(pair.normal.approach) / period, F);
  }
  if (slope > 0) slip.add_force(pair.normal.approach, slope, F);
}

}  // namespace fretwave::hb
