#pragma once
#include "hb/harmonic_problem.h"
#include "precondition/coupled_pairs.h"
#include "solve/preconditioner.h"

namespace fretwave::precondition {

using namespace hb;

/// One block P_n per harmonic, Z_n + the contact's coupling of the harmonic with itself, inverted by the
/// derived classes; then what the contact couples between harmonics, in its own coefficients
/// (`CoupledPairs`): J^-1 ~ P^-1 - P^-1 B^H F B P^-1, F that of all pairs together. The
/// fundamental's block is inverted with the scalars' columns, the normalisation and the closing row, without
/// which it is singular at an eigenvalue. Every rank inverts its share of the harmonics and
/// has the forces of its pairs. What slips changes with every step of Newton's: F follows it, P is kept.
class PairwisePreconditioner : public solve::Preconditioner {
 public:
  explicit PairwisePreconditioner(HarmonicProblem&);
  void build(Vec y, Vec row) override;
  void follow(Vec y) override;
  void apply(Vec x, Vec z) override;

 protected:
  /// Whatever the inverses need from other ranks. Collective.
  virtual void prepare(Exponents const&, Vec y, Vec row) = 0;
  /// The fundamental's with the border.
  virtual std::unique_ptr<HarmonicBlock> inverse(int harmonic, Exponents const&) const = 0;

  Place place(int harmonic) const;
  bool mine(int harmonic) const { return harmonic % size_ == rank_; }
  /// B^H (harmonic's tangents) B of all ranks' pairs, entry by entry: add(row, col, Rotation).
  template <class Add>
  void add_contact(int harmonic, Add add) const {
    for_contact(harmonic, [&](Weight const& a, Weight const& b, size_t k) {
      Rotation r;
      r.add(a.value * b.value, tangents_[k]);
      if (a.phase || b.phase) r = r.between(std::conj(phase(a, harmonic)), phase(b, harmonic));
      add(a.dof, b.dof, r);
    });
  }

  HarmonicProblem& problem_;
  int n_, m_, scalars_, rank_, size_;

 private:
  /// A pair of any rank: its rows of B, where its per-harmonic blocks begin, and its first row among those of
  /// pairs that are not idle, -1 for one that is.
  struct Pair {
    int components;
    size_t first_weight, end_weight, first_block;
    int first_row = -1;
  };
  std::vector<Rotation> gather_contact(std::vector<PairTangents> const&);
  complex phase(Weight const&, int harmonic) const;
  /// visit(row's weight, column's weight, index of their component's per-harmonic block) for all entries of
  /// B^H (.) B.
  template <class Visit>
  void for_contact(int harmonic, Visit visit) const {
    for (Pair const& pair : pairs_)
      for (size_t a = pair.first_weight; a < pair.end_weight; ++a)
        for (size_t b = pair.first_weight; b < pair.end_weight; ++b)
          visit(weights_[a], weights_[b],
                pair.first_block +
                    (size_t(harmonic) * pair.components + weights_[a].component) * pair.components +
                    weights_[b].component);
  }
  void add_turned(Weight const&, bool conjugate, double const* from, double* to) const;
  std::vector<Rotation> compliance() const;
  void couple(std::vector<PairTangents>&&);
  std::vector<int> number_rows();
  std::vector<ContactEntry> entries(int harmonic) const;
  std::vector<double> solve(std::vector<double> const& x) const;
  std::vector<double> contact_forces(std::vector<double> const& y) const;
  template <class Visit>
  void for_rows(Visit visit) const;

  std::vector<Weight> weights_;  ///< of all ranks' pairs
  std::vector<Pair> pairs_;
  int first_pair_ = 0;  ///< of this rank
  std::vector<Rotation> tangents_;
  std::vector<std::unique_ptr<HarmonicBlock>> inverses_;  ///< null for other ranks' harmonics
  std::vector<Rotation> G_;                               ///< of each pair alone
  std::vector<PairCorrection> corrections_;               ///< of this rank's pairs
  std::vector<int> pair_of_;                              ///< of the rows that `between_` is of
  std::vector<std::unique_ptr<HarmonicBlock>> between_;   ///< what pairs feel of each other, own harmonics
  std::unique_ptr<CoupledPairs> coupled_;                 ///< none where all pairs are idle
};

}  // namespace fretwave::precondition
