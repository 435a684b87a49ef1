#pragma once
#include <map>

#include "wheel/sector_transform.h"

namespace fretwave::wheel {

using scomplex = std::complex<float>;

/// Blocks A_k of a block-circulant matrix by the sectors k ahead, n x n, column-major:
/// (A x)_j = sum_k A_k x_{j+k}.
template <class T>
using CirculantBlocks = std::map<int, std::vector<T>>;

/// Inverses of block-circulant matrices, one a harmonic, for the waves of this rank: a wave's block is
/// P_d = sum_k A_k e^{2 pi i k d / N} (Thomas, Int. J. Numer. Methods Eng. 14, 1979). Of matrices with
/// A_-k = A_k^T, P_{N-d} = P_d^T, half of them are made and kept. In single precision, because reading them
/// is what an application costs.
class CyclicInverse {
 public:
  CyclicInverse(std::vector<Wave> const& waves, int sectors, int n, bool symmetric);
  /// Of the waves with select(wave); a wave and its mirror are selected together. blocks(harmonic): A_k.
  /// `SingularBlock` if one is; not collective, for each
  /// rank has waves of its own.
  template <class Select, class Make>
  void make(Select select, Make blocks) {
    CirculantBlocks<complex> A;
    int harmonic = -1;
    for (size_t w = 0; w < waves_.size(); ++w) {
      if (transposed(w) || !select(waves_[w])) continue;
      if (waves_[w].harmonic != harmonic) A = blocks(harmonic = waves_[w].harmonic);
      invert(w, A);
    }
  }
  /// V x for the leading `columns` entries of x, V the inverse of a wave's block.
  std::vector<scomplex> multiply(size_t wave, int columns, complex const* x) const;
  scomplex entry(size_t wave, int i, int j) const {
    return place(wave)[transposed(wave) ? size_t(i) * n_ + j : size_t(j) * n_ + i];
  }
  double megabytes() const { return sizeof(scomplex) * double(inverses_.size()) / 1e6; }

 private:
  bool mirrored(size_t wave) const { return waves_[wave].diameter > sectors_ / 2; }
  bool transposed(size_t wave) const { return symmetric_ && mirrored(wave); }
  scomplex const* place(size_t wave) const { return inverses_.data() + at_[wave]; }
  void invert(size_t wave, CirculantBlocks<complex> const&);

  std::vector<Wave> waves_;
  int sectors_, n_;
  bool symmetric_;
  std::vector<size_t> at_;  ///< a wave's place
  std::vector<scomplex> inverses_;
};

}  // namespace fretwave::wheel
