#pragma once
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "petsc.h"
#include "text.h"

/// Newton and continuation; knows neither harmonics nor contact.
namespace fretwave::solve {

/// A scalar whose change of sign along a branch is an event to be located.
struct TestFunction {
  std::string name;
  double value;
  bool falling_only = false;  ///< an event only where it goes from positive to negative (a maximum)
  /// Some quantity is stationary there (a fold, a peak): misplacing the event changes it by the square only.
  bool extremum = false;
};

/// Sign of a test function's value; none (0) next to zero.
inline int test_sign(double value) {
  constexpr double noise = 1e-11;
  return value > noise ? 1 : value < -noise ? -1 : 0;
}

/// N equations in N + 1 unknowns y = (u, p): the parameter p is the last entry of y, on the last rank.
/// A rank's part of y is its part of the residual, and one entry more on the last rank.
class Problem {
 public:
  Problem() = default;
  Problem(Problem const&) = delete;
  virtual ~Problem() = default;
  virtual MPI_Comm comm() const = 0;
  virtual PetscInt local_equations() const = 0;

  /// r(y). Collective.
  virtual void residual(Vec y, Vec r) = 0;
  /// Rounding error to expect in r(y): Newton stops there. Collective.
  virtual double rounding(Vec /*y*/) { return 0; }
  /// Number of the smooth piece of the equations that y lies on: another one beyond a kink, of those too that
  /// are many and hardly bend the branch if `finely`. Collective.
  virtual std::uint64_t piece(Vec /*y*/, bool /*finely*/ = false) { return 0; }
  /// Measures the rows in the forces that act at y from now on; true if that changed them. Collective.
  virtual bool scale(Vec /*y*/) { return false; }
  /// Relative change of what is read from y by a small step dy; 0 if nothing is known. Collective.
  virtual double effect(Vec /*y*/, Vec /*dy*/) { return 0; }
  /// Share of a step from y that its equations can bear: beyond it numbers overflow. Collective.
  virtual double bearable(Vec /*y*/, Vec /*dy*/) { return 1; }
  /// Above it no residual is accepted, nor any where rounding alone may leave as much: where stiff pairs
  /// change between stick and slip within a sample, a tiny step tells nothing of the forces that are left.
  virtual double largest_residual() const { return std::numeric_limits<double>::infinity(); }
  /// dr = J(y) dy, J is N x (N + 1). Collective.
  virtual void product(Vec y, Vec dy, Vec dr) = 0;
  /// dy = J(y)^T dr, the adjoint; `InputError` for a problem that has none. Collective.
  virtual void transposed_product(Vec y, Vec dr, Vec dy);
  /// Global places of J's entries contributed by this rank, and their values in the same order (places may
  /// repeat: values add).
  virtual void pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) = 0;
  virtual void values(Vec y, std::span<double> v) = 0;

  /// About how many entries J has; 0 if it is dense.
  virtual double jacobian_entries() const { return 0; }

  /// Why J is nearly singular at y, where Newton's step is dy; empty if nothing is known. Collective.
  virtual std::string explain(Vec /*y*/, Vec /*dy*/) { return {}; }

  /// Diagonal weights of the arclength's inner product at y.
  virtual void metric(Vec y, Vec weights) = 0;
  /// Event functions at a point of the branch with its unit tangent. Collective.
  virtual std::vector<TestFunction> tests(Vec /*y*/, Vec /*tangent*/) { return {}; }
  /// What users call the parameter (an amplitude, a frequency) from the entry of y, and back.
  virtual double parameter_value(double entry) const = 0;
  virtual double parameter_entry(double value) const = 0;
  /// A value of the parameter in words.
  virtual std::string parameter_text(double value) const { return short_text(value); }
  /// Why a solution cannot be a point of the branch (a frequency below zero); nothing if it can. Collective.
  virtual std::string impossible(Vec /*y*/) { return {}; }
  /// Why a solution y is none but for rounding, which alone bears its part along dy (y itself or the branch's
  /// unit tangent there): the branch ends before it; nothing if it is one. Collective.
  virtual std::string adrift(Vec /*y*/, Vec /*dy*/) { return {}; }
  /// Why the branch leads nowhere from here (it grows without bound); nothing while it does. Collective.
  virtual std::string beyond(Vec /*y*/) { return {}; }

  /// Whether the motion at y gains or loses energy. One that does not goes over into another mode where an
  /// internal resonance leads it there, and never comes back. Collective.
  virtual bool damped(Vec /*y*/) { return true; }

  bool last_rank() const { return comm_rank(comm()) == comm_size(comm()) - 1; }
  VecHandle equations() const { return make_vector(comm(), local_equations()); }
  VecHandle unknowns() const { return make_vector(comm(), local_equations() + (last_rank() ? 1 : 0)); }
};

/// Last entry of a vector, on every rank. Collective.
double last_entry(Vec y);
void set_last_entry(Vec y, double value);

}  // namespace fretwave::solve
