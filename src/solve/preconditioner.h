#pragma once
#include <deque>
#include <functional>
#include <memory>
#include <string>

#include "error.h"
#include "petsc.h"

namespace fretwave::solve {

class Problem;

/// Approximate inverse of a bordered system, for the Krylov route.
class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  /// Factorise at y with the closing row; `SingularBlock`, on every rank, if that cannot be. Collective.
  virtual void build(Vec y, Vec row) = 0;
  /// Takes from y what is cheap to, and keeps the factors. Collective.
  virtual void follow(Vec) {}
  virtual void apply(Vec x, Vec z) = 0;
  /// What building costs, in Krylov iterations.
  virtual double build_cost() const = 0;
  /// One line for the log, with its memory once it is built.
  virtual std::string describe() const = 0;
};

/// A kind of preconditioner, to PETSc a type of PC: -<prefix>pc_type <type>. `solve` knows the kinds that
/// have been registered, and their problems know none.
struct PreconditionerKind {
  std::string type;
  std::string blocks;  ///< by which the option -<prefix>blocks asks for it; empty: by none
  /// The best of its problems' kinds, where it refuses none: the first to say so is taken. Collective.
  std::function<bool(Problem&)> suits;
  /// Why a problem cannot have it; empty if it can. Collective.
  std::function<std::string(Problem&)> refuses;
  /// Of a problem that it does not refuse. Collective.
  std::function<std::unique_ptr<Preconditioner>(Problem&)> make;
  /// For where another kind fails: what building it takes beside its factors [bytes]; none: it is no help.
  /// Collective.
  std::function<double(Problem&)> fallback_bytes = {};
  bool one_factor = false;  ///< of the model, for all its problems: none of a harmonic's own
};

/// Why a problem cannot have a kind, memory included. Collective.
std::string refusal(PreconditionerKind const&, Problem&);

/// Also to PETSc (PCRegister); those registered first are asked first.
void register_kind(PreconditionerKind);
std::deque<PreconditionerKind> const& kinds();
/// Null for PETSc's own types.
PreconditionerKind const* kind_of(std::string const& pc_type);

struct ChosenKind {
  PreconditionerKind const* kind = nullptr;  ///< null: the problem has none
  std::string note = {};                     ///< why not one that would have suited better
};
/// `blocks`: which are asked for, or auto; `InputError` where the problem cannot have them. Collective.
ChosenKind choose_kind(Problem&, std::string const& blocks);

}  // namespace fretwave::solve
