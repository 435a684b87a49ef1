#pragma once
#include "hb/harmonic_problem.h"
#include "precondition/contact_rows.h"
#include "precondition/sparse_factor.h"

namespace fretwave::precondition {

using namespace hb;

/// Sparse factors of one block a harmonic, A_n = Z_n(s_n) + B^T t_n B (over k_ref), t_n the contact's
/// coupling of the harmonic with itself, made complex symmetric. Whoever uses them corrects for what has
/// changed since, so they are made anew only when the exponents have moved. One analysis of the common
/// pattern serves all.
class HarmonicFactors {
 public:
  explicit HarmonicFactors(HarmonicProblem&);
  /// At the exponents and the tangents of this rank's pairs. Collective.
  void factorise(Exponents const&, std::vector<PairTangents> const&);
  /// x = A^-1 x or A^-T x for columns of harmonic blocks, whole on rank 0 with leading dimension `ld`.
  /// Collective.
  void solve(double* x, int columns, size_t ld, bool transposed = false);
  /// G_n = B A_n^-1 B^T, contact rows squared, column-major, on rank 0. Collective.
  std::vector<complex> compliance(int harmonic, ContactRows const&);
  /// t_n of this rank's pairs, pair by pair and harmonic by harmonic, row-major.
  std::vector<complex> const& tangents() const { return tangents_; }
  bool symmetric() const { return pattern_.symmetric; }
  double megabytes() const;
  double entries() const;

 private:
  struct TermEntry {
    size_t slot;
    double value;
  };
  struct ContactEntry {
    size_t tangent;  ///< place in the first harmonic's block of its pair
    size_t step;     ///< to the next harmonic
    double weight;
  };
  void find_terms();
  void find_contact(std::vector<PairTangents> const&);
  void average(std::vector<PairTangents> const&);
  std::vector<complex> values(int harmonic, Exponents const&) const;

  HarmonicProblem& problem_;
  SparsePattern pattern_;
  size_t term_slots_ = 0;
  std::vector<std::vector<TermEntry>> terms_;
  std::vector<ContactEntry> contact_;
  std::vector<complex> tangents_;
  std::vector<SparseFactor> factors_;
};

}  // namespace fretwave::precondition
