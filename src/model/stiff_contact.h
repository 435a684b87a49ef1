#pragma once
#include <map>
#include <vector>

#include "model/model.h"

namespace fretwave::model {

/// Stuck contact that is far stiffer than the structure, or rigid, by its forces f beside the motion:
///
///     [K  B^H ] [q]           [M  0] [q]
///     [B  -1/k] [f] = omega^2 [0  0] [f].
///
/// Assembled as K + B^H k B its rounding would outdo the structure: 1e-16 of a stiffness 1e12 times as large.
/// Each row has one negative pivot; rigid ones (1/k = 0) take a degree of freedom each.
class StiffContact {
 public:
  /// `K`: of the structure alone, in real form. Collective.
  StiffContact(Model const&, Mat K);
  /// Whether that row of this rank's pairs is among them.
  bool takes(Contact const&, int component, int pair) const;
  /// Of all ranks, in real form; and those of them that are rigid.
  PetscInt rows() const { return rows_; }
  PetscInt rigid() const { return rigid_; }
  /// To dofs that were scaled; each row by its largest entry. Collective.
  void scale(Vec dofs);
  /// The two matrices; the dofs come first on each rank. Collective.
  MatHandle beside(Mat K) const;
  MatHandle beside_mass(Mat M) const;

 private:
  MatHandle saddle(Mat A, double scale) const;

  std::map<Contact const*, std::vector<bool>> taken_;  ///< of this rank's rows
  PetscInt rows_ = 0, rigid_ = 0;
  MatHandle B_;
  std::vector<double> compliance_;  ///< 1/k of this rank's rows
};

}  // namespace fretwave::model
