#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

/// Contact laws: pure C++, no PETSc, no MPI, no Fourier.
namespace fretwave::contact {

/// One period of relative motion of all pairs on this rank. Arrays are samples x components x pairs, pairs
/// innermost, so that loops over them are vectorised.
struct Motion {
  int samples = 0;  ///< samples held here (half a period when the motion is half-wave symmetric)
  int components = 0, pairs = 0;
  double const* u = nullptr;  ///< relative displacement [length]; null if the law ignores it
  double const* v = nullptr;  ///< relative velocity [length/s]; null if the law ignores it
  double step = 0;            ///< time between samples [s]
  std::size_t size() const { return std::size_t(samples) * components * pairs; }
};

/// What a force evaluation leaves for its linearisation.
struct Record {
  std::vector<double> df_du,
      df_dv;  ///< instantaneous tangents, samples x components x components x pairs; empty if zero
};

enum class Status : std::uint8_t { stick, slip, open };

/// What the tangential force stays within: nothing sharp, a circle over all tangents, or each its own
/// interval.
enum class Limit : std::uint8_t { none, circle, each };

/// How harmonic balance takes the harmonics of a law's force: from samples; or in continuous time, by the
/// pieces between its changes of state (`LinearPair`), the same with its two tangents on one circle, or by
/// panels graded towards steep changes (`VelocityLayer`).
enum class Integration : std::uint8_t { samples, pieces, circle, panels };

/// A tangential force this near to its limit has reached it. The only tolerance on it, of all laws.
constexpr double limit_tolerance = 1e-12;
inline bool at_limit(double force, double limit) { return force >= limit * (1 - limit_tolerance); }

/// What is read from a converged period; sums over the samples of the motion, per pair. The only place where
/// a law says whether a pair sticks, slips or is open.
struct Diagnosis {
  std::vector<Status> status;     ///< samples x pairs
  std::vector<double> work;       ///< dissipated energy [energy], pairs
  std::vector<double> slip_path;  ///< length of the slider's path [length], pairs
  /// Archard's integral of N |d slider| [energy], pairs (Laxalde et al. 2008, eq. 13); empty: not asked for.
  std::vector<double> archard = {};
  /// Distance to contact where open, 0 where closed [length], nan without a normal direction; samples x
  /// pairs; empty: not asked for.
  std::vector<double> gap = {};
  /// Of the period in stick, slip and open: 3 x pairs.
  std::vector<double> shares = {};
};

/// Of a diagnosis' shares those of one pair: in contact, and there in slip, of the period as 1. One that a
/// load at rest holds at its limit all the period is left its slip, though its slider never moves.
void set_shares(Diagnosis& diagnosis, size_t pair, double contact, double slip);

/// A pair whose force is linear in its motion but where it changes its state:
///   N = max(0, load + kn u_n),  T = kt (u_t - w),  |T| <= limit + mu N, each tangent by itself or both as
/// one vector.
struct LinearPair {
  double normal_stiffness = 0, load = 0;
  double tangential_stiffness = 0, friction_coefficient = 0, friction_limit = 0;
  double slider[2] = {};  ///< w at rest
  /// dR/du_n of the distance R at which the limit mu N holds the slider.
  double reach() const { return friction_coefficient * normal_stiffness / tangential_stiffness; }
  /// Of the two surfaces at u_n = 0 [length].
  double interference() const { return load / normal_stiffness; }
  bool rubs() const { return friction_coefficient > 0 || friction_limit > 0; }
};

/// A pair whose force follows its velocity alone, smooth but steep about zero: f(v) is analytic but beyond
/// v = +-i width, and constant to rounding where |v| >= end.
struct VelocityLayer {
  double width;                                          ///< [length/s]
  double end = std::numeric_limits<double>::infinity();  ///< [length/s]
  double slip = 0;  ///< |v| from which the pair slips [length/s], as `diagnose` has it
};

/// A contact law with its parameters for the pairs of this rank.
class Law {
 public:
  virtual ~Law() = default;
  virtual int components() const = 0;
  virtual int pairs() const = 0;
  virtual bool uses_displacement() const { return true; }
  virtual bool uses_velocity() const { return true; }
  /// The force depends on the path of the displacement (never on the velocity). Such a law is read on a
  /// period that its sliders close, of all such the one nearest to the rest state (from elsewhere the mean
  /// tangential force is arbitrary), in continuous time: it has `integration` and is not sampled.
  virtual bool hereditary() const { return false; }
  /// The static state the dynamics start from: relative displacement components x pairs, reached in one step
  /// from sliders that stand at zero, or at `from` (tangents x pairs).
  void rest(double const* u, std::vector<double> const& from = {}) {
    set_sliders(from.empty() ? std::vector<double>(sliders().size(), 0.0) : from);
    set_rest(u), owner_ = 0, ++version_;
  }
  /// Where the sliders stand at rest [length], tangents x pairs; none without memory.
  virtual std::vector<double> sliders() const { return {}; }
  /// Puts them there, as they are. For an `owner` who has put them there last, nothing is to be done (the
  /// same on every rank, as a comparison of the sliders would not be).
  void place(std::vector<double> const& sliders_at, unsigned owner = 0) {
    if (owner && owner == owner_) return;
    set_sliders(sliders_at), owner_ = owner, ++version_;
  }
  /// Component along the normal, > 0 closing; -1: the law has no normal direction.
  virtual int normal() const { return -1; }
  virtual Limit limit() const { return Limit::none; }
  /// Worn depths count as additional gap along its normal direction.
  virtual bool wears() const { return false; }
  /// `stand_off` widens its gaps.
  virtual bool stands_off() const { return wears(); }
  /// Worn depth of each pair [length], in place of what was set before; the rest state stays as it is. Null:
  /// as they are.
  void wear(double const* depth) {
    if (depth) set_wear(depth);
    ++version_;
  }
  /// Widens the gaps of all pairs by a distance [length] that is no wear; the rest state stays as it is.
  void stand_off(double distance) {
    if (distance == stand_off_) return;
    stand_off_ = distance;
    set_stand_off(distance);
    ++version_;
  }
  /// Grows whenever `rest`, `place`, `wear` or `stand_off` may have changed the force: a linearisation made
  /// before is of another law.
  unsigned version() const { return version_; }
  /// f(-u, -v) = -f(u, v): the motion may keep odd harmonics only.
  virtual bool odd() const { return false; }
  /// Stiffness of the contact when stuck in its rest state [force/length]: 0 for a pair that is open there,
  /// and along the tangents of one without friction, which never sticks; infinite means no relative motion at
  /// all.
  virtual double stuck_stiffness(int /*component*/, int /*pair*/) const {
    return std::numeric_limits<double>::infinity();
  }

  /// The same on all ranks. In continuous time harmonic balance asks a law for its constants, and of what
  /// follows for `diagnose` alone, for states and gaps at samples; paths and wear count there only where two
  /// tangents slip, all else is measured between samples: shares of the states, and the work too.
  virtual Integration integration() const { return Integration::samples; }
  virtual LinearPair linear_pair(int /*pair*/) const { return {}; }
  virtual VelocityLayer velocity_layer(int /*pair*/) const { return {1}; }
  /// Of a law by panels, which has one component: f and df/dv of a pair at `count` velocities.
  virtual void at_velocities(int /*pair*/, int /*count*/, double const* /*v*/, double* /*f*/,
                             double* /*df_dv*/) const {}

  /// Force on the pairs, and what its linearisation needs.
  virtual void force(Motion const&, double* f, Record&) const;
  /// The force where no linearisation follows; the record is left in any state.
  virtual void force_alone(Motion const& motion, double* f, Record& record) const {
    force(motion, f, record);
  }
  /// Linearised force for a motion perturbed by (du, dv), null where the law ignores it. Of the motion only
  /// the sizes are read here and in what follows but `diagnose`: the rest is in the record.
  virtual void product(Motion const&, Record const&, double const* du, double const* dv, double* df) const;
  virtual void diagnose(Motion const&, double const* f, Diagnosis&) const = 0;

 protected:
  virtual void set_rest(double const* /*u*/) {}
  virtual void set_sliders(std::vector<double> const& /*sliders*/) {}
  virtual void set_wear(double const* /*depth*/) {}
  virtual void set_stand_off(double /*distance*/) {}

 private:
  double stand_off_ = 0;
  unsigned version_ = 0, owner_ = 0;
};

/// Status and gap of all pairs for any motion and its forces.
Diagnosis states(Law const&, Motion const&, double const* f);

/// Work done against the force over the motion, per pair: sum of f . v dt (for laws that see the velocity).
void add_work(Motion const&, double const* f, std::vector<double>& work);

}  // namespace fretwave::contact
