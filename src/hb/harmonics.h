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
  /// even. `moving`: the highest order of the motions that forces will be asked of, if that is not the
  /// highest of all: coefficients above are zero then.
  Harmonics(std::vector<int> orders, int samples, int moving = 0);
  std::vector<int> const& orders() const { return orders_; }
  int count() const { return int(orders_.size()); }
  int highest() const { return orders_.back(); }
  int moving() const { return moving_; }
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
  int samples_, moving_, block_size_ = 0, fundamental_ = -1;
};

/// Values of s_n at one point, q_n = Qc_n - i Qs_n and dx/dt <-> s_n q_n; `inertia_damping` g subtracts g s_n
/// M (EPMC, g = 2 zeta w0).
struct Exponents {
  std::vector<complex> s;  ///< one per retained order
  double inertia_damping = 0;
};

/// y = s x on harmonic blocks: columns x block size, real (cos, sin) pairs.
void multiply(Harmonics const&, std::vector<complex> const& s, double const* x, double* y, int columns);
std::vector<complex> conjugate(std::vector<complex> factor);
/// Harmonic blocks of one set in those of another: orders that it has not retained are left out, those that
/// are new are zero.
void embed(Harmonics const& from, double const* x, Harmonics const& to, double* y, int columns);

/// Between harmonic blocks (pairs x components x block size) and time samples (samples x components x pairs,
/// pairs innermost): by a table of cosines and sines for few harmonics, by FFT for many.
class FourierTransform {
 public:
  FourierTransform(Harmonics const&, int columns, int components = 1);
  void to_time(double const* blocks, double* samples) const;
  /// Coefficients of sampled columns; overwrites nothing of `samples`.
  void to_harmonics(double const* samples, double* blocks) const;
  /// Sums of squares over the samples, each column about its mean (a static load is no part of a motion):
  /// what the retained orders leave, and all.
  std::pair<double, double> truncated_energy(double const* samples, double const* blocks) const;
  /// One-sided complex spectrum: (samples/2 + 1) x columns, unnormalised.
  complex const* spectrum(double const* samples) const;
  /// 1, cos n tau, sin n tau, and the same as weights of to_harmonics: samples x block size.
  std::vector<double> const& synthesis() const { return tables(synthesis_); }
  std::vector<double> const& analysis() const { return tables(analysis_); }

 private:
  struct FreePlan {
    void operator()(fftw_plan p) const { fftw_destroy_plan(p); }
  };
  struct FreeMemory {
    void operator()(void* p) const { fftw_free(p); }
  };
  /// Tables of the even or the odd orders over half a period, samples/2 x places.
  struct Half {
    std::vector<size_t> places;  ///< in the harmonic block
    std::vector<double> synthesis, analysis;
  };
  void make_halves();
  void make_tables() const;
  std::vector<double> const& tables(std::vector<double> const& wanted) const {
    if (wanted.empty()) make_tables();
    return wanted;
  }
  void by_halves(double const* blocks, double* samples) const;
  void from_halves(double const* samples, double* blocks) const;
  void plan(bool forward) const;

  Harmonics harmonics_;
  int columns_, rows_;
  bool table_;
  std::vector<size_t> block_;                         ///< where a time column's harmonic block begins
  mutable std::vector<double> synthesis_, analysis_;  ///< only if asked for
  Half halves_[2];
  mutable std::vector<double> packed_, sums_, middle_;
  mutable std::unique_ptr<fftw_complex, FreeMemory> spectrum_;  ///< only if asked for, as the plans
  mutable std::unique_ptr<std::remove_pointer_t<fftw_plan>, FreePlan> backward_, forward_;
};

}  // namespace fretwave::hb
