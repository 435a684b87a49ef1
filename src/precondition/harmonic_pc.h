#pragma once
#include "precondition/pairwise_pc.h"

namespace fretwave::precondition {

/// Dense inverses of the harmonic blocks, for reduced models.
class HarmonicPreconditioner : public PairwisePreconditioner {
 public:
  explicit HarmonicPreconditioner(HarmonicProblem&);
  /// 8 n^3 flops a harmonic at the speed of matrix products, against 8 n^2 read from memory.
  double build_cost() const override { return n_ / 10.0; }
  std::string describe() const override;

 private:
  void prepare(Exponents const&, Vec y, Vec row) override;
  std::unique_ptr<HarmonicBlock> inverse(int harmonic, Exponents const&) const override;
  std::vector<complex> structure(int harmonic, Exponents const&) const;
  std::vector<complex> block(int harmonic, Exponents const&) const;
  std::vector<double> bordered_block(Exponents const&, Vec y, Vec row) const;

  std::vector<std::vector<double>> terms_;  ///< dense n x n, column-major, whole on every rank
  std::vector<double> bordered_;            ///< of the fundamental
};

}  // namespace fretwave::precondition
