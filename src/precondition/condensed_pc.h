#pragma once
#include "precondition/harmonic_factors.h"
#include "solve/preconditioner.h"

namespace fretwave::precondition {

/// For models that are not reduced. With J = [A + B^T dD B, C; R, S], A one sparse block a harmonic
/// (`HarmonicFactors`), dD the contact's tangents less those inside A, (C, R, S) the scalars' columns, the
/// normalisation and the closing row: eliminating q = A^-1 (x - B^T dD u - C z) leaves a dense system in the
/// contact's relative motion u = B q and the scalars z,
///
///     [I + G dD, B A^-1 C; -R A^-1 B^T dD, S - R A^-1 C] (u, z) = (B A^-1 x, x_z - R A^-1 x),
///
/// G = B A^-1 B^T. It is solved exactly, so that A and G may be of another point of the branch: what is left
/// to the iteration is the change of the exponents since. A of the fundamental is made beside the point,
/// where it is not singular.
class CondensedPreconditioner : public solve::Preconditioner {
 public:
  explicit CondensedPreconditioner(HarmonicProblem&);
  void build(Vec y, Vec row) override;
  void apply(Vec x, Vec z) override;
  double build_cost() const override { return build_cost_; }
  std::string describe() const override;

 private:
  bool moved(Exponents const&) const;
  void factorise(Exponents, std::vector<PairTangents> const&);
  void gather_tangents(std::vector<PairTangents> const&);
  void border(Vec y, Vec row);
  void condense();
  void add_contact(std::vector<double>& T) const;
  void add_border(std::vector<double>& T) const;
  std::vector<double> contact_motion(double const* q) const;
  void subtract_force(double const* u, double* x) const;
  double along_row(int j, double const* q) const;

  HarmonicProblem& problem_;
  HarmonicFactors factors_;
  ContactRows rows_;
  ScatterHandle to_first_;
  VecHandle whole_;  ///< all unknowns on rank 0, none elsewhere
  int m_, scalars_, size_ = 0;
  size_t blocks_;  ///< harmonic coefficients, all of them on rank 0
  bool first_rank_;
  double build_cost_ = 0;
  Exponents made_at_;
  double made_in_ = 0;  ///< stiffness that force rows were measured in
  // All that follows on rank 0 only.
  std::vector<std::vector<complex>> G_;  ///< per harmonic
  std::vector<std::vector<double>> dD_;  ///< per pair, row-major
  std::vector<double> C_, AC_, R_, AR_;  ///< scalars' columns, A^-1 C, rows, A^-T R^T; blocks x scalars
  std::vector<double> S_;                ///< rows x columns, column-major
  std::vector<double> T_;                ///< factors of the condensed system
  std::vector<int> pivots_;
};

}  // namespace fretwave::precondition
