#pragma once
#include <map>
#include <memory>

#include "wheel/mean_sector.h"
#include "wheel/wave_blocks.h"
#include "wheel/wheel_contact.h"

namespace fretwave::wheel {

/// Modes U of one nodal diameter of the tuned wheel whose pairs all stick, M U = K_s U theta, U^H K_s U = 1.
struct WaveBasis {
  std::vector<scomplex> U;             ///< dofs x modes, column-major
  std::vector<complex> Phi;            ///< B U, contact rows x modes
  std::vector<double> theta, damping;  ///< diagonals of U^H M U and U^H C U
  double damped_together = 0;          ///< largest damping of a mode by all others
};

/// The bases of a model's waves, made when first asked for and kept with it: every Newton uses the same.
class WaveBases {
 public:
  WaveBases(model::Model const&, MeanSector const&, std::vector<CirculantBlocks<double>> const& terms,
            WheelContact const&, std::vector<double> const& stuck);
  /// Null where the modes are no basis: a free motion with all pairs stuck, or springs far stiffer than the
  /// structure.
  std::shared_ptr<WaveBasis const> of_diameter(int d);

 private:
  using Kept = std::map<int, std::shared_ptr<WaveBasis const>>;
  std::shared_ptr<WaveBasis const> found_for(int d) const;

  model::Model const& model_;
  MeanSector const& mean_;
  std::vector<CirculantBlocks<double>> const& terms_;
  WheelContact const& contact_;
  std::vector<double> const& stuck_;
  std::shared_ptr<Kept> kept_;
};

}  // namespace fretwave::wheel
