#pragma once
#include "wheel/wheel_contact.h"

namespace fretwave::wheel {

using namespace hb;
using namespace precondition;

/// Elimination of the contact about a travelling wave. Seen in time shifted from sector to sector with the
/// wave, in which the fundamental is q_j e^{-2 pi i j d* / N} and harmonic n turns n times as far, the
/// contact of all sectors is linearised alike, f = L u + M conj(u). It couples the waves delta and -delta of
/// that motion, in which harmonic n meets the compliance of the wave delta + n d*:
///
///     (f, conj f') = Delta (I + Gamma Delta)^-1 (u, conj u'),  Delta = [L, M; conj M, conj L],
///
/// exact on a tuned wheel, for what disturbs the wave too.
class TravellingContact {
 public:
  /// wave: d*. Collective.
  TravellingContact(WheelContact const&, Harmonics const&, int own_sectors, int wave, MPI_Comm);
  int wave() const { return wave_; }
  /// B A^-1 B^H of this rank's waves as SectorTransform counts them, rows x rows each. Collective.
  void set_compliance(std::vector<complex> const& G);
  /// Collective.
  void eliminate();
  /// f for u; own sectors x harmonics x rows. Collective.
  std::vector<complex> apply(std::vector<complex> u) const;

 private:
  void turn(std::vector<complex>& x, int items, int sign) const;
  void linearise(WheelContact::Group const&, std::vector<complex>& L, std::vector<complex>& M) const;
  std::vector<complex> eliminated(WheelContact::Group const&, size_t wave, size_t mirror,
                                  std::vector<complex> const& L, std::vector<complex> const& M) const;
  size_t mirror(size_t wave) const;

  WheelContact const& contact_;
  Harmonics harmonics_;
  int own_sectors_, wave_, rows_, first_sector_;
  MPI_Comm comm_;
  SectorTransform shifted_, compliances_, shifted_compliances_;
  std::vector<complex> G_;               ///< own shifted waves x harmonics x rows x rows
  std::vector<std::vector<complex>> E_;  ///< own shifted waves up to N / 2 x groups, row-major
};

}  // namespace fretwave::wheel
