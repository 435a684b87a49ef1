#pragma once
#include <stdexcept>
#include <string>

#include "petsc.h"

namespace fretwave::solve {

/// A factorisation met a zero pivot: the step fails, not the run. Thrown on every rank.
struct Singular : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Approximate inverse of a bordered system, for the Krylov route.
class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  /// Factorise at y with the closing row; `Singular` if that cannot be. Collective.
  virtual void build(Vec y, Vec row) = 0;
  virtual void apply(Vec x, Vec z) = 0;
  /// What building costs, in Krylov iterations.
  virtual double build_cost() const = 0;
  /// One line for the log, with its memory once it is built.
  virtual std::string describe() const = 0;
};

}  // namespace fretwave::solve
