#pragma once
#include <memory>
#include <vector>

#include "model/model.h"
#include "model/static_factor.h"

namespace fretwave::model {

/// An entry of the rows of B.
struct ContactEntry {
  int row, dof;
  double value;
};

/// P^T D G D P = L L^T of a Gram matrix by pivots down to a small one: of `rank` columns L, as long as G.
struct PivotedCholesky {
  std::vector<int> order;
  int rank = 0;
  std::vector<double> scale, L;  ///< D
};

/// Motions Psi of unit stiffness with all pairs stuck, K_s = K + B^T k B: Psi^T K_s Psi = 1 and Psi^T M Psi =
/// diag(theta), theta = 1 / omega^2 descending. In this one real basis the dynamic stiffness is diagonal at
/// every harmonic and every point while all pairs stick. Its modes are sought as M phi = theta K_s phi: the
/// lowest frequencies keep their digits beside stiff contact, and M may be singular.
///
/// Either there are as many as dofs: all modes, or of a large model those that move with inertia, and beside
/// them static motions, theta = 0 (`moving_modes`). Or (`with_factor`) there are the lowest modes, and behind
/// them what forces on the contact move beside these, K_s^-1 B^T made K_s-orthogonal to all before, whose
/// inertia is left out too: static corrections (MacNeal 1971; attachment modes, Craig 1977). Of those the
/// factor of K_s and a triangle are held, and the motions themselves where they are few. What any other force
/// moves beside them is static too, (K_s^-1 - Psi Psi^T) f by that factor, and moves no contact.
class StuckBasis {
 public:
  /// As many as dofs; all modes if they are `asked` for. None if there are none: K or M without symmetry,
  /// with phases or of a wheel, a law without a stuck stiffness, a motion that stuck pairs leave free, or
  /// pairs so much stiffer than the structure that their slip would be lost to rounding. Collective.
  static std::unique_ptr<StuckBasis> of(Model const&, bool asked = false);
  /// The lowest modes, and a factor of K_s for the rest; none likewise. Collective.
  static std::unique_ptr<StuckBasis> with_factor(Model const&);
  /// Doubles that `with_factor` takes: whole on every rank, and over all of them, for so many rows of B.
  static std::pair<double, double> size_with_factor(double dofs, double rows);

  int size() const { return int(theta_.size()); }
  int modes() const { return modes_; }  ///< those of `size` that have inertia
  int rows() const { return int(stiffness_.size()); }
  /// Of each row of B when stuck [force/length]; rows rank by rank, contact by contact, pair by pair.
  std::vector<double> const& stiffness() const { return stiffness_; }
  /// 1 / omega^2 [s^2], descending.
  std::vector<double> const& theta() const { return theta_; }
  /// Of none that is taken to move with stiffness alone, 1 / omega^2 is more; 0 of all modes, and of static
  /// corrections.
  double left_out() const { return factor_ || modes_ == 0 || modes_ == size() ? 0 : theta_[modes_ - 1]; }
  /// B Psi, rows x size.
  std::vector<double> const& motions() const { return motions_; }
  /// Diagonal of Psi^T C Psi over the columns that are held, of all damping of the model. Collective.
  std::vector<double> damping(Model const&) const;
  /// g = Psi^T x of coefficients, innermost, of this rank's dofs: its share. With a factor K_s^-1 x as well,
  /// if it is asked for; then collective.
  void forces(double const* x, int coefficients, double* g, double* moved = nullptr) const;
  /// q = Psi g, by the factor where there is one: then collective.
  void motion(double const* g, int coefficients, double* q) const;
  /// Of K_s where the basis is not all there is.
  StaticFactor const* factor() const { return factor_.get(); }
  /// Of `forces`, `motion` and the factor, a coefficient.
  double flops() const;

 private:
  bool solve(std::vector<double> K, std::vector<double>& M, size_t first, size_t local, bool all);
  bool solve_whole(std::vector<double> K, std::vector<double>& M, int n);
  std::vector<double> diagonal(Mat A) const;
  void add_static(MPI_Comm);
  void static_forces(double const* moved, int coefficients, double* g) const;
  void static_motion(double const* g, int coefficients, double* modal, double* q) const;

  int held() const { return factor_ ? modes_ : size(); }  ///< columns

  int modes_ = 0, local_ = 0;
  double dofs_ = 0;
  std::vector<double> stiffness_, theta_, motions_;
  std::vector<float> shapes_;  ///< Psi of this rank's dofs, column-major, where it is whole
  /// The modes beside a factor: stiff elements, 1e8 times the first mode, outdo single ones.
  std::vector<double> exactly_;
  std::unique_ptr<StaticFactor> factor_;
  std::vector<ContactEntry> own_;  ///< of B, by this rank's dofs
  /// K_s^-1 B^T where its product takes less time than a solve: rows by this rank's dofs.
  bool keeps_static_ = false;  ///< on all ranks, also on those without dofs
  std::vector<float> static_shapes_;
  PivotedCholesky triangle_;
};

/// Of all ranks' contacts, rank by rank, contact by contact.
std::vector<ContactEntry> contact_entries(Model const&);
/// Stiffness of those rows when stuck.
std::vector<double> stuck_stiffness(Model const&);
/// No phases, no wheel, and a stuck stiffness of every pair.
bool has_stuck_stiffness(Model const&, std::vector<double> const& stiffness);
/// Pairs are so much stiffer than the structure that their slip would be lost to rounding: `motions` of unit
/// stiffness, rows x size.
bool too_stiff(std::vector<double> const& motions, std::vector<double> const& stiffness);

}  // namespace fretwave::model
