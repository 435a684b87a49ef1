#include "precondition/contact_gmres.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "lapack.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

const Tuned kept("pairs_kept", 100, "directions that right-hand sides of the pairs' coupling share");
constexpr double new_part = 1e-6;  // of an image, outside the others: less is rounding

/// to += alpha A x of `columns` columns
void add_product(int rows, int columns, double alpha, std::vector<double> const& A,
                 std::vector<double> const& x, double* to) {
  const int step = 1;
  const double one = 1;
  if (rows > 0 && columns > 0)
    dgemv_("N", &rows, &columns, &alpha, A.data(), &rows, x.data(), &step, &one, to, &step);
}

}  // namespace

ContactGmres::ContactGmres(MPI_Comm comm, size_t local, Product product, double tolerance, int most)
    : comm_(comm),
      local_(as_int(local, "coefficients of contact on one rank")),
      product_(std::move(product)),
      tolerance_(tolerance),
      most_(most) {}

std::vector<double> ContactGmres::solve(std::vector<double> b) {
  std::vector<double>& left = b;
  const double enough = tolerance_ * norm(left);
  auto given = taken_from(left);  // C^T b
  double size = norm(left);
  std::vector<double> start;
  if (size > enough)
    for (const double v : left) start.push_back(v / size);
  for (int k = 0; k < most_ && size > enough; ++k) {
    if (!extend(k == 0 ? std::span<double const>(start) : std::span(C_).last(local_), left, given)) break;
    if (k == 0) starts_.insert(starts_.end(), start.begin(), start.end());
    begins_.push_back(k == 0);
    size = norm(left);
  }
  auto x = combined(std::move(given));
  forget(size_t(kept.count()));
  return x;
}

/// One direction z: A z - C C^T A z is the next column of C, and what it gives is taken from `left`. False
/// where there is nothing new in it.
bool ContactGmres::extend(std::span<double const> z, std::vector<double>& left, std::vector<double>& given) {
  std::vector<double> image(local_);
  product_(z, image);
  auto column = taken_from(image);
  double known = 0;
  for (double part : column) known += part * part;
  double sums[] = {std::inner_product(image.begin(), image.end(), image.begin(), 0.0),
                   std::inner_product(image.begin(), image.end(), left.begin(), 0.0)};
  sum_over_ranks(sums, comm_);
  const double size = std::sqrt(sums[0]);
  if (!(size > new_part * std::sqrt(known))) return false;
  for (double& v : image) v /= size;
  column.push_back(size), given.push_back(sums[1] / size);
  add_product(local_, 1, -1, image, {given.back()}, left.data());
  C_.insert(C_.end(), image.begin(), image.end());
  R_.push_back(std::move(column));
  return true;
}

/// A^T v of `columns` columns.
std::vector<double> ContactGmres::transposed_product(int columns, std::vector<double> const& A,
                                                     std::span<double const> v) const {
  const int step = 1;
  const double one = 1, zero = 0;
  std::vector<double> out(columns);
  if (local_ > 0 && columns > 0)
    dgemv_("T", &local_, &columns, &one, A.data(), &local_, v.data(), &step, &zero, out.data(), &step);
  sum_over_ranks(out, comm_);
  return out;
}

double ContactGmres::norm(std::span<double const> v) const {
  double sum = 0;
  for (const double x : v) sum += x * x;
  sum_over_ranks(std::span(&sum, 1), comm_);
  return std::sqrt(sum);
}

/// v -= C C^T v, and C^T v.
std::vector<double> ContactGmres::taken_from(std::span<double> v) const {
  const auto parts = transposed_product(int(R_.size()), C_, v);
  add_product(local_, int(parts.size()), -1, C_, parts, v.data());
  return parts;
}

/// Z R^-1 y
std::vector<double> ContactGmres::combined(std::vector<double> y) const {
  std::vector<double> of_starts, of_columns(y.size());
  for (size_t j = y.size(); j-- > 0;) {
    y[j] /= R_[j][j];
    for (size_t i = 0; i < j; ++i) y[i] -= R_[j][i] * y[j];
  }
  for (size_t j = 0; j < y.size(); ++j) {
    if (begins_[j])
      of_starts.push_back(y[j]);
    else
      of_columns[j - 1] = y[j];
  }
  std::vector<double> x(local_);
  add_product(local_, int(of_starts.size()), 1, starts_, of_starts, x.data());
  add_product(local_, int(of_columns.size()), 1, C_, of_columns, x.data());
  return x;
}

/// Directions behind the first ones.
void ContactGmres::forget(size_t from) {
  if (R_.size() > from) C_.resize(from * local_), R_.resize(from), begins_.resize(from);
  starts_.resize(size_t(std::ranges::count(begins_, true)) * local_);
}

}  // namespace fretwave::precondition
