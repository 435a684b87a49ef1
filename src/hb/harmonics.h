#pragma once
#include <fftw3.h>

#include <complex>
#include <memory>
#include <string>
#include <vector>

/// Harmonic balance: complex nonlinear modes and forced response as one residual.
namespace fretwave::hb {

using complex = std::complex<double>;

/// The retained harmonics and the time samples per period: a discretisation, not a residual.
/// A dof's coefficients stand together as a block [Q0, Qc1, Qs1, ...] restricted to the retained set.
class Harmonics {
 public:
  /// Retained orders, ascending, each once, with 1 among them (or 0 alone: statics); samples >= 2 max + 2,
  /// even.
  Harmonics(std::vector<int> orders, int samples);
  std::vector<int> const& orders() const { return orders_; }
  int count() const { return int(orders_.size()); }
  int highest() const { return orders_.back(); }
  int samples() const { return samples_; }
  int block_size() const { return block_size_; }
  /// Place of the cosine (or mean) coefficient of the i-th retained order in the block; the sine stands
  /// behind it.
  int offset(int i) const { return offsets_[i]; }
  /// Place of order 1 among the orders; -1 in statics.
  int fundamental() const { return fundamental_; }
  /// Only odd orders: half-wave symmetric motion, x(t + T/2) = -x(t).
  bool odd_only() const;

 private:
  std::vector<int> orders_, offsets_;
  int samples_, block_size_ = 0, fundamental_ = -1;
};

/// Values of s_n at one point, q_n = Qc_n - i Qs_n and dx/dt <-> s_n q_n; `inertia_damping` g subtracts g s_n
/// M (EPMC, g = 2 zeta w0).
struct Exponents {
  std::vector<complex> s;  ///< one per retained order
  double inertia_damping = 0;
};

/// y = s x on harmonic blocks: columns x block size, real (cos, sin) pairs.
void multiply(Harmonics const&, std::vector<complex> const& s, double const* x, double* y, int columns);

/// Batched FFT between harmonic blocks (pairs x components x block size) and time samples (samples x
/// components x pairs, pairs innermost).
class FourierTransform {
 public:
  FourierTransform(Harmonics const&, int columns, int components = 1);
  void to_time(double const* blocks, double* samples) const;
  /// Coefficients of sampled columns; overwrites nothing of `samples`.
  void to_harmonics(double const* samples, double* blocks) const;
  /// Energy outside the retained orders and in all orders, of the last to_harmonics, summed over the columns.
  std::pair<double, double> truncated_energy() const;
  /// One-sided complex spectrum of the last to_harmonics: (samples/2 + 1) x columns, unnormalised.
  complex const* spectrum() const { return reinterpret_cast<complex const*>(spectrum_.get()); }

 private:
  struct FreePlan {
    void operator()(fftw_plan p) const { fftw_destroy_plan(p); }
  };
  struct FreeMemory {
    void operator()(void* p) const { fftw_free(p); }
  };
  Harmonics harmonics_;
  int columns_, rows_;
  std::vector<size_t> block_;  ///< where a time column's harmonic block begins
  std::unique_ptr<double, FreeMemory> time_;
  std::unique_ptr<fftw_complex, FreeMemory> spectrum_;
  std::unique_ptr<std::remove_pointer_t<fftw_plan>, FreePlan> backward_, forward_;
};

}  // namespace fretwave::hb
