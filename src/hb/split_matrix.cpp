#include "hb/split_matrix.h"

#include <algorithm>
#include <cmath>

#include "lapack.h"

namespace fretwave::hb {

namespace {

/// A number to which adding x, not above `largest`, leaves that many of its leading binary digits.
double cutter(double largest, int digits) {
  int exponent;
  std::frexp(largest, &exponent);
  return std::ldexp(1.5, exponent + 52 - digits);
}

}  // namespace

// sums of n products of twice that many digits fit the 53 of a double
SplitMatrix::SplitMatrix(std::vector<double> const& A, int rows, int columns)
    : rows_(rows),
      columns_(columns),
      digits_((52 - int(std::ceil(std::log2(columns)))) / 2),
      head_(A),
      tail_(A) {
  for (int i = 0; i < rows; ++i) {
    double* row = &head_[size_t(i) * columns];
    double largest = 0;
    for (int j = 0; j < columns; ++j) largest = std::max(largest, std::abs(row[j]));
    const double cut = cutter(largest, digits_);
    for (int j = 0; j < columns; ++j) {
      row[j] = (row[j] + cut) - cut;
      tail_[size_t(i) * columns + j] -= row[j];
    }
  }
}

void SplitMatrix::multiply_add(double const* X, double* Y, int count) const {
  std::vector<double> cut(count, 0.0), head(size_t(columns_) * count), tail(head.size()),
      sum(size_t(rows_) * count);
  for (int j = 0; j < columns_; ++j)
    for (int c = 0; c < count; ++c) cut[c] = std::max(cut[c], std::abs(X[size_t(j) * count + c]));
  for (double& size : cut) size = cutter(size, digits_);
  for (int j = 0; j < columns_; ++j)
    for (int c = 0; c < count; ++c) {
      const size_t k = size_t(j) * count + c;
      head[k] = (X[k] + cut[c]) - cut[c];
      tail[k] = X[k] - head[k];
    }
  const auto add = [&](std::vector<double> const& A, double const* x) {
    lapack::multiply("NN", {count, rows_, columns_}, 1.0, {x, count}, {A.data(), columns_}, 0.0, sum.data(),
                     count);
    for (size_t k = 0; k < sum.size(); ++k) Y[k] += sum[k];
  };
  add(head_, head.data());
  add(head_, tail.data());
  add(tail_, X);
}

}  // namespace fretwave::hb
