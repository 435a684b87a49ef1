#pragma once
#include "solve/problem.h"

namespace fretwave::solve {

/// A problem closed to a square system by one linear row, row . y = value: a fixed parameter or a
/// pseudo-arclength.
class Bordered {
 public:
  explicit Bordered(Problem&);
  Bordered(Bordered const&) = delete;
  Problem& problem() const { return problem_; }
  /// The closing row; the vector is copied.
  void close(Vec row, double value);
  Vec row() const { return row_; }
  void residual(Vec y, Vec g);
  void product(Vec y, Vec dy, Vec dg);
  void transposed_product(Vec y, Vec dg, Vec dy);
  /// Matrix for the direct route: dense on one rank when small (LAPACK pivots, no symbolic cost), AIJ
  /// otherwise.
  MatHandle matrix();
  void assemble(Vec y, Mat J);

 private:
  Problem& problem_;
  VecHandle row_, equations_;
  double value_ = 0;
  std::vector<PetscInt> rows_, cols_;
  std::vector<double> v_;
  PetscInt problem_entries_ = 0;
  bool dense_ = false;
};

/// J(y) of the problem alone, N x (N + 1) AIJ. Collective.
MatHandle assemble(Problem&, Vec y);
/// The same in a matrix that this made. Collective.
void assemble(Problem&, Vec y, Mat J);

}  // namespace fretwave::solve
