#pragma once
#include <string>

#include "solve/bordered.h"
#include "solve/preconditioner.h"

namespace fretwave::solve {

/// One application of LU factors: LAPACK's where J is dense, KLU's of the whole matrix on every rank where it
/// is small, MUMPS' otherwise. PETSc options may say otherwise afterwards.
void use_lu(KSP, Mat J);

/// Factors of J, here and not inside a solve: the wrappers of LAPACK and KLU raise an error at a zero pivot,
/// after which nothing but a reset is safe; MUMPS' tells it by PCGetFailedReason. False if singular.
/// Collective.
bool factorise(KSP, Mat J);

/// The whole bordered system assembled and factorised, for where the problem's own preconditioner fails.
class WholeFactor : public Preconditioner {
 public:
  /// Options under <prefix>whole_.
  WholeFactor(Bordered&, std::string const& prefix);
  void build(Vec y, Vec row) override;
  void apply(Vec x, Vec z) override;
  /// As of a sparse factor with right sides of its own length: it is kept while it serves.
  double build_cost() const override { return 30; }
  std::string describe() const override { return "factors of the whole system"; }
  /// What it would take [bytes]: filled twelvefold, as of three-dimensional meshes, or dense.
  static double bytes(Problem const&, double unknowns);

 private:
  Bordered& bordered_;
  MatHandle A_;
  KspHandle ksp_;
};

}  // namespace fretwave::solve
