/// What is read from friction on a circle in continuous time: states, samples, work and slip.
#include <algorithm>
#include <cmath>

#include "hb/circular_contact.h"
#include "scramble.h"

namespace fretwave::hb {

double CircularContact::mean_stiffness(int number, int component) const {
  Pair const& pair = pairs_[number];
  if (component == 0) return pair.normal.mean_stiffness();
  double length = pair.slider.stands() ? period : 0;
  for (auto const& piece : pair.slider.path.sticks) length += piece.length;
  return pair.law.tangential_stiffness * length / period;
}

double CircularContact::unclosed() const {
  double most = 0;
  for (Pair const& pair : pairs_) most = std::max(most, pair.slider.unclosed);
  return most;
}

namespace {

std::uint64_t number(size_t pair, bool round, NormalContact const& normal) {
  return scrambled(scrambled(2 * pair + round) + normal.sequence());
}

}  // namespace

/// By how often a pair opens. Slip turns within its piece, and of hundreds of pairs one begins to slip at
/// every step: what that bends is no corner to be walked to. Seen finely it is one: a slider that opposite
/// discs hold lies in a corner of the lens they have in common, and that closes as the root of the distance
/// to where it begins to go round.
std::uint64_t CircularContact::piece(bool finely) const {
  std::uint64_t sum = 0;
  for (size_t k = 0; k < pairs_.size(); ++k)
    sum += number(k, finely && pairs_[k].slider.kind == SliderPeriod::Kind::cycles, pairs_[k].normal);
  return sum;
}

/// Without marching sliders, which takes most of a force's time.
std::optional<std::uint64_t> CircularContact::piece_of(double const* U, bool finely) const {
  if (finely) return {};
  std::uint64_t sum = 0;
  NormalContact normal;
  for (size_t k = 0; k < pairs_.size(); ++k, U += size()) {
    if (!std::all_of(U, U + size(), [](double a) { return std::isfinite(a); })) return {};
    take(U, law_.linear_pair(int(k)), normal);
    sum += number(k, false, normal);
  }
  return sum;
}

void CircularContact::sample(int samples, double const* u, double const*, double* f) const {
  const size_t n = pairs_.size(), step = 3 * n;
  std::fill_n(f, size_t(samples) * step, 0.0);
  for (size_t k = 0; k < n; ++k) {
    Pair const& pair = pairs_[k];
    contact::LinearPair const& law = pair.law;
    for (int t = 0; t < samples; ++t)
      f[t * step + k] = std::max(0.0, law.load + law.normal_stiffness * u[t * step + k]);
    const auto hold = [&](size_t t, double const* w) {
      double* now = f + t * step + k;
      double arm[2], size = 0;
      for (int c = 0; c < 2; ++c) {
        arm[c] = law.tangential_stiffness * (u[t * step + (c + 1) * n + k] - pair.mean[c] - w[c]);
        size = std::hypot(size, arm[c]);
      }
      const double limit = law.friction_coefficient * now[0], share = size > limit ? limit / size : 1;
      for (int c = 0; c < 2; ++c) now[(c + 1) * n] = share * arm[c];
    };
    if (pair.slider.stands())
      for (int t = 0; t < samples; ++t) hold(t, pair.slider.w);
    for (auto const& piece : pair.slider.path.sticks)
      for_samples(samples, piece.begin, piece.length, [&](size_t t, double) { hold(t, piece.w); });
    for (auto const& piece : pair.slider.path.slips)
      for_samples(samples, piece.begin, piece.length, [&](size_t t, double tau) {
        const auto e = SweptSlider::direction(pair.disc, piece, tau);
        double* now = f + t * step + k;
        for (int c = 0; c < 2; ++c) now[(c + 1) * n] = law.friction_coefficient * now[0] * e[c];
      });
  }
}

/// Over slip the slider moves by l = u'.e - R': its path, the work mu N l, and Archard's N l.
void CircularContact::measure(contact::Diagnosis& out, double) const {
  for (size_t k = 0; k < pairs_.size(); ++k) {
    contact::LinearPair const& law = pairs_[k].law;
    const bool loose = pairs_[k].slider.kind == SliderPeriod::Kind::loose;
    const double contact = pairs_[k].normal.length() / period;
    double way = 0, worn = 0, slip = 0;
    for (SweptSlider::Slip const& piece : pairs_[k].slider.path.slips) {
      slip += piece.length;
      for (int j = 0; j < Radau::stages; ++j) {
        const auto e = piece.direction(j);
        MovingDisc::Instant const& at = piece.at[j];
        const double moved = std::max(0.0, at.v[0] * e[0] + at.v[1] * e[1] - at.dR);
        const double now = piece.length * radau().weights[j] * moved;
        way += now, worn += now * at.R / law.reach() * law.normal_stiffness;
      }
    }
    contact::set_shares(out, k, contact, loose ? contact : slip / period);
    if (loose) continue;
    out.slip_path[k] = way, out.work[k] = law.friction_coefficient * worn;
    if (out.archard.size()) out.archard[k] = worn;
  }
}

}  // namespace fretwave::hb
