#pragma once
#include <optional>

#include "wheel/wave_blocks.h"

namespace fretwave::wheel {

/// Every wave's block inverted, where waves have no bases: half of them where P_{N-d} = P_d^T. In single
/// precision, because reading them is what an application costs. Kept while the point moves little, but for
/// the fundamental: where a family of modes is dense some of its blocks are nearly singular, and a small
/// change matters.
class WaveInverses : public WaveBlocks {
 public:
  WaveInverses(HarmonicProblem&, MeanSector const&, std::vector<Circulant<SparseBlock>> terms, WheelContact&,
               std::vector<Wave> const&);
  void make(Point const&) override;
  std::vector<complex> solve(std::vector<complex> const& x, Forces const&) const override;
  double flops() const override;
  double applied_flops() const override { return 8.0 * n_ * n_ * double(waves_.size()); }
  double megabytes() const override { return sizeof(scomplex) * double(inverses_.size()) / 1e6; }
  std::string describe() const override { return "inverses"; }

 private:
  bool moved(Exponents const&) const;
  template <class Select>
  void invert(Select, Exponents const&);
  Circulant<std::vector<complex>> blocks(int harmonic, Exponents const&) const;
  void invert(size_t wave, Circulant<std::vector<complex>> const&);
  void set_compliances();
  bool mirrored(size_t wave) const { return waves_[wave].diameter > mean_.sectors() / 2; }
  bool transposed(size_t wave) const { return symmetric_ && mirrored(wave); }
  scomplex const* place(size_t wave) const { return inverses_.data() + at_[wave]; }
  /// V x for the leading `columns` entries of x, V the inverse of a wave's block.
  std::vector<scomplex> multiply(size_t wave, int columns, complex const* x) const;
  scomplex entry(size_t wave, int i, int j) const {
    return place(wave)[transposed(wave) ? size_t(i) * n_ + j : size_t(j) * n_ + i];
  }

  HarmonicProblem& problem_;
  MeanSector const& mean_;
  std::vector<Circulant<SparseBlock>> terms_;
  WheelContact& contact_;
  std::vector<Wave> waves_;
  int n_;
  bool symmetric_;
  std::vector<std::vector<complex>> B_;  ///< of own waves
  std::vector<size_t> at_;               ///< a wave's place
  std::vector<scomplex> inverses_;
  std::optional<Exponents> made_at_;
  double made_in_ = 0;  ///< stiffness that force rows were measured in
};

}  // namespace fretwave::wheel
