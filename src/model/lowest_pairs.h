#pragma once
#include <slepcst.h>

#include <vector>

#include "petsc.h"

namespace fretwave::model {

/// An eigenvalue with its vector, of unit length in M.
struct EigenPair {
  double value;
  VecHandle vector;
};

/// The pencil K x = lambda M x of symmetric matrices, M without negative eigenvalues.
struct Pencil {
  Mat K, M;
  PetscInt size;         ///< number of finite eigenvalues, at most
  PetscInt constraints;  ///< rows of a saddle point's constraints: each has a negative pivot
  double shift;          ///< where K - shift M is regular, next to the eigenvalues wanted
  double rounding;       ///< what rounding in K leaves in an eigenvalue
  bool stable = false;   ///< a motion of negative stiffness is refused; else it is left out
};

/// The `count` eigenvalues next to the shift, or more, ascending, by SLEPc with shift-invert under the prefix
/// "modes_". Those up to the last are counted by inertia: what the Krylov space has missed (further copies of
/// multiple eigenvalues, members of a family) is searched for among the vectors orthogonal to those found.
/// `PetscFailure` names what is still missing then. Collective.
std::vector<EigenPair> lowest_pairs(Pencil const&, PetscInt count);

/// The lowest pairs of a pencil, whose shift lies just below zero in the scale of the stiffest dof. Rigid
/// motions next to it make the inverse so large that its rounding spoils the shapes far above them, and of
/// motions all softer than it no more is known than a share of it: both kinds are found again from as far
/// below zero as the first of their kind, or the last, lies above. Where all lie above the shift and none is
/// far above the others it serves them all. Collective.
std::vector<EigenPair> lowest_beside_zero(Pencil, PetscInt count);

/// InputError where K is negative for the first of these motions, ascending, beyond what printed digits
/// leave. Collective.
void expect_stable(Pencil const&, std::vector<EigenPair> const&);

/// Whether an eigenvalue is that of a motion that nothing holds, but for rounding; `scale`: of the stiffest
/// dofs. Collective.
bool is_rigid(Mat K, double scale, double value, Vec vector);

/// The `count` eigenvalues nearest to a shift amid the spectrum, ascending; likewise counted, within their
/// distance of the shift. Collective.
std::vector<EigenPair> nearest_pairs(Pencil const&, PetscInt count);

/// Shift-invert by MUMPS' LU: the saddle point of rigid contact is indefinite.
void shift_invert(ST);

}  // namespace fretwave::model
