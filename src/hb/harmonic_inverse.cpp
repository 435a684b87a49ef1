#include "hb/harmonic_inverse.h"

#include <algorithm>

#include "error.h"

extern "C" {
void zgetrf_(int const*, int const*, std::complex<double>*, int const*, int*, int*);
void zgetri_(int const*, std::complex<double>*, int const*, int const*, std::complex<double>*, int const*,
             int*);
void cgemv_(char const*, int const*, int const*, std::complex<float> const*, std::complex<float> const*,
            int const*, std::complex<float> const*, int const*, std::complex<float> const*,
            std::complex<float>*, int const*);
void dgetrf_(int const*, int const*, double*, int const*, int*, int*);
void dgetri_(int const*, double*, int const*, int const*, double*, int const*, int*);
void sgemv_(char const*, int const*, int const*, float const*, float const*, int const*, float const*,
            int const*, float const*, float*, int const*);
}

namespace fretwave::hb {

namespace {

void need(int info) {
  if (info != 0)
    throw InputError("a harmonic block of the preconditioner is singular",
                     "LAPACK info " + std::to_string(info), "0",
                     "check the model for free motions at this harmonic");
}

using scomplex = std::complex<float>;

/// The inverse, rounded to single precision.
template <class Single, class T, auto Factorise, auto Invert>
std::vector<Single> inverse_of(std::vector<T> A, int n) {
  std::vector<int> pivots(n);
  const int work_size = 64 * n;
  std::vector<T> work(work_size);
  int info;
  Factorise(&n, &n, A.data(), &n, pivots.data(), &info);
  need(info);
  Invert(&n, A.data(), &n, pivots.data(), work.data(), &work_size, &info);
  need(info);
  return {A.begin(), A.end()};
}

class ComplexInverse : public HarmonicInverse {
 public:
  ComplexInverse(Place place, std::vector<complex> A)
      : at_(place), inverse_(inverse_of<scomplex, complex, zgetrf_, zgetri_>(std::move(A), place.dofs)) {}

  void apply(double const* x, double* z) const override {
    const int n = at_.dofs, step = 1;
    const scomplex one = 1, zero = 0;
    std::vector<scomplex> in(n), out(n);
    for (int i = 0; i < n; ++i) {
      double const* block = x + size_t(i) * at_.block + at_.offset;
      in[i] = {float(block[0]), at_.mean ? 0 : -float(block[1])};
    }
    cgemv_("N", &n, &n, &one, inverse_.data(), &n, in.data(), &step, &zero, out.data(), &step);
    for (int i = 0; i < n; ++i) {
      double* block = z + size_t(i) * at_.block + at_.offset;
      block[0] = out[i].real();
      if (!at_.mean) block[1] = -out[i].imag();
    }
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
        inverse_(inverse_of<float, double, dgetrf_, dgetri_>(std::move(A), size_)) {}

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
