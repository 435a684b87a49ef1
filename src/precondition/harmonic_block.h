#pragma once
#include <memory>
#include <span>

#include "hb/harmonics.h"

namespace fretwave::precondition {

using namespace hb;

/// Real form of a complex factor a on a (cos, sin) pair: (ar + i ai)(qc - i qs) = rc - i rs.
struct Rotation {
  double cc = 0, cs = 0, sc = 0, ss = 0;  ///< rc = cc qc + cs qs, rs = sc qc + ss qs
  template <class T>
  static Rotation of(std::complex<T> a) {
    return {a.real(), a.imag(), -a.imag(), a.real()};
  }
  /// left * this * right.
  Rotation between(complex left, complex right) const {
    const auto times = [](Rotation const& a, Rotation const& b) {
      return Rotation{a.cc * b.cc + a.cs * b.sc, a.cc * b.cs + a.cs * b.ss, a.sc * b.cc + a.ss * b.sc,
                      a.sc * b.cs + a.ss * b.ss};
    };
    return times(times(of(left), *this), of(right));
  }
  void add(double weight, Rotation const& r) {
    cc += weight * r.cc, cs += weight * r.cs, sc += weight * r.sc, ss += weight * r.ss;
  }
  /// The complex factor nearest to it.
  complex nearest() const { return {(cc + ss) / 2, (cs - sc) / 2}; }
};

/// Where a harmonic stands in a bordered vector of n dofs with blocks of m, then the scalars.
struct Place {
  int dofs, block, offset;
  bool mean;
  Place of_rows(int rows) const { return {rows, block, offset, mean}; }
  /// Its coefficients q = qc - i qs of all dofs.
  template <class T = double>
  std::vector<std::complex<T>> gather(double const* x) const {
    std::vector<std::complex<T>> q(dofs);
    for (int i = 0; i < dofs; ++i) {
      double const* at = x + size_t(i) * block + offset;
      q[i] = {T(at[0]), mean ? T(0) : -T(at[1])};
    }
    return q;
  }
  template <class T>
  void scatter(std::vector<std::complex<T>> const& q, double* z) const {
    for (int i = 0; i < dofs; ++i) {
      double* at = z + size_t(i) * block + offset;
      at[0] = q[i].real();
      if (!mean) at[1] = -q[i].imag();
    }
  }
};

/// Entry of the contact's B at one harmonic, U = B Q: with the phase of the sector that the dof is in.
struct ContactEntry {
  int row, dof;
  complex factor;
};

/// A dense operator on one harmonic's coefficients in harmonic-block vectors: the inverse of its block, or
/// what contact sees of it. Explicit, because it multiplies single vectors often and its entries are asked
/// for (a triangular solve of one vector is three times slower); kept in single precision, because reading it
/// is what an application costs.
class HarmonicBlock {
 public:
  virtual ~HarmonicBlock() = default;
  /// z = A x on this harmonic's entries; `x`, `z` are whole vectors.
  virtual void apply(double const* x, double* z) const = 0;
  virtual Rotation entry(int i, int j) const = 0;
  /// B A B^H without what pairs of contact see of themselves, on harmonic blocks of the contact's rows;
  /// `pair`: of each row.
  virtual std::unique_ptr<HarmonicBlock> between_pairs(std::span<ContactEntry const> B,
                                                       std::span<int const> pair) const = 0;
};

/// Inverse of the n x n block A (column-major). `SingularBlock` if it is.
std::unique_ptr<HarmonicBlock> invert(Place, std::vector<complex> A);
/// Inverse of the real block over (qc, qs, scalars), (2 n + scalars) squared, column-major.
std::unique_ptr<HarmonicBlock> invert_bordered(Place, std::vector<double> A, int scalars);

}  // namespace fretwave::precondition
