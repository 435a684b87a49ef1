#pragma once
#include <optional>

#include "precondition/border.h"
#include "solve/preconditioner.h"
#include "wheel/travelling_contact.h"
#include "wheel/wave_blocks.h"

namespace fretwave::wheel {

using namespace hb;
using namespace precondition;

/// For whole wheels. A holds the harmonic blocks of the tuned wheel (terms and contact tangents averaged over
/// the sectors), diagonal in waves; what the contact adds, B^T dD B, is eliminated,
///
///     q = A^-1 (x - B^T E B A^-1 x),  E = dD (I + G dD)^-1,
///
/// about a travelling wave by `TravellingContact`, exactly on a tuned wheel; about other motions sector by
/// sector, with the compliance G that a sector meets when all move in the waves of the present motion. The
/// scalars come as a `Border`. A may be of another point of the branch, as in `CondensedPreconditioner`, but
/// for the fundamental; there the waves of the motion are made beside the point, where they are not singular.
/// A mistuned wheel keeps its differences for the iteration. Ranks hold whole sectors, and share the waves
/// among them: no vector stands whole anywhere.
class WheelPreconditioner : public solve::Preconditioner {
 public:
  /// The contact is the same in all sectors. Collective.
  static bool suits(HarmonicProblem const&);
  /// Of a problem that it suits. Collective.
  explicit WheelPreconditioner(HarmonicProblem&);
  void build(Vec y, Vec row) override;
  void apply(Vec x, Vec z) override;
  double build_cost() const override;
  std::string describe() const override;

 private:
  void choose_blocks(Exponents const&);
  std::vector<double> spectrum(Vec y) const;
  std::vector<complex> of_one_sector() const;
  void eliminate(bool travelling, int wave);
  void eliminate_in_waves(int wave);
  void eliminate_by_sector();
  void make_border(Vec y, Vec row);
  std::vector<double> solve(double const* x) const;
  std::vector<complex> gather(double const* x) const;

  HarmonicProblem& problem_;
  int unit_, sectors_, m_, harmonics_, local_sectors_;
  SectorTransform dofs_;
  WheelContact contact_;
  MeanSector mean_;
  SectorTransform rows_;
  std::unique_ptr<WaveBlocks> blocks_;  ///< from the first point on
  std::optional<TravellingContact> travelling_;
  Border border_;
};

/// Before those of other rooms: waves suit every wheel that repeats.
void register_kinds();

}  // namespace fretwave::wheel
