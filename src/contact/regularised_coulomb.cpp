#include "contact/regularised_coulomb.h"

#include <array>
#include <bit>
#include <cmath>
#include <numbers>

#include "contact/vectorise.h"

namespace fretwave::contact {

RegularisedCoulomb::RegularisedCoulomb(std::vector<double> friction_limit,
                                       std::vector<double> regularisation_velocity)
    : limit_(std::move(friction_limit)), velocity_(std::move(regularisation_velocity)) {}

namespace {

constexpr int degree = 13;  // of the Taylor series of e^r - 1: r^14 / 14! < 1e-17
constexpr std::array<double, degree + 1> inverse_factorials = [] {
  std::array<double, degree + 1> out{1};
  for (int k = 1; k <= degree; ++k) out[k] = out[k - 1] / k;
  return out;
}();

/// tanh |x| = t / (t + 2), t = e^y - 1, y = 2 |x|: with y = n ln 2 + r, |r| < 0.35, t = 2^n (e^r - 1) + 2^n
/// - 1. To two roundings, at a third of what std::tanh takes, which has no loop.
FRETWAVE_INLINE double hyperbolic_tangent(double x) {
  constexpr double most = 44, round = 0x1.8p52;  // tanh 22 = 1; its last bits are an integer
  constexpr double high = 0x1.62e42feep-1, low = 0x1.a39ef35793c76p-33;  // ln 2
  const double twice = 2 * std::abs(x), y = twice > most ? most : twice;
  const double shifted = y * std::numbers::log2e + round, n = shifted - round;
  const double r = y - n * high - n * low;
  double e = inverse_factorials[degree];
#pragma GCC unroll 13
  for (int k = degree - 1; k >= 1; --k) e = e * r + inverse_factorials[k];
  const auto exponent = (std::bit_cast<std::uint64_t>(shifted) << 52) + std::bit_cast<std::uint64_t>(1.0);
  const double power = std::bit_cast<double>(exponent), t = power * (e * r) + (power - 1);
  return std::copysign(t / (t + 2), x);
}

FRETWAVE_VECTORISE
void friction(int count, double limit, double eps, double const* v, double* f, double* df_dv) {
#pragma omp simd
  for (int j = 0; j < count; ++j) {
    const double th = hyperbolic_tangent(v[j] / eps);
    f[j] = limit * th;
    df_dv[j] = limit / eps * (1 - th * th);
  }
}

constexpr double slips = 2;         // |v| / eps
constexpr double saturated = 16.5;  // 1 - tanh = 1e-14

}  // namespace

/// tanh has its poles at +-i pi / 2, 3 pi / 2, ...
VelocityLayer RegularisedCoulomb::velocity_layer(int pair) const {
  const double eps = velocity_[pair];
  return {.width = std::numbers::pi / 2 * eps, .end = saturated * eps, .slip = slips * eps};
}

/// f = R tanh(v/eps), df/dv = R/eps (1 - tanh^2)
void RegularisedCoulomb::at_velocities(int pair, int count, double const* v, double* f, double* df_dv) const {
  friction(count, limit_[pair], velocity_[pair], v, f, df_dv);
}

void RegularisedCoulomb::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs;
  record.df_dv.resize(motion.size());
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) {
      const size_t k = size_t(t) * n + i;
      at_velocities(i, 1, motion.v + k, f + k, record.df_dv.data() + k);
    }
}

void RegularisedCoulomb::diagnose(Motion const& motion, double const* f, Diagnosis& out) const {
  add_work(motion, f, out.work);
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < motion.pairs; ++i) {
      const double v = std::abs(motion.v[size_t(t) * motion.pairs + i]);
      const bool slipping = v > slips * velocity_[i];
      out.status[size_t(t) * motion.pairs + i] = slipping ? Status::slip : Status::stick;
      if (slipping) out.slip_path[i] += v * motion.step;
    }
}

Entry regularised_coulomb_entry() {
  return {.name = "regularised_coulomb",
          .doc = "mu N tanh(v/eps): Coulomb friction with constant normal load, regularised by a velocity",
          .components = 1,
          .parameters = {{.name = "friction_limit",
                          .unit = "force",
                          .doc = "sliding force mu N",
                          .role = Role::friction_limit,
                          .lower = 0},
                         {.name = "regularisation_velocity",
                          .unit = "length/s",
                          .doc = "eps; smaller is closer to Coulomb",
                          .role = Role::regularisation,
                          .lower = 0,
                          .strict = true}},
          .make = [](Parameters const& p) {
            return std::make_unique<RegularisedCoulomb>(p.at("friction_limit"),
                                                        p.at("regularisation_velocity"));
          }};
}

}  // namespace fretwave::contact
