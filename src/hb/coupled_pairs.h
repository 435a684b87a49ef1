#pragma once
#include <memory>
#include <span>
#include <vector>

#include "hb/harmonic_block.h"
#include "hb/pair_correction.h"
#include "petsc.h"

namespace fretwave::hb {

/// Pairs of contact that feel each other through the structure: with dD the tangents that harmonic blocks do
/// not hold and G = B P^-1 B^H, the forces f = dD u of (I + G dD) u = b, written with each pair's own part
/// eliminated (`PairCorrection`: E = dD (I + G_pp dD)^-1),
///
///     (I + E (G - G_pp)) f = E b.
///
/// GMRES in the contact's coefficients, every vector whole on every rank; a rank has its pairs' E and its
/// harmonics' G. An iteration reads those, in single precision, and nothing of the size of the structure.
class CoupledPairs {
 public:
  /// A pair of this rank: its first entry among all coefficients.
  struct Own {
    size_t first;
    PairCorrection const* E;
  };
  /// `between`: G - G_pp at this rank's harmonics.
  CoupledPairs(MPI_Comm, int size, std::vector<Own>, std::vector<std::unique_ptr<HarmonicBlock>> between);
  CoupledPairs(CoupledPairs const&) = delete;
  size_t size() const { return size_; }
  /// f of b, both over all coefficients. Collective.
  std::vector<double> forces(std::span<double const> b) const;

 private:
  static PetscErrorCode product(Mat, Vec f, Vec out);
  void multiply_pairs(double const* b, double* f) const;

  MPI_Comm comm_;
  int size_;
  std::vector<Own> own_;
  std::vector<std::unique_ptr<HarmonicBlock>> between_;
  MatHandle A_;
  KspHandle ksp_;
  VecHandle right_, f_;
};

}  // namespace fretwave::hb
