#include "precondition/contact_gmres.h"

#include <algorithm>
#include <cmath>

#include "solve/vectors.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

const Tuned kept("pairs_kept", 60, "directions that right-hand sides of the pairs' coupling share");
constexpr double new_part = 1e-6;  // of an image, outside the others: less is rounding

}  // namespace

ContactGmres::ContactGmres(MPI_Comm comm, PetscInt local, Product product, double tolerance, int most)
    : product_(std::move(product)), tolerance_(tolerance), most_(most) {
  right_ = make_vector(comm, local), x_ = like(right_);
}

Vec ContactGmres::solve() {
  const VecHandle left = solve::copy(right_);
  const double enough = tolerance_ * solve::norm(left);
  auto given = taken_from(left);  // C^T b
  double size = solve::norm(left);
  for (int k = 0; k < most_ && size > enough; ++k) {
    if (k == 0) {
      starts_.push_back(solve::copy(left));
      check(VecScale(starts_.back(), 1 / size));
    }
    if (!extend(k == 0 ? Vec(starts_.back()) : C_.back(), left, given)) break;
    size = std::sqrt(std::max(size * size - given.back() * given.back(), 0.0));
  }
  combine(std::move(given));
  forget(size_t(kept));
  return x_;
}

/// One direction z: A z - C C^T A z is the next column of C, and what it gives is taken from `left`. False
/// where there is nothing new in it.
bool ContactGmres::extend(Vec z, Vec left, std::vector<double>& given) {
  VecHandle image = like(z);
  product_(z, image);
  auto column = taken_from(image);
  Vec const with[] = {image, left};
  double dots[2], known = 0;
  check(VecMDot(image, 2, with, dots));
  for (double part : column) known += part * part;
  const double size = std::sqrt(dots[0]);
  if (!(size > new_part * std::sqrt(known))) return false;
  check(VecScale(image, 1 / size));
  column.push_back(size), given.push_back(dots[1] / size);
  check(VecAXPY(left, -given.back(), image));
  R_.push_back(std::move(column)), Z_.push_back(z), C_.push_back(image);
  images_.push_back(std::move(image));
  return true;
}

/// v -= C C^T v, and C^T v.
std::vector<double> ContactGmres::taken_from(Vec v) const {
  std::vector<double> parts(C_.size()), minus;
  if (C_.empty()) return parts;
  check(VecMDot(v, PetscInt(C_.size()), C_.data(), parts.data()));
  for (double part : parts) minus.push_back(-part);
  check(VecMAXPY(v, PetscInt(C_.size()), minus.data(), const_cast<Vec*>(C_.data())));
  return parts;
}

/// x = Z R^-1 y
void ContactGmres::combine(std::vector<double> y) {
  for (size_t j = y.size(); j-- > 0;) {
    y[j] /= R_[j][j];
    for (size_t i = 0; i < j; ++i) y[i] -= R_[j][i] * y[j];
  }
  check(VecSet(x_, 0));
  if (!y.empty()) check(VecMAXPY(x_, PetscInt(y.size()), y.data(), Z_.data()));
}

/// Directions behind the first ones, and the start that none of these is.
void ContactGmres::forget(size_t from) {
  if (C_.size() > from) images_.resize(from), C_.resize(from), Z_.resize(from), R_.resize(from);
  while (!starts_.empty() && std::ranges::find(Z_, Vec(starts_.back())) == Z_.end()) starts_.pop_back();
}

}  // namespace fretwave::precondition
