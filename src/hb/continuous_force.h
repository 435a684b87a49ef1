#pragma once
#include <algorithm>
#include <memory>

#include "contact/law.h"
#include "hb/harmonics.h"
#include "hb/pair_blocks.h"

namespace fretwave::hb {

/// The force of a rank's pairs at every time of the period: the motion is known there from its harmonics, and
/// the force's harmonics are integrals, not sums over samples. What `contact::Law::integration` names is how
/// they are taken. Blocks are those of Aft; V are those of the velocity, null where the law ignores it.
class ContinuousForce {
 public:
  virtual ~ContinuousForce() = default;
  virtual void force(double const* U, double const* V, double* F) = 0;
  /// dF/dU at the last force, with the velocity's share through s: pairs x (components m) x (components m).
  virtual void blocks(Exponents const&, double* D) = 0;
  virtual void product(double const* dU, double const* dV, double* dF) = 0;
  /// dF for gaps that grow by dgap (pairs) [length].
  virtual void gap_product(double const* dgap, double* dF) = 0;
  /// Of the last force over the period: the share of contact or stick, times its stiffness.
  virtual double mean_stiffness(int pair, int component) const = 0;
  /// Number of the sequences of states, whenever they begin: it changes where a piece comes or goes
  /// (`finely`: one of many pairs too).
  virtual std::uint64_t piece(bool finely) const = 0;
  /// That of U, where it is had without its force; the last one stays as it is.
  virtual std::optional<std::uint64_t> piece_of(double const* /*U*/, bool /*finely*/) const { return {}; }
  /// f (samples x components x pairs) of the last force at the samples u and v.
  virtual void sample(int samples, double const* u, double const* v, double* f) const = 0;
  /// Largest |w(T) - w(0)| of a slider in that period [length].
  virtual double unclosed() const { return 0; }
  /// Work, slip path and Archard's integral of the last force: integrals, not sums over samples; at this
  /// angular frequency [rad/s].
  virtual void measure(contact::Diagnosis&, double omega) const = 0;
};

/// One that follows the displacement alone: its derivatives are its pairs' blocks as they are.
class DisplacementForce : public ContinuousForce {
 public:
  void blocks(Exponents const&, double* D) override { std::ranges::copy(linearised().D, D); }
  void product(double const* dU, double const*, double* dF) override { linearised().multiply(dU, dF); }
  void gap_product(double const* dgap, double* dF) override { linearised().multiply_gaps(dgap, dF); }

 protected:
  /// Makes the blocks at the last force.
  virtual void linearise() = 0;
  PairBlocks blocks_;

 private:
  PairBlocks const& linearised() {
    if (!blocks_.made) linearise();
    return blocks_;
  }
};

/// Null where the law is sampled.
std::unique_ptr<ContinuousForce> continuous_force(Harmonics const&, contact::Law const&);

}  // namespace fretwave::hb
