#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

/// Contact laws: pure C++, no PETSc, no MPI, no Fourier.
namespace fretwave::contact {

/// One period of relative motion of all pairs on this rank. Arrays are samples x components x pairs, pairs
/// innermost (DESIGN fact 7).
struct Motion {
  int samples = 0;  ///< samples held here (half a period when the motion is half-wave symmetric)
  int components = 0, pairs = 0;
  double const* u = nullptr;  ///< relative displacement [m]; null if the law ignores it
  double const* v = nullptr;  ///< relative velocity [m/s]; null if the law ignores it
  double step = 0;            ///< time between samples [s]
  std::size_t size() const { return std::size_t(samples) * components * pairs; }
};

/// What a force evaluation leaves for its linearisation.
struct Record {
  std::vector<double> df_du,
      df_dv;  ///< instantaneous tangents, samples x components x components x pairs; empty if zero
  std::vector<double> march;  ///< a hereditary law's own flags and directions along its march
};

enum class Status : std::uint8_t { stick, slip, open };

/// What is read from a converged period; sums over the samples of the motion, per pair.
struct Diagnosis {
  std::vector<Status> status;     ///< samples x pairs
  std::vector<double> work;       ///< dissipated energy [J], pairs
  std::vector<double> slip_path;  ///< length of the slider's path [m], pairs
};

/// A contact law with its parameters for the pairs of this rank.
class Law {
 public:
  virtual ~Law() = default;
  virtual int components() const = 0;
  virtual int pairs() const = 0;
  virtual bool uses_displacement() const { return true; }
  virtual bool uses_velocity() const { return true; }
  /// The force depends on the path. Such a law marches two periods from its rest state and is read on the
  /// second (DESIGN fact 3).
  virtual bool hereditary() const { return false; }
  /// The static state the dynamics start from: relative displacement components x pairs, reached from zero in
  /// one step.
  virtual void rest(double const* /*u*/) {}
  /// f(-u, -v) = -f(u, v): the motion may keep odd harmonics only.
  virtual bool odd() const { return false; }
  /// Stiffness of the contact when stuck in its rest state [N/m] (0 for a pair that is open there); infinite
  /// means no relative motion at all.
  virtual double stuck_stiffness(int /*component*/, int /*pair*/) const {
    return std::numeric_limits<double>::infinity();
  }

  /// Force on the pairs, and what its linearisation needs.
  virtual void force(Motion const&, double* f, Record&) const = 0;
  /// Linearised force for a motion perturbed by (du, dv); null where the law ignores it.
  virtual void product(Motion const&, Record const&, double const* du, double const* dv, double* df) const;
  virtual void diagnose(Motion const&, double const* f, Diagnosis&) const = 0;
};

/// Work done against the force over the motion, per pair: sum of f . v dt (for laws that see the velocity).
void add_work(Motion const&, double const* f, std::vector<double>& work);

}  // namespace fretwave::contact
