#pragma once
#include <map>
#include <memory>

#include "model/static_factor.h"
#include "wheel/circulant.h"

namespace fretwave::wheel {

/// K_d^-1 of all waves by the factor of one sector, real. What neighbours share, the interface b, is
/// eliminated last (substructures: Przemieniecki, AIAA J. 1, 1963):
///
///     K_d = [K_ii, P_d; P_d^H, B_d],  P_d = sum_k P_k e^{2 pi i k d / N},  S_d = B_d - P_d^H K_ii^-1 P_d.
///
/// Every rank has the factor, and S_d of the diameters that it takes or is given.
class SectorFactor {
 public:
  /// Of a symmetric K. Collective.
  SectorFactor(Circulant<SparseBlock> const& K, int sectors, MPI_Comm);
  /// Makes S_d; false if K_d is not positive definite. d <= N / 2.
  bool take(int diameter);
  /// That of a rank that has taken it. Collective.
  void share(int diameter, int from, MPI_Comm comm) { broadcast(S_[diameter], from, comm); }
  /// x := K_d^-1 x of columns of a sector's dofs, for the diameter of each, of those taken.
  void solve(std::vector<int> const& diameters, complex* x) const;
  int dofs() const { return n_; }
  int sectors() const { return sectors_; }
  int interface() const { return int(shared_.size()); }
  double entries() const { return inner_ ? inner_->entries() : 0; }
  double megabytes() const;

 private:
  /// Of P_k or B_k: the row is among the inner dofs or those of the interface.
  struct Entry {
    int row, column;
    double value;
  };
  using Entries = std::map<int, std::vector<Entry>>;
  void find_interface(Circulant<SparseBlock> const&);
  void split(Circulant<SparseBlock> const&);
  void condense(MPI_Comm);
  MatHandle columns_of(int first, int count) const;
  void solve_inner(std::vector<complex>& x) const;
  std::vector<complex> onto_shared(int d, complex const* inner) const;
  void from_shared(int d, complex const* x, complex* inner) const;

  complex turned_by(int ahead, int d) const { return turn(ahead, d, sectors_); }

  int n_, sectors_;
  std::vector<int> shared_, inner_dofs_, number_;  ///< number_: of a dof among the one or the other
  std::vector<char> is_shared_;
  Entries P_, B_;
  std::unique_ptr<model::StaticFactor> inner_;
  std::vector<int> ahead_;                 ///< k of P_k
  std::vector<double> G_;                  ///< P_k^T K_ii^-1 P_l, column-major, the columns of one k together
  std::map<int, std::vector<complex>> S_;  ///< L of L L^H, by diameter, column-major
};

}  // namespace fretwave::wheel
