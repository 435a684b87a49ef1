#include "precondition/harmonic_block.h"

#include <algorithm>

#include "error.h"
#include "fault.h"
#include "lapack.h"

namespace fretwave::precondition {

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

class ComplexBlock : public HarmonicBlock {
 public:
  ComplexBlock(Place place, std::vector<scomplex> A) : at_(place), A_(std::move(A)) {}

  void apply(double const* x, double* z) const override {
    at_.scatter(lapack::product(at_.dofs, at_.dofs, A_.data(), at_.gather<float>(x)), z);
  }

  Rotation entry(int i, int j) const override {
    const scomplex a = A_[size_t(j) * at_.dofs + i];
    return at_.mean ? Rotation{.cc = a.real()} : Rotation::of(a);
  }

  std::unique_ptr<HarmonicBlock> between_pairs(std::span<ContactEntry const> B,
                                               std::span<int const> pair) const override {
    const size_t n = at_.dofs, rows = pair.size();
    std::vector<scomplex> AB(n * rows), G(rows * rows);
    for (auto const& [row, dof, factor] : B) add(scomplex(std::conj(factor)), &A_[dof * n], n, &AB[row * n]);
    for (size_t col = 0; col < rows; ++col)
      for (auto const& [row, dof, factor] : B)
        if (pair[row] != pair[col]) G[col * rows + row] += scomplex(factor) * AB[col * n + dof];
    return std::make_unique<ComplexBlock>(at_.of_rows(int(rows)), std::move(G));
  }

 private:
  static void add(scomplex factor, scomplex const* x, size_t n, scomplex* y) {
    for (size_t i = 0; i < n; ++i) y[i] += factor * x[i];
  }

  Place at_;
  std::vector<scomplex> A_;
};

class RealBlock : public HarmonicBlock {
 public:
  RealBlock(Place place, int scalars, std::vector<float> A)
      : at_(place), scalars_(scalars), size_(2 * place.dofs + scalars), A_(std::move(A)) {}

  void apply(double const* x, double* z) const override {
    const int n = at_.dofs, step = 1;
    const float one = 1, zero = 0;
    const size_t scalars_at = size_t(n) * at_.block;
    std::vector<float> in(size_), out(size_);
    for (int i = 0; i < n; ++i)
      for (int part = 0; part < 2; ++part) in[part * n + i] = x[size_t(i) * at_.block + at_.offset + part];
    std::copy_n(x + scalars_at, scalars_, in.begin() + 2 * n);
    sgemv_("N", &size_, &size_, &one, A_.data(), &size_, in.data(), &step, &zero, out.data(), &step);
    for (int i = 0; i < n; ++i)
      for (int part = 0; part < 2; ++part) z[size_t(i) * at_.block + at_.offset + part] = out[part * n + i];
    std::copy_n(out.begin() + 2 * n, scalars_, z + scalars_at);
  }

  Rotation entry(int i, int j) const override {
    const int n = at_.dofs;
    const auto at = [&](int row, int col) { return A_[size_t(col) * size_ + row]; };
    return {at(i, j), at(i, n + j), at(n + i, j), at(n + i, n + j)};
  }

  std::unique_ptr<HarmonicBlock> between_pairs(std::span<ContactEntry const> B,
                                               std::span<int const> pair) const override {
    const size_t n = at_.dofs, rows = pair.size(), size = size_;
    std::vector<float> AB(size * 2 * rows), G(4 * rows * rows);
    const auto add = [&](double weight, size_t from, size_t to) {
      for (size_t i = 0; i < size; ++i) AB[to * size + i] += float(weight) * A_[from * size + i];
    };
    for (auto const& [row, dof, factor] : B) {  // with the real form of the factor, `Rotation::of`
      add(factor.real(), dof, row), add(factor.imag(), n + dof, row);
      add(-factor.imag(), dof, rows + row), add(factor.real(), n + dof, rows + row);
    }
    for (size_t col = 0; col < 2 * rows; ++col)
      for (auto const& [row, dof, factor] : B) {
        if (pair[row] == pair[col % rows]) continue;
        const float re = float(factor.real()), im = float(factor.imag());
        const float c = AB[col * size + dof], s = AB[col * size + n + dof];
        G[col * 2 * rows + row] += re * c + im * s, G[col * 2 * rows + rows + row] += re * s - im * c;
      }
    return std::make_unique<RealBlock>(at_.of_rows(int(rows)), 0, std::move(G));
  }

 private:
  Place at_;
  int scalars_, size_;
  std::vector<float> A_;
};

}  // namespace

std::unique_ptr<HarmonicBlock> invert(Place place, std::vector<complex> A) {
  return std::make_unique<ComplexBlock>(place, inverse_of<scomplex>(std::move(A), place.dofs));
}

std::unique_ptr<HarmonicBlock> invert_bordered(Place place, std::vector<double> A, int scalars) {
  return std::make_unique<RealBlock>(place, scalars,
                                     inverse_of<float>(std::move(A), 2 * place.dofs + scalars));
}

}  // namespace fretwave::precondition
