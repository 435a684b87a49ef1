#pragma once
#include <map>
#include <unordered_map>

#include "hb/harmonic_inverse.h"

namespace fretwave::hb {

/// Inverse of a block-circulant matrix, (A x)_j = sum_k A_k x_{j+k} over N sectors of n dofs: with
/// x_j = sum_d x^_d e^{2 pi i j d / N} the nodal diameters d part, and each has one n x n block
/// P_d = sum_k A_k e^{2 pi i k d / N} (Thomas, Int. J. Numer. Methods Eng. 14, 1979).
class CyclicInverse : public HarmonicInverse {
 public:
  /// blocks: A_k, column-major, by k.
  CyclicInverse(Place, int sectors, std::map<int, std::vector<complex>> const& blocks);
  void apply(double const* x, double* z) const override;
  Rotation entry(int i, int j) const override;

  Place const& place() const { return at_; }
  /// A^-1 x, or A^-H x.
  std::vector<complex> solve(std::vector<complex> x, bool adjoint = false) const;
  complex inverse_entry(int i, int j) const;

 private:
  struct FreePlan {
    void operator()(fftw_plan p) const { fftw_destroy_plan(p); }
  };
  using Plan = std::unique_ptr<std::remove_pointer_t<fftw_plan>, FreePlan>;
  Place at_;
  int sectors_, n_;
  std::vector<std::complex<float>> inverses_;  ///< one n x n block a nodal diameter
  Plan forward_, backward_;
  mutable std::unordered_map<size_t, complex> entries_;
};

/// The circulant inverse with columns C and rows R of scalars beside it, by the Schur complement of the
/// scalars: z = (S - R A^-1 C)^-1 (x_z - R A^-1 x), q = A^-1 x - A^-1 C z. A is taken beside the point where
/// it is singular; the border holds the directions in which it nearly is.
class BorderedCyclicInverse : public HarmonicInverse {
 public:
  /// columns, rows: per scalar the fundamental's entries as q = qc - i qs; S column-major, rows x columns.
  BorderedCyclicInverse(std::unique_ptr<CyclicInverse>, std::vector<std::vector<complex>> const& columns,
                        std::vector<std::vector<complex>> rows, std::vector<double> S, size_t scalars_at);
  void apply(double const* x, double* z) const override;
  Rotation entry(int i, int j) const override;

 private:
  std::unique_ptr<CyclicInverse> inner_;
  std::vector<std::vector<complex>> rows_, AC_, AR_;  ///< R, A^-1 C, A^-H R
  std::vector<double> inverse_S_;                     ///< of the Schur complement, row-major
  size_t scalars_at_;
};

}  // namespace fretwave::hb
