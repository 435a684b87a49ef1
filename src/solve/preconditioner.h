#pragma once
#include <string>

#include "error.h"
#include "petsc.h"

namespace fretwave::solve {

/// Approximate inverse of a bordered system, for the Krylov route.
class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  /// Factorise at y with the closing row; `SingularBlock` on every rank, or a failure, if that cannot be.
  /// Collective.
  virtual void build(Vec y, Vec row) = 0;
  /// Takes from y what is cheap to, and keeps the factors. Collective.
  virtual void follow(Vec) {}
  virtual void apply(Vec x, Vec z) = 0;
  /// Why the last build gave nothing to apply (a singular block), the same on every rank; empty if it did.
  virtual std::string failure() const { return {}; }
  /// What building costs, in Krylov iterations.
  virtual double build_cost() const = 0;
  /// One line for the log, with its memory once it is built.
  virtual std::string describe() const = 0;
};

}  // namespace fretwave::solve
