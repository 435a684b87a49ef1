#pragma once
#include "hb/continuous_force.h"
#include "hb/graded_panels.h"
#include "hb/pair_blocks.h"

namespace fretwave::hb {

/// Force that follows the velocity alone, f(v) with steep layers where v passes zero
/// (contact::VelocityLayer): its harmonics are integrals over panels graded towards the roots of v, to near
/// rounding however thin the layers are. So F(U) has no error of sampling and is as smooth as f is.
class VelocityForce : public ContinuousForce {
 public:
  VelocityForce(Harmonics const&, contact::Law const&);

  void force(double const* U, double const* V, double* F) override;
  void blocks(Exponents const&, double* D) override;
  void product(double const* dU, double const* dV, double* dF) override;
  /// It has no gaps.
  void gap_product(double const* dgap, double* dF) override;
  /// Mean of df/dv, times the ratio of velocity and displacement.
  double mean_stiffness(int pair, int component) const override;
  /// It is smooth.
  std::uint64_t piece(bool) const override { return 0; }
  std::optional<std::uint64_t> piece_of(double const*, bool) const override { return 0; }
  void sample(int samples, double const* u, double const* v, double* f) const override;
  void measure(contact::Diagnosis&, double omega) const override;

 private:
  /// Panels seen from one time, and df/dv at their nodes.
  struct Part {
    SeriesFrom v;
    std::vector<Panel> panels;
    std::vector<Panel::Values> slopes;
  };
  struct Pair {
    Series v;
    std::vector<Part> parts;
    double share = 1;  ///< of the period that the parts stand for: the other half is its mirror image
    double mean_slope = 0, rate = 0;
  };
  size_t block(int pair) const { return size_t(pair) * harmonics_.block_size(); }
  void divide(Pair&, int number);
  std::vector<double> roots(Series const& v, int number);
  bool mirrored(std::vector<double> const& roots) const;
  void integrate(Pair&, int number, double* F);
  void linearise();
  double slip_path(Pair const&, double threshold) const;

  Harmonics harmonics_, times_;
  contact::Law const& law_;
  bool half_wave_;
  int tile_, tile_at_ = -1;  ///< its size; the first pair of the one that is evaluated
  FourierTransform transform_;
  Grading grading_;
  std::vector<double> blocks_, values_;  ///< of a tile, at the times of the grid
  std::vector<double> V_, F_;            ///< of the last force
  std::vector<Pair> pairs_;
  PairBlocks slopes_;  ///< dF/dV
};

}  // namespace fretwave::hb
