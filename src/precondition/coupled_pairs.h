#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "precondition/contact_gmres.h"
#include "precondition/pair_correction.h"

namespace fretwave::precondition {

/// Pairs of contact that feel each other through the structure: with dD the tangents that harmonic blocks do
/// not hold and G = B P^-1 B^H, the forces f = dD u of (I + G dD) u = b, written with each pair's own part
/// eliminated (`PairCorrection`: E = dD (I + G_pp dD)^-1),
///
///     (I + E (G - G_pp)) f = E b.
///
/// GMRES in the contact's coefficients, a rank's those of its pairs; it has their E, and its harmonics' G. An
/// iteration reads those, in single precision, and nothing of the size of the structure.
class CoupledPairs {
 public:
  /// Adds (G - G_pp) f at this rank's harmonics to u; both of all pairs.
  using Between = std::function<void(double const* f, double* u)>;
  /// `own`: of this rank's pairs, in the order of their coefficients; `most`: iterations. Collective.
  CoupledPairs(MPI_Comm, std::vector<PairCorrection const*> own, Between, int most);
  CoupledPairs(CoupledPairs const&) = delete;
  /// Coefficients of all ranks' pairs.
  size_t size() const { return size_; }
  /// f of b, both whole on every rank. Collective.
  std::vector<double> forces(std::vector<double> const& b);

 private:
  void product(std::span<double const> f, std::span<double> out) const;
  std::vector<double> multiply_pairs(std::vector<double> const& b) const;

  MPI_Comm comm_;
  size_t local_ = 0, begin_ = 0, size_ = 0;  ///< coefficients of this rank, before it, of all
  std::vector<PairCorrection const*> own_;
  Between between_;
  std::optional<ContactGmres> gmres_;
};

}  // namespace fretwave::precondition
