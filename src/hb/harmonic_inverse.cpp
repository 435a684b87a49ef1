#include "hb/harmonic_inverse.h"

#include <algorithm>

#include "error.h"
#include "fault.h"
#include "lapack.h"

namespace fretwave::hb {

namespace {

void need(int info) {
  if (info != 0 || fault::value("harmonic block"))
    throw SingularBlock("a harmonic block of the preconditioner is singular (LAPACK info " +
                        std::to_string(info) + "): a free motion at this harmonic");
}

using scomplex = std::complex<float>;

/// The inverse, rounded to single precision.
template <class Single, class T>
std::vector<Single> inverse_of(std::vector<T> A, int n) {
  fault::point("harmonic block");
  need(lapack::invert(A, n));
  return {A.begin(), A.end()};
}

class ComplexInverse : public HarmonicInverse {
 public:
  ComplexInverse(Place place, std::vector<complex> A)
      : at_(place), inverse_(inverse_of<scomplex>(std::move(A), place.dofs)) {}

  void apply(double const* x, double* z) const override {
    const int n = at_.dofs, step = 1;
    const scomplex one = 1, zero = 0;
    const auto in = at_.gather<float>(x);
    std::vector<scomplex> out(n);
    cgemv_("N", &n, &n, &one, inverse_.data(), &n, in.data(), &step, &zero, out.data(), &step);
    at_.scatter(out, z);
  }

  Rotation entry(int i, int j) const override {
    const scomplex a = inverse_[size_t(j) * at_.dofs + i];
    return at_.mean ? Rotation{.cc = a.real()} : Rotation::of(a);
  }

 private:
  Place at_;
  std::vector<scomplex> inverse_;
};

class BorderedInverse : public HarmonicInverse {
 public:
  BorderedInverse(Place place, std::vector<double> A, int scalars)
      : at_(place),
        scalars_(scalars),
        size_(2 * place.dofs + scalars),
        inverse_(inverse_of<float>(std::move(A), size_)) {}

  void apply(double const* x, double* z) const override {
    const int n = at_.dofs, step = 1;
    const float one = 1, zero = 0;
    const size_t scalars_at = size_t(n) * at_.block;
    std::vector<float> in(size_), out(size_);
    for (int i = 0; i < n; ++i)
      for (int part = 0; part < 2; ++part) in[part * n + i] = x[size_t(i) * at_.block + at_.offset + part];
    std::copy_n(x + scalars_at, scalars_, in.begin() + 2 * n);
    sgemv_("N", &size_, &size_, &one, inverse_.data(), &size_, in.data(), &step, &zero, out.data(), &step);
    for (int i = 0; i < n; ++i)
      for (int part = 0; part < 2; ++part) z[size_t(i) * at_.block + at_.offset + part] = out[part * n + i];
    std::copy_n(out.begin() + 2 * n, scalars_, z + scalars_at);
  }

  Rotation entry(int i, int j) const override {
    const int n = at_.dofs;
    const auto at = [&](int row, int col) { return inverse_[size_t(col) * size_ + row]; };
    return {at(i, j), at(i, n + j), at(n + i, j), at(n + i, n + j)};
  }

 private:
  Place at_;
  int scalars_, size_;
  std::vector<float> inverse_;
};

}  // namespace

std::unique_ptr<HarmonicInverse> invert(Place place, std::vector<complex> A) {
  return std::make_unique<ComplexInverse>(place, std::move(A));
}

std::unique_ptr<HarmonicInverse> invert_bordered(Place place, std::vector<double> A, int scalars) {
  return std::make_unique<BorderedInverse>(place, std::move(A), scalars);
}

}  // namespace fretwave::hb
