#pragma once
#include <vector>

namespace fretwave::hb {

/// A dense matrix whose products are as exact as its entries, for differences of forces a million times
/// larger than what they leave (element stiffness against the first bending): A = A1 + A2 and x = x1 + x2
/// with so few digits in A1 and x1 that BLAS sums A1 x1 without rounding; in A1 x2 + A2 x it rounds what is
/// 1e6 times smaller. After Ozaki, Ogita, Oishi, Rump, Error-free transformations of matrix multiplication,
/// Numer. Algorithms 59, 2012.
class SplitMatrix {
 public:
  SplitMatrix() = default;
  /// A row-major.
  SplitMatrix(std::vector<double> const& A, int rows, int columns);
  operator bool() const { return !head_.empty(); }
  /// Y += A X, columns of X and Y innermost.
  void multiply_add(double const* X, double* Y, int count) const;

 private:
  int rows_ = 0, columns_ = 0, digits_ = 0;
  std::vector<double> head_, tail_;
};

}  // namespace fretwave::hb
