#pragma once
#include "hb/harmonic_problem.h"
#include "precondition/pair_correction.h"
#include "wheel/sector_transform.h"

namespace fretwave::wheel {

using namespace hb;
using namespace precondition;

/// The contact of a wheel's sectors, each with the same pairs: rows of B numbered through in one sector, and
/// the linearised pairs of this rank's sectors. What harmonic blocks hold of them is an average; the rest,
/// dD = D - t, is eliminated sector by sector (in groups of pairs if there are many).
class WheelContact {
 public:
  struct Entry {
    int row, ahead, dof;  ///< of one sector; the dof is that of the sector `ahead`
    double value;
  };
  struct Group {
    size_t first_pair, end_pair;
    int first_row, rows;
  };
  /// Collective.
  WheelContact(HarmonicProblem const&, SectorTransform const&);
  int rows() const { return rows_; }
  /// B, mean over the sectors.
  std::vector<Entry> const& entries() const { return entries_; }
  /// Stiffness of the rows where all pairs stick, mean over the sectors. Collective.
  std::vector<double> stuck_stiffness(model::Model const&) const;
  /// The tangents of this rank's pairs over k_ref, each to the rank of its sector. Collective.
  void take(std::vector<PairTangents> const&);
  /// t: mean over the sectors of each pair's couplings of a harmonic with itself, as complex factors; made
  /// symmetric if asked for. Collective.
  void average(bool symmetric);
  /// visit(row, column, t) of a harmonic.
  template <class Visit>
  void for_tangents(int harmonic, Visit visit) const {
    for (auto const& pair : pairs_)
      for (int r = 0; r < pair.components; ++r)
        for (int c = 0; c < pair.components; ++c)
          visit(pair.first_row + r, pair.first_row + c, tangent(pair, harmonic, r, c));
  }
  /// E = dD (I + G dD)^-1 for the compliance G of a sector's rows, harmonics x rows x rows, row-major.
  void eliminate(std::vector<complex> const& G);
  /// f = E u; columns x own sectors x harmonics x rows.
  std::vector<complex> apply(std::vector<complex> const& u, int columns = 1) const;
  /// Pairs that are eliminated together.
  std::vector<Group> const& groups() const { return groups_; }
  /// dD of a group in one of this rank's sectors, row-major.
  std::vector<double> rest(int sector, Group const&) const;
  /// Harmonic coefficients that are eliminated together, at most.
  int largest_group() const;

 private:
  struct Pair {
    int first_row, components;
    size_t first_tangent;
  };
  /// A pair of this rank whose tangent goes to the rank of its sector.
  struct Outgoing {
    int owner, sector;
    size_t pair, contact, place;  ///< its number in a sector; its place in its contact on this rank
  };
  void find_entries(HarmonicProblem const&);
  void find_groups();
  void find_owners();
  complex tangent(Pair const& p, int harmonic, int r, int c) const {
    return tangents_[p.first_tangent + (size_t(harmonic) * p.components + r) * p.components + c];
  }
  void add_compliance(std::vector<complex> const& G, Group const&, std::vector<double> const& dD,
                      std::vector<double>& T) const;

  Harmonics harmonics_;
  SectorTransform const& sectors_;
  MPI_Comm comm_;
  TwoStageExchange exchange_;
  int own_sectors_, rows_ = 0;
  std::vector<size_t> first_pair_;         ///< of each contact, in one sector
  std::vector<std::vector<int>> numbers_;  ///< this rank's pairs of each contact, as the wheel counts them
  std::vector<Pair> pairs_;
  std::vector<Group> groups_;
  std::vector<Entry> entries_;
  std::vector<complex> tangents_;
  std::vector<Outgoing> outgoing_;      ///< by owner
  std::vector<int> sent_;               ///< numbers of them, by owner
  size_t arriving_ = 0;                 ///< numbers of those of this rank's sectors
  std::vector<std::vector<double>> D_;  ///< own sectors x pairs, row-major
  std::vector<std::vector<float>> E_;   ///< own sectors x groups, row-major; reading them is an application
};

}  // namespace fretwave::wheel
