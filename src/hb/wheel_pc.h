#pragma once
#include "hb/cyclic_inverse.h"
#include "hb/pairwise_pc.h"

namespace fretwave::hb {

/// For whole wheels: the harmonic blocks of the tuned wheel (terms and contact tangents averaged over the
/// sectors), diagonal in nodal diameters. A mistuned wheel keeps its differences for the iteration.
class WheelPreconditioner : public PairwisePreconditioner {
 public:
  explicit WheelPreconditioner(HarmonicProblem&);
  double build_cost() const override { return unit_ / 10.0; }
  std::string describe() const override {
    return std::to_string(sectors_) + " nodal diameters of " + std::to_string(unit_) + " dofs";
  }

 private:
  using Blocks = std::map<int, std::vector<double>>;  ///< by sectors ahead, column-major
  void prepare(Exponents const&, Vec y, Vec row) override;
  std::unique_ptr<HarmonicInverse> inverse(int harmonic, Exponents const&) const override;
  bool real_fundamental() const override { return false; }
  Blocks average(Mat A) const;
  std::unique_ptr<CyclicInverse> cyclic(int harmonic, Exponents const&) const;

  int unit_, sectors_;
  std::vector<Blocks> terms_;
  std::vector<std::vector<complex>> columns_, rows_;
  std::vector<double> corner_;
};

}  // namespace fretwave::hb
