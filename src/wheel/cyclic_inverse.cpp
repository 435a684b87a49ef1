#include "wheel/cyclic_inverse.h"

#include <algorithm>
#include <numbers>

#include "error.h"
#include "fault.h"
#include "lapack.h"

namespace fretwave::wheel {

CyclicInverse::CyclicInverse(std::vector<Wave> const& waves, int sectors, int n, bool symmetric)
    : waves_(waves), sectors_(sectors), n_(n), symmetric_(symmetric) {
  size_t next = 0;  // a wave's mirror follows it
  for (size_t w = 0; w < waves_.size(); ++w) {
    at_.push_back(transposed(w) ? at_.back() : next);
    if (!transposed(w)) next += size_t(n) * n;
  }
  inverses_.resize(next);
}

void CyclicInverse::invert(size_t wave, CirculantBlocks<complex> const& blocks) {
  std::vector<complex> P(size_t(n_) * n_);
  for (auto const& [k, A] : blocks) {
    const complex t = std::polar(
        1.0, 2 * std::numbers::pi * double(size_t(k) * waves_[wave].diameter % sectors_) / sectors_);
    for (size_t i = 0; i < P.size(); ++i) P[i] += t * A[i];
  }
  fault::point("wave block");
  const int info = lapack::invert(P, n_);
  if (info != 0 || fault::value("wave block"))
    throw SingularBlock("the block of nodal diameter " + std::to_string(waves_[wave].diameter) +
                        " of the wheel's preconditioner is singular (LAPACK info " + std::to_string(info) +
                        "): a free motion at this harmonic");
  std::copy(P.begin(), P.end(), inverses_.begin() + at_[wave]);
}

std::vector<scomplex> CyclicInverse::multiply(size_t wave, int columns, complex const* x) const {
  std::vector<scomplex> in(x, x + columns);
  if (!transposed(wave)) return lapack::product(n_, columns, place(wave), std::move(in));
  const int step = 1;
  const scomplex one = 1, zero = 0;
  std::vector<scomplex> out(n_);  // rows of the mirror's inverse
  cgemv_("T", &columns, &n_, &one, place(wave), &n_, in.data(), &step, &zero, out.data(), &step);
  return out;
}

}  // namespace fretwave::wheel
