#pragma once
#include "hb/harmonic_problem.h"
#include "solve/preconditioner.h"

namespace fretwave::hb {

/// One block per harmonic, Z_n + period-averaged contact tangent, in complex form; the fundamental's block is
/// factorised with the scalars' columns, the normalisation and the closing row, without which it is singular
/// at an eigenvalue (DESIGN fact 5). Dense (LAPACK), for reduced models: every rank factorises its share of
/// the harmonics.
class HarmonicPreconditioner : public solve::Preconditioner {
 public:
  explicit HarmonicPreconditioner(HarmonicProblem&);
  void build(Vec y, Vec row) override;
  void apply(Vec x, Vec z) override;

 private:
  struct Factor {
    int harmonic;  ///< place among the retained orders
    std::vector<complex> lu;
    std::vector<int> pivots;
  };
  bool mine(int harmonic) const { return harmonic % size_ == rank_; }
  std::vector<complex> block(int harmonic, Exponents const&) const;
  void factorise(int harmonic, Exponents const&);
  void factorise_fundamental(Exponents const&, Vec y, Vec row);
  void solve(Factor const&, double const* x, double* z);
  void solve_fundamental(double const* x, double* z);

  HarmonicProblem& problem_;
  int n_, m_, scalars_, rank_, size_;
  std::vector<std::vector<double>> terms_;  ///< dense n x n, column-major, whole on every rank
  std::vector<double> contact_stiffness_, contact_damping_;
  std::vector<Factor> factors_;
  std::vector<double> fundamental_;  ///< real LU of (qc, qs, z)
  std::vector<int> fundamental_pivots_;
};

}  // namespace fretwave::hb
