#pragma once
#include <functional>

#include "model/modes.h"
#include "model/phases.h"

namespace fretwave::model {

/// sum += B^H D B with one stiffness or damping per contact row, a function of (component, pair); rows that
/// are not finite count as zero. Collective.
void add_contact(std::vector<PhasedMap>& sum, Contact const&, std::function<double(int, int)> const& entry);

/// The model's terms of an order in s; `InputError` names what is missing.
std::vector<PhasedMap> required(Model const&, int order, char const* name);

/// Whether a matrix is its transpose, but for rounding. (PETSc's own test compares patterns, which assembly
/// leaves unsymmetric where entries cancel.) Collective.
bool symmetric(Mat);

/// Whether sum_k A_k e^{-i k theta} is Hermitian, but for what rounding leaves of its largest entries or row
/// by row, told from x^H A y = (y^H A x)* of two vectors of scrambled entries: no copy of a large matrix.
/// Collective.
bool hermitian(std::vector<PhasedMap> const& terms, double theta);

/// Matrices of an eigenproblem; a small one is held whole by each rank, which all solve the same: cheaper
/// than to share it, and the Krylov space of a tiny problem, once exhausted, would end at another step on
/// another rank.
struct Operators {
  std::vector<MatHandle> matrices;
  PetscInt offset = 0;  ///< where this rank's rows begin in its part of a vector
  Mat operator[](int k) const { return matrices[k]; }
  MPI_Comm comm() const {
    MPI_Comm comm;
    check(PetscObjectGetComm(reinterpret_cast<PetscObject>(Mat(matrices[0])), &comm));
    return comm;
  }
};

Operators operators(MPI_Comm, std::vector<MatHandle> matrices);

/// This rank's dofs of an eigenvector re + i im (im may be null), behind which the constraints stand; of a
/// travelling wave in real form (x, y) the shape x + i y.
void take_shape(Model const&, Operators const&, Vec re, Vec im, LinearMode&);

/// A square of frequency [1/s^2] of the stiffest dofs: trace K / trace M. Collective.
double trace_ratio(Mat K, Mat M);
/// The same; of the sector's own term where the terms cancel in a wave. Collective.
double scale_of(Mat K, Mat M, std::vector<PhasedMap> const& terms);
/// Makes K zero where it is but the rounding of terms that cancel in a wave. Collective.
void cancel(Mat K, std::vector<PhasedMap> const& terms);

/// Scales of the dofs by which no mass outweighs the others: what rigid contact holds it holds but for
/// rounding, which a mass 1e12 times the others' lets them feel. Collective.
VecHandle balance(Mat K, Mat M);
/// diag(left) A diag(right); each row by its largest entry where there is no `left`.
MatHandle scaled(Mat A, Vec left, Vec right);
/// This rank's dofs of x, which begin at the offset of `Operators`, by their scales; behind them stand
/// constraints.
VecHandle scaled_back(Vec x, Vec scales, PetscInt offset);

}  // namespace fretwave::model
