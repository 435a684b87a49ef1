#pragma once
#include <string>

#include "petsc.h"

namespace fretwave::model {

/// Workspace beyond MUMPS' own estimate [%] for the pivots that an indefinite matrix delays.
constexpr PetscInt delayed_pivots = 200;
/// Pivots over the scaled matrix below which they are none; rounding leaves 1e-15 of a rigid motion.
constexpr double null_pivot = 1e-13;

/// L D L^T of a symmetric matrix by MUMPS, which also counts negative and null pivots. `PetscFailure` where
/// there is none. `room`: workspace beyond the estimate [%]. Collective.
KspHandle symmetric_factor(Mat A, std::string const& prefix, PetscInt room = 35);
/// `PetscFailure` if the factorisation, or the solve just made with it, failed. Collective.
void expect_factorised(KSP);
PetscInt negative_pivots(KSP);
PetscInt null_pivots(KSP);
/// Of all ranks: what the factors took [MB], and their entries.
double factor_megabytes(KSP);
double factor_entries(KSP);

/// Number of eigenvalues of K x = lambda M x below lambda, for M without negative ones: negative pivots of
/// K - lambda M (Sylvester's law of inertia), which misses no multiple one. Collective.
PetscInt count_below(Mat K, Mat M, double lambda, std::string const& prefix);

}  // namespace fretwave::model
