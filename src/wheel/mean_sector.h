#pragma once
#include <map>

#include "wheel/wheel_contact.h"

namespace fretwave::wheel {

/// Blocks A_k of a block-circulant matrix by the sectors k ahead, n x n, column-major:
/// (A x)_j = sum_k A_k x_{j+k}.
template <class T>
using CirculantBlocks = std::map<int, std::vector<T>>;

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
  std::vector<CirculantBlocks<double>> terms(model::Model const&) const;
  /// A_-k = A_k^T: the blocks of the waves d and -d are each other's transposes.
  bool symmetric(CirculantBlocks<double> const&) const;
  /// A wave's block is P_d = sum_k A_k e^{2 pi i k d / N} (Thomas, Int. J. Numer. Methods Eng. 14, 1979).
  template <class T>
  std::vector<complex> of_wave(CirculantBlocks<T> const& blocks, int diameter) const {
    std::vector<complex> P(size_t(unit_) * unit_);
    for (auto const& [k, A] : blocks) {
      const complex t = turn(k, diameter);
      for (size_t i = 0; i < P.size(); ++i) P[i] += t * A[i];
    }
    return P;
  }
  /// B of a wave, contact rows x contact dofs, row-major.
  std::vector<complex> rows_of(int diameter, WheelContact const&) const;
  /// e^{2 pi i k d / N}
  complex turn(int ahead, int diameter) const;

 private:
  CirculantBlocks<double> average(Mat A, MPI_Comm) const;

  int unit_, sectors_, contact_rows_, contact_dofs_ = 0;
  std::vector<int> order_;     ///< a sector's dof by its place in the blocks
  std::vector<int> position_;  ///< its inverse
};

}  // namespace fretwave::wheel
