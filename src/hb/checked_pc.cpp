#include "hb/checked_pc.h"

#include <limits>

#include "error.h"

namespace fretwave::hb {

void CheckedPreconditioner::build(Vec y, Vec row) {
  failure_.clear();
  try {
    inner_->build(y, row);
  } catch (SingularBlock const& singular) {
    failure_ = singular.what();
  }
}

void CheckedPreconditioner::follow(Vec y) {
  if (failure_.empty()) inner_->follow(y);
}

void CheckedPreconditioner::apply(Vec x, Vec z) {
  if (failure_.empty()) return inner_->apply(x, z);
  check(VecSet(z, std::numeric_limits<double>::quiet_NaN()));
}

}  // namespace fretwave::hb
