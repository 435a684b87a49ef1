#pragma once
#include <array>
#include <map>
#include <memory>

#include "wheel/mean_sector.h"
#include "wheel/sector_factor.h"
#include "wheel/wave_blocks.h"
#include "wheel/wheel_contact.h"

namespace fretwave::wheel {

/// Modes U of one nodal diameter of the tuned wheel whose pairs all stick, M U = K_s U theta, U^H K_s U = 1.
///
/// All of them, or of large sectors the lowest, beside a factor: what forces move beside these is static,
/// K_s^-1 - U U^H (MacNeal, Comput. Struct. 1, 1971).
struct WaveBasis {
  std::vector<scomplex> U;             ///< dofs x modes, column-major
  std::vector<complex> Phi;            ///< B U, contact rows x modes
  std::vector<double> theta, damping;  ///< diagonals of U^H M U and U^H C U
  double damped_together = 0;          ///< largest damping of a mode by all others
  /// Beside the lowest modes: of K_s; K_s^-1 B^H, dofs x contact rows; B K_s^-1 B^H.
  std::shared_ptr<SectorFactor const> factor;
  std::vector<scomplex> static_shapes;
  std::vector<complex> static_compliance;
};

/// The bases of a model's waves, made when first asked for and kept with it: every Newton uses the same.
class WaveBases {
 public:
  WaveBases(model::Model const&, MeanSector const&, std::vector<Circulant<SparseBlock>> const& terms,
            WheelContact const&, std::vector<double> const& stuck);
  /// Makes those that are asked for on any rank and not kept, each on one rank, after the factor that they
  /// share. Collective.
  void prepare(std::vector<int> const& diameters, MPI_Comm);
  /// One that was asked for. Null where the modes are no basis: a free motion with all pairs stuck, or
  /// springs far stiffer than the structure.
  std::shared_ptr<WaveBasis const> of_diameter(int d) const { return kept_->bases.at(d); }

 private:
  struct Kept {
    std::shared_ptr<SectorFactor> factor;
    std::map<int, std::shared_ptr<WaveBasis const>> bases;
  };
  Circulant<SparseBlock> of_springs() const;
  bool large() const;
  std::shared_ptr<WaveBasis> shared(std::shared_ptr<WaveBasis>, int d, int from, MPI_Comm) const;
  std::shared_ptr<WaveBasis> all_of(int d) const;
  std::shared_ptr<WaveBasis> lowest_of(int d) const;
  bool set_static(WaveBasis&, int d) const;
  void set_damping(WaveBasis&, std::vector<complex> const& U, int d) const;

  MeanSector const& mean_;
  WheelContact const& contact_;
  std::vector<double> const& stuck_;
  std::array<Circulant<SparseBlock>, 3> of_order_;  ///< stiffness with all pairs stuck, damping, inertia
  std::shared_ptr<Kept> kept_;
};

}  // namespace fretwave::wheel
