#include "hb/continuous_contact.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "hb/indicator.h"
#include "lapack.h"
#include "scramble.h"

namespace fretwave::hb {

namespace {

constexpr double period = 2 * std::numbers::pi;
constexpr int tile = 32;  // pairs whose times fit the cache

/// Times at which changes are looked for first: 8 and more in the shortest wave, so that find_roots seldom
/// has to look between them. They are not the contact's samples: what is found does not depend on them.
Harmonics search_times(Harmonics const& h) { return {h.orders(), 8 * (h.highest() + 1)}; }

/// q_k of a dof's block, about its mean.
Series series(Harmonics const& h, double const* block) {
  Series out{std::vector<complex>(h.highest() + 1)};
  for (int i = 0; i < h.count(); ++i)
    if (h.orders()[i]) out.q[h.orders()[i]] = {block[h.offset(i)], -block[h.offset(i) + 1]};
  return out;
}

double mean(Harmonics const& h, double const* block) { return h.orders()[0] == 0 ? block[0] : 0.0; }

/// a + factor b
Series sum(Series a, double factor, Series const& b) {
  for (size_t k = 0; k < a.q.size(); ++k) a.q[k] += factor * b.q[k];
  return a;
}

void add_series(Harmonics const& h, Series const& p, double factor, double* F) {
  for (int i = 0; i < h.count(); ++i)
    if (const int n = h.orders()[i]) {
      F[h.offset(i)] += factor * p.q[n].real();
      F[h.offset(i) + 1] -= factor * p.q[n].imag();
    }
}

void add_mean(Harmonics const& h, double value, double* F) {
  if (h.orders()[0] == 0) F[0] += value;
}

/// 1, cos k tau, sin k tau
std::vector<double> waves(Harmonics const& h, double tau) {
  std::vector<double> out(h.block_size(), 1.0);
  for (int i = 0; i < h.count(); ++i)
    if (const int n = h.orders()[i])
      out[h.offset(i)] = std::cos(n * tau), out[h.offset(i) + 1] = std::sin(n * tau);
  return out;
}

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

void ContinuousContact::force(double const* U, double* F) {
  linearised_ = false;
  for (int first = 0; first < int(pairs_.size()); first += tile_) {
    const int pairs = std::min(tile_, int(pairs_.size()) - first);
    evaluate(U, first, pairs);
    for (int i = 0; i < pairs; ++i) {
      Pair& pair = pairs_[first + i];
      take(U, first + i);
      find_spans(pair, i);
      std::fill_n(F + block(first + i, 0), block(1, 0), 0.0);
      if (normal_ >= 0) normal_force(pair, F + block(first + i, normal_));
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
  if (normal_ >= 0) {
    double const* u = U + block(number, normal_);
    pair.approach = series(harmonics_, u);
    pair.approach.q[0] = pair.law.load / pair.law.normal_stiffness + mean(harmonics_, u);
  }
  for (size_t t = 0; t < pair.tangents.size(); ++t) {
    double const* u = U + block(number, int(t) + (normal_ >= 0));
    pair.tangents[t].u = series(harmonics_, u);
    pair.tangents[t].mean = mean(harmonics_, u);
  }
}

/// When the pair is closed: between the roots of its approach.
void ContinuousContact::find_spans(Pair& pair, int place) {
  pair.spans.clear(), pair.closed = true;
  if (normal_ < 0) return;
  const int N = times_.samples(), step = components_ * tile_;
  const double load = pair.law.load / pair.law.normal_stiffness;
  for (int t = 0; t < N; ++t)
    wave_[t] = load + grid_.values[size_t(t) * step + size_t(normal_) * tile_ + place];
  std::vector<Root> roots;
  find_roots(pair.approach, 0, wave_.data(), N, roots);
  pair.closed = roots.empty() && wave_[0] > 0;
  for (size_t i = 0; i < roots.size(); ++i) {
    if (!roots[i].rising) continue;
    const double end = i + 1 < roots.size() ? roots[i + 1].at : roots[0].at + period;
    pair.spans.push_back({roots[i].at, end - roots[i].at});
  }
}

/// Walls u -+ R with R = (limit + mu N) / kt, about the mean of u, and the play between them.
void ContinuousContact::find_play(Pair& pair, int tangent, int place) {
  Tangent& now = pair.tangents[tangent];
  contact::LinearPair const& law = pair.law;
  const double reach = law.friction_coefficient * law.normal_stiffness / law.tangential_stiffness;
  now.walls.radius.q.assign(harmonics_.highest() + 1, 0.0);
  now.walls.radius.q[0] = law.friction_limit / law.tangential_stiffness;
  if (reach > 0) now.walls.radius = sum(now.walls.radius, reach, pair.approach);
  now.play.clear();
  if (!law.rubs() || !(pair.closed || pair.spans.size())) return;
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
  if (pair.closed)
    now.play.close(now.walls, law.slider[tangent] - now.mean);
  else
    now.play.close(now.walls, pair.spans);
}

/// N' = kn u_n' where closed.
void ContinuousContact::normal_force(Pair const& pair, double* F) const {
  const double kn = pair.law.normal_stiffness;
  if (pair.closed) {
    add_series(harmonics_, pair.approach, kn, F);
    add_mean(harmonics_, kn * pair.approach.q[0].real(), F);
    return;
  }
  Indicator closed(harmonics_);
  Arc arc;
  for (Span const& span : pair.spans) {
    arc.set(2 * harmonics_.highest(), span.begin, span.length);
    closed.add(arc, 1);
    add_mean(harmonics_, kn * arc.integral(pair.approach) / period, F);
  }
  closed.add_force(pair.approach, kn, F);
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
    add_mean(harmonics_, piece.side * slope * arc.integral(pair.approach) / period, F);
  }
  if (slope > 0) slip.add_force(pair.approach, slope, F);
}

void ContinuousContact::linearise() {
  if (linearised_) return;
  const size_t size = block(1, 0);
  D_.assign(pairs_.size() * size * size, 0.0), by_gap_.assign(pairs_.size() * size, 0.0);
  for (size_t k = 0; k < pairs_.size(); ++k) {
    if (normal_ >= 0) normal_blocks(pairs_[k], &D_[k * size * size], &by_gap_[k * size]);
    for (size_t t = 0; t < pairs_[k].tangents.size(); ++t)
      tangential_blocks(pairs_[k], int(t), &D_[k * size * size], &by_gap_[k * size]);
  }
  linearised_ = true;
}

/// Force is continuous where the state changes, so that the times of the changes leave the derivative.
void ContinuousContact::normal_blocks(Pair const& pair, double* D, double* by_gap) const {
  const double kn = pair.law.normal_stiffness;
  const size_t at = block(0, normal_), ld = block(1, 0);
  Indicator closed(harmonics_);
  if (pair.closed) closed.fill();
  Arc arc;
  for (Span const& span : pair.spans) {
    arc.set(2 * harmonics_.highest(), span.begin, span.length);
    closed.add(arc, 1);
  }
  closed.add_multiplication(kn, D + at * ld + at, ld);
  closed.add_coefficients(-kn, by_gap + at);
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
    const std::vector<double> wave = waves(harmonics_, piece.begin);
    const double share = piece.share * slope / kt;
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

std::vector<double> const& ContinuousContact::blocks() {
  linearise();
  return D_;
}

void ContinuousContact::product(double const* dU, double* dF) {
  linearise();
  const int size = int(block(1, 0)), step = 1;
  const double one = 1, zero = 0;
  for (size_t k = 0; k < pairs_.size(); ++k)
    dgemv_("T", &size, &size, &one, &D_[k * size * size], &size, dU + k * size, &step, &zero, dF + k * size,
           &step);
}

void ContinuousContact::gap_product(double const* dgap, double* dF) {
  linearise();
  const size_t size = block(1, 0);
  for (size_t k = 0; k < by_gap_.size(); ++k) dF[k] = by_gap_[k] * dgap[k / size];
}

/// By the states that follow each other in the period, wherever it begins.
std::uint64_t ContinuousContact::piece() const {
  std::uint64_t sum = 0;
  for (size_t k = 0; k < pairs_.size(); ++k) {
    Pair const& pair = pairs_[k];
    const std::uint64_t own = scrambled(k);
    sum += scrambled(own + (pair.closed ? 1 : 2 + pair.spans.size()));
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

void ContinuousContact::sample(int samples, double const* u, double* f) const {
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
      /// Runs body(t) for the samples of a piece.
      const auto each = [samples](double begin, double length, auto body) {
        const double first = std::ceil(begin * samples / period);
        const double end = std::ceil((begin + length) * samples / period);
        for (double t = first; t < end; ++t) {
          const int place = int(t) % samples;
          body(size_t(place < 0 ? place + samples : place));
        }
      };
      for (auto const& piece : now.play.sticks)
        each(piece.begin, piece.length, [&](size_t t) {
          const double force = law.tangential_stiffness * (u[t * step + at] - now.mean - piece.slider);
          f[t * step + at] = std::clamp(force, -limit[t], limit[t]);
        });
      for (auto const& piece : now.play.slips)
        each(piece.begin, piece.length, [&](size_t t) { f[t * step + at] = piece.side * limit[t]; });
    }
  }
}

void ContinuousContact::measure(contact::Diagnosis& out) const {
  std::ranges::fill(out.work, 0.0);
  for (size_t k = 0; k < pairs_.size(); ++k) {
    contact::LinearPair const& law = pairs_[k].law;
    // what two tangents do together is left as it was sampled
    const auto slips = [](Tangent const& now) { return now.play.slips.size() > 0; };
    const bool straight = std::ranges::count_if(pairs_[k].tangents, slips) < 2;
    if (straight) out.slip_path[k] = 0;
    if (straight && out.archard.size()) out.archard[k] = 0;
    for (Tangent const& now : pairs_[k].tangents)
      for (Play::Slip const& piece : now.play.slips) {
        if (straight) out.slip_path[k] += piece.path;
        out.work[k] += law.friction_limit * piece.path;
        if (law.friction_coefficient == 0) continue;
        const Arc arc(2 * harmonics_.highest(), piece.begin, piece.length);
        const double along = integral(arc, pairs_[k].approach, now.walls.wall(piece.side));
        const double wear = std::max(0.0, piece.side * law.normal_stiffness * along);
        out.work[k] += law.friction_coefficient * wear;
        if (straight && out.archard.size()) out.archard[k] += wear;
      }
  }
}

}  // namespace fretwave::hb
