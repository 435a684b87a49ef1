#pragma once
#include "wheel/sector_factor.h"

namespace fretwave::wheel {

/// Lowest modes of one nodal diameter, M_d U = K_d U theta, U^H K_d U = 1, theta descending.
struct LowestWaves {
  std::vector<double> theta;
  std::vector<complex> U;  ///< dofs x modes, column-major
};

/// Up to `count` of them, by SLEPc under the prefix "static_".
LowestWaves lowest_waves(SectorFactor const&, Circulant<SparseBlock> const& K,
                         Circulant<SparseBlock> const& M, int diameter, int count);

}  // namespace fretwave::wheel
