#pragma once
#include "hb/swept_slider.h"

namespace fretwave::hb {

/// How a swept slider follows a perturbation of its motion, at fixed times: the times of its turns leave the
/// derivative of what is continuous there. A perturbation is a row of columns: by the coefficients of the
/// normal direction and of both tangents (m each), by the gap, by w where the path begins (two).
/// Stick: dw stands. At the end of stick dw's part along e is what keeps w at the edge; in slip d = R e,
/// dd = e dR + R e' dphi.
class SliderDerivative {
 public:
  using Row = std::vector<double>;
  /// Of w alone.
  SliderDerivative() = default;
  /// R = reach (normal displacement - gap) + ...
  SliderDerivative(Harmonics const& h, double reach)
      : harmonics_(&h), m_(h.block_size()), reach_(reach), wave_(m_), rate_(m_) {}
  int columns() const { return 3 * m_ + 3; }

  /// Over a path from its begin, where w moves by its own two columns. What it leaves: dw of each stick (2 x
  /// columns each), and of slip, node by node, weights (nodes x m) that make the integrals of arm and waves
  /// over pi, and dd (nodes x 2 columns).
  void go(SweptSlider const&, MovingDisc const&);
  std::vector<Row> sticks;
  Row weights, arms;
  int nodes = 0;
  /// dw where the path ends.
  double const* end() const { return dw_.data(); }
  /// A = dw(end) / dw(begin) alone.
  void of_start(SweptSlider const&, MovingDisc const&, double (&A)[2][2]);
  /// row += a.du + b dR at the time of `set_time`; of their rates.
  void add_value(double* row, double const* a, double b) const;
  void add_rate(double* row, double const* a, double b) const;
  void set_time(double tau);

 private:
  void begin_slip(SweptSlider::Slip const&, MovingDisc const&);
  void slip(SweptSlider::Slip const&, MovingDisc const&, bool ends);
  void set_node(PanelGrid const&, int node);

  Harmonics const* harmonics_ = nullptr;
  int m_ = 0;
  double reach_ = 0;
  std::vector<double> wave_, rate_;  ///< at the time that was set
  Row dw_, dphi_, dp_, dR_;          ///< the last two: of a panel's nodes
};

}  // namespace fretwave::hb
