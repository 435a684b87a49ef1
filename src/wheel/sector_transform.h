#pragma once
#include <fftw3.h>

#include <span>

#include "hb/harmonics.h"
#include "petsc.h"
#include "wheel/two_stage_exchange.h"

namespace fretwave::wheel {

using namespace hb;

/// A harmonic in one wave around a wheel of N sectors: x_j = x^ e^{2 pi i j d / N}.
struct Wave {
  int harmonic, diameter;  ///< d in 0 .. N - 1
};

/// What of `total` things the first `part` of `parts` ranks take.
inline int share(int total, int part, int parts) { return int(PetscInt64(total) * part / parts); }

/// Discrete Fourier transform over the sectors of a wheel whose ranks hold whole sectors, into waves of which
/// each rank holds its share, all harmonics of a diameter side by side and d beside N - d. Two exchanges,
/// between any number of ranks: sectors to columns (harmonic and item), whose transforms are local, and
/// columns to waves.
class SectorTransform {
 public:
  /// local_sectors: of this rank, in rank order. Collective.
  SectorTransform(int local_sectors, int harmonics, int items, MPI_Comm);
  int sectors() const { return first_sector_.back(); }
  int first_sector(int rank) const { return first_sector_[rank]; }
  /// This rank's waves. The same for every number of items.
  std::vector<Wave> const& waves() const { return waves_[rank_]; }
  /// in: own sectors x harmonics x items; returns own waves x items, sum_j x_j e^{-2 pi i j d / N}.
  /// Collective.
  std::vector<complex> to_waves(std::span<complex const> in) const;
  /// Its inverse. Collective.
  std::vector<complex> to_sectors(std::span<complex const> in) const;

 private:
  struct FreePlan {
    void operator()(fftw_plan p) const { fftw_destroy_plan(p); }
  };
  using Plan = std::unique_ptr<std::remove_pointer_t<fftw_plan>, FreePlan>;
  /// Numbers of entries that go to each rank.
  using Counts = std::vector<int>;
  int first_column(int rank) const { return share(harmonics_ * items_, rank, size_); }
  int width(int rank) const { return first_column(rank + 1) - first_column(rank); }
  int local_sectors(int rank) const { return first_sector_[rank + 1] - first_sector_[rank]; }
  std::pair<int, int> common(int columns_of, int harmonic) const;
  void exchange(std::span<complex const> out, Counts const& sent, std::span<complex> in) const;
  template <class Visit>
  void for_runs(int columns_of, int waves_of, Visit visit) const;
  Counts by_rank(bool waves) const;

  int harmonics_, items_, rank_, size_;
  TwoStageExchange exchange_;
  std::vector<int> first_sector_;         ///< by rank, and the total
  std::vector<std::vector<Wave>> waves_;  ///< by rank
  mutable std::vector<complex> columns_;  ///< sectors x own columns
  Plan forward_, backward_;
};

}  // namespace fretwave::wheel
