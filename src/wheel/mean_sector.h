#pragma once
#include "wheel/circulant.h"
#include "wheel/wheel_contact.h"

namespace fretwave::wheel {

/// The tuned wheel beside a wheel: mean over its sectors of the terms and of B. The dofs of a sector have
/// places of their own, those in contact first.
class MeanSector {
 public:
  /// Of a model that the wheel's preconditioner suits.
  MeanSector(model::Model const&, WheelContact const&);
  int dofs() const { return unit_; }
  int sectors() const { return sectors_; }
  int contact_dofs() const { return contact_dofs_; }
  int contact_rows() const { return contact_rows_; }
  int dof(int place) const { return order_[place]; }
  int place(int dof) const { return position_[dof]; }
  /// A_k of each term, the mean over the sectors of the block that acts on the sector k ahead. Collective.
  std::vector<Circulant<SparseBlock>> terms(model::Model const&) const;
  /// A wave's block is P_d = sum_k A_k e^{2 pi i k d / N} (Thomas, Int. J. Numer. Methods Eng. 14, 1979).
  std::vector<complex> of_wave(Circulant<SparseBlock> const&, int diameter) const;
  std::vector<complex> of_wave(Circulant<std::vector<complex>> const&, int diameter) const;
  /// B of a wave, contact rows x contact dofs, row-major.
  std::vector<complex> rows_of(int diameter, WheelContact const&) const;
  /// e^{2 pi i k d / N}
  complex turn(int ahead, int diameter) const { return wheel::turn(ahead, diameter, sectors_); }

 private:
  int unit_, sectors_, contact_rows_, contact_dofs_ = 0;
  std::vector<int> order_;     ///< a sector's dof by its place in the blocks
  std::vector<int> position_;  ///< its inverse
};

}  // namespace fretwave::wheel
