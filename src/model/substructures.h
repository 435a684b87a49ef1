#pragma once
#include <memory>
#include <vector>

#include "model/partition.h"
#include "petsc.h"

namespace fretwave::model {

/// The inverse of a real symmetric positive definite matrix by substructures (Przemieniecki, AIAA J. 1, 1963,
/// p. 138), one a rank. A rank's inner dofs, i, are coupled to no inner ones of another rank; b are those
/// between. With K_ii = L D L^T by MUMPS, of one rank alone,
///
///     S = K_bb - sum over ranks of K_bi K_ii^-1 K_ib,
///     x_b = S^-1 (f_b - sum of K_bi K_ii^-1 f_i),   x_i = K_ii^-1 (f_i - K_ib x_b),
///
/// each rank with its own part of all factors and with its rows of S^-1.
class Substructures {
 public:
  /// Factorises; none on one rank, or where too many dofs lie between the ranks, of whose S all ranks
  /// together hold so many megabytes at the most. Collective.
  static std::unique_ptr<Substructures> of(Mat K, double megabytes);
  ~Substructures();
  bool definite() const { return definite_; }
  /// y = K^-1 x: coefficients, innermost, of this rank's dofs. Collective.
  void solve(double const* x, int coefficients, double* y) const;
  /// Of all ranks: memory [MB] and entries.
  double megabytes() const { return megabytes_; }
  double entries() const { return entries_; }
  int between() const { return int(between_.size()); }  ///< dofs between ranks

 private:
  struct Inner;
  Substructures(Partition, std::vector<PetscInt> between);
  std::vector<int> number_inner();
  void split(Mat K);
  std::vector<double> condensed(Mat K) const;
  std::vector<double> diagonal_between(Mat K) const;
  void invert(std::vector<double> S, std::vector<double> const& diagonal);
  void measure();
  void move_between(std::vector<double>& x, int coefficients) const;

  Partition partition_;
  MPI_Comm comm_;
  PetscInt begin_, end_;                          ///< this rank's dofs, as all below by the partition
  std::vector<PetscInt> between_;                 ///< dofs between ranks, of all of them, ascending
  std::vector<std::pair<int, int>> own_between_;  ///< this rank's of them: its dof, and its place there
  std::unique_ptr<Inner> factor_;                 ///< none without inner dofs
  std::vector<int> first_;                        ///< row of S^-1 of each rank, and the number of all
  std::vector<double> inverse_;                   ///< this rank's rows of it, one after the other
  bool definite_ = false;
  double megabytes_ = 0, entries_ = 0;
};

}  // namespace fretwave::model
