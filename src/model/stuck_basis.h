#pragma once
#include <memory>
#include <vector>

#include "model/model.h"

namespace fretwave::model {

/// Modes of K + B^T k B with all pairs stuck, of unit stiffness: Phi^T (K + B^T k B) Phi = 1 and Phi^T M Phi
/// = diag(theta), theta = 1 / omega^2 descending. In this one real basis the dynamic stiffness is diagonal at
/// every harmonic and every point while all pairs stick. Sought as M phi = theta (K + B^T k B) phi, the
/// lowest frequencies keep their digits beside stiff contact, and M may be singular. Whole on every rank.
class StuckBasis {
 public:
  /// None if there is none: K or M without symmetry, with phases or of a wheel, a law without a stuck
  /// stiffness, a motion that stuck pairs leave free, or pairs so much stiffer than the structure that their
  /// slip would be lost to rounding. Collective.
  static std::unique_ptr<StuckBasis> of(Model const&);
  int dofs() const { return dofs_; }
  int rows() const { return int(stiffness_.size()); }
  /// Of each row of B when stuck [force/length]; rows rank by rank, contact by contact, pair by pair.
  std::vector<double> const& stiffness() const { return stiffness_; }
  /// 1 / omega^2 [s^2], descending.
  std::vector<double> const& theta() const { return theta_; }
  /// Diagonal of Phi^T A Phi of a term that is neither K nor M.
  std::vector<double> diagonal(Mat A) const;
  /// Phi, dofs x dofs.
  std::vector<float> const& shapes() const { return shapes_; }
  /// B Phi, rows x dofs.
  std::vector<double> const& motions() const { return motions_; }

 private:
  bool solve(std::vector<double> K, std::vector<double>& M);

  int dofs_ = 0;
  std::vector<double> stiffness_, theta_, motions_;
  std::vector<float> shapes_;
};

}  // namespace fretwave::model
