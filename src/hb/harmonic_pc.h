#pragma once
#include "hb/harmonic_problem.h"
#include "hb/pair_correction.h"
#include "solve/preconditioner.h"

namespace fretwave::hb {

/// One block P_n per harmonic, Z_n + the contact's coupling of the harmonic with itself; the fundamental's is
/// inverted with the scalars' columns, the normalisation and the closing row, without which it is singular at
/// an eigenvalue (DESIGN fact 5). What the contact couples between harmonics follows pair by pair
/// (`PairCorrection`). Dense, for reduced models: every rank inverts its share of the harmonics and corrects
/// its pairs.
class HarmonicPreconditioner : public solve::Preconditioner {
 public:
  explicit HarmonicPreconditioner(HarmonicProblem&);
  void build(Vec y, Vec row) override;
  void apply(Vec x, Vec z) override;
  /// 8 n^3 flops a harmonic at the speed of matrix products, against 8 n^2 read from memory.
  double build_cost() const override { return n_ / 10.0; }
  std::string describe() const override;

 private:
  /// A pair of any rank: its rows of B and where its per-harmonic blocks begin.
  struct Pair {
    int components;
    size_t first_weight, end_weight, first_block;
  };
  bool mine(int harmonic) const { return harmonic % size_ == rank_; }
  std::vector<Rotation> gather_contact(std::vector<PairTangents> const&);
  std::vector<complex> structure(int harmonic, Exponents const&) const;
  std::vector<complex> block(int harmonic, Exponents const&) const;
  std::vector<double> bordered_block(Exponents const&, Vec y, Vec row) const;
  template <class Visit>
  void for_contact(int harmonic, Visit) const;
  std::vector<Rotation> compliance() const;
  void correct_pairs(std::vector<PairTangents>&&);
  std::vector<double> solve(std::vector<double> const& x) const;
  std::vector<double> correction(std::vector<double> const& y) const;

  HarmonicProblem& problem_;
  int n_, m_, scalars_, rank_, size_;
  std::vector<std::vector<double>> terms_;  ///< dense n x n, column-major, whole on every rank
  std::vector<Weight> weights_;             ///< of all ranks' pairs
  std::vector<Pair> pairs_;
  int first_pair_ = 0;  ///< of this rank
  std::vector<Rotation> tangents_;
  std::vector<std::unique_ptr<HarmonicInverse>> inverses_;  ///< null for other ranks' harmonics
  std::vector<PairCorrection> corrections_;                 ///< of this rank's pairs
};

}  // namespace fretwave::hb
