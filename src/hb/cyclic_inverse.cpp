#include "hb/cyclic_inverse.h"

#include <algorithm>
#include <numbers>

#include "error.h"
#include "lapack.h"

namespace fretwave::hb {

namespace {

using scomplex = std::complex<float>;

void need(int info, char const* what) {
  if (info != 0)
    throw InputError(std::string(what) + " of the wheel's preconditioner is singular",
                     "LAPACK info " + std::to_string(info), "0",
                     "check the wheel for free motions at this harmonic");
}

complex turn(int k, int d, int sectors) {
  return std::polar(1.0, 2 * std::numbers::pi * (size_t(k) * d % sectors) / sectors);
}

double along(std::vector<complex> const& row, std::vector<complex> const& q) {
  double sum = 0;  // rc qc + rs qs
  for (size_t k = 0; k < q.size(); ++k) sum += row[k].real() * q[k].real() + row[k].imag() * q[k].imag();
  return sum;
}

}  // namespace

CyclicInverse::CyclicInverse(Place place, int sectors, std::map<int, std::vector<complex>> const& blocks)
    : at_(place), sectors_(sectors), n_(place.dofs / sectors) {
  const size_t square = size_t(n_) * n_;
  inverses_.resize(square * sectors);
  std::vector<complex> P(square);
  for (int d = 0; d < sectors; ++d) {
    std::fill(P.begin(), P.end(), 0);
    for (auto const& [k, A] : blocks) {
      const complex t = turn(k, d, sectors);
      for (size_t i = 0; i < square; ++i) P[i] += t * A[i];
    }
    need(lapack::invert(P, n_), "a nodal diameter's block");
    std::copy(P.begin(), P.end(), inverses_.begin() + d * square);
  }
  std::vector<complex> x(place.dofs);
  auto* data = reinterpret_cast<fftw_complex*>(x.data());
  const auto plan = [&](int sign) {
    return fftw_plan_many_dft(1, &sectors_, n_, data, nullptr, n_, 1, data, nullptr, n_, 1, sign,
                              FFTW_ESTIMATE | FFTW_UNALIGNED);
  };
  forward_.reset(plan(FFTW_FORWARD)), backward_.reset(plan(FFTW_BACKWARD));
}

std::vector<complex> CyclicInverse::solve(std::vector<complex> x, bool adjoint) const {
  auto* data = reinterpret_cast<fftw_complex*>(x.data());
  const int step = 1;
  const scomplex one = 1, zero = 0;
  fftw_execute_dft(forward_.get(), data, data);
  std::vector<scomplex> in(n_), out(n_);
  for (int d = 0; d < sectors_; ++d) {
    complex* part = x.data() + size_t(d) * n_;
    std::copy_n(part, n_, in.begin());
    cgemv_(adjoint ? "C" : "N", &n_, &n_, &one, &inverses_[size_t(d) * n_ * n_], &n_, in.data(), &step, &zero,
           out.data(), &step);
    for (int i = 0; i < n_; ++i) part[i] = complex(out[i]) / double(sectors_);
  }
  fftw_execute_dft(backward_.get(), data, data);
  return x;
}

void CyclicInverse::apply(double const* x, double* z) const { at_.scatter(solve(at_.gather(x)), z); }

complex CyclicInverse::inverse_entry(int i, int j) const {
  const int apart = ((i / n_ - j / n_) % sectors_ + sectors_) % sectors_;
  const size_t place = size_t(j % n_) * n_ + i % n_;
  const auto [found, fresh] = entries_.try_emplace(place * sectors_ + apart, 0);
  if (fresh)
    for (int d = 0; d < sectors_; ++d)
      found->second +=
          turn(apart, d, sectors_) * complex(inverses_[size_t(d) * n_ * n_ + place]) / double(sectors_);
  return found->second;
}

Rotation CyclicInverse::entry(int i, int j) const {
  const complex a = inverse_entry(i, j);
  return at_.mean ? Rotation{.cc = a.real()} : Rotation::of(a);
}

BorderedCyclicInverse::BorderedCyclicInverse(std::unique_ptr<CyclicInverse> inner,
                                             std::vector<std::vector<complex>> const& columns,
                                             std::vector<std::vector<complex>> rows, std::vector<double> S,
                                             size_t scalars_at)
    : inner_(std::move(inner)), rows_(std::move(rows)), inverse_S_(std::move(S)), scalars_at_(scalars_at) {
  for (auto const& column : columns) AC_.push_back(inner_->solve(column));
  for (auto const& row : rows_) AR_.push_back(inner_->solve(row, true));
  const int size = int(columns.size());
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) inverse_S_[j * size + i] -= along(rows_[i], AC_[j]);
  need(lapack::invert(inverse_S_, size), "the border");
}

void BorderedCyclicInverse::apply(double const* x, double* z) const {
  auto q = inner_->solve(inner_->place().gather(x));
  const size_t size = rows_.size();
  std::vector<double> rest(size);
  for (size_t i = 0; i < size; ++i) rest[i] = x[scalars_at_ + i] - along(rows_[i], q);
  for (size_t j = 0; j < size; ++j) {
    double scalar = 0;
    for (size_t i = 0; i < size; ++i) scalar += inverse_S_[i * size + j] * rest[i];
    z[scalars_at_ + j] = scalar;
    for (size_t k = 0; k < q.size(); ++k) q[k] -= scalar * AC_[j][k];
  }
  inner_->place().scatter(q, z);
}

/// Answer at dof i to a unit cosine (1) or sine (-i) force at dof j.
Rotation BorderedCyclicInverse::entry(int i, int j) const {
  const complex g = inner_->inverse_entry(i, j);
  const size_t size = rows_.size();
  complex answer[2];
  for (int part = 0; part < 2; ++part) {
    const complex unit = part ? complex(0, -1) : 1;
    answer[part] = g * unit;
    for (size_t k = 0; k < size; ++k) {
      const double row = std::real(std::conj(AR_[k][j]) * unit);
      for (size_t s = 0; s < size; ++s) answer[part] += AC_[s][i] * inverse_S_[k * size + s] * row;
    }
  }
  return {answer[0].real(), answer[1].real(), -answer[0].imag(), -answer[1].imag()};
}

}  // namespace fretwave::hb
