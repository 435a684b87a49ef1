#include "model/stiff_contact.h"

#include <algorithm>
#include <cmath>

#include "model/phases.h"
#include "tuned.h"

namespace fretwave::model {

namespace {

const Tuned far_stiffer(
    "modes_far_stiffer", 1e3,
    "times the structure's largest stiffness, from which linear modes take contact by its "
    "forces");

double largest_diagonal(Mat K) {
  VecHandle d;
  double largest;
  check(MatCreateVecs(K, d.out(), nullptr));
  check(MatGetDiagonal(K, d));
  check(VecNorm(d, NORM_INFINITY, &largest));
  return largest;
}

}  // namespace

StiffContact::StiffContact(Model const& model, Mat K) : limit_(far_stiffer * largest_diagonal(K)) {
  std::vector<MatHandle> parts;
  const int copies = model.travelling() ? 2 : 1;
  for (auto const& contact : model.contacts()) {
    PetscInt begin, counts[2] = {};
    check(MatGetOwnershipRange(contact.B, &begin, nullptr));
    std::vector<PetscInt> rows;
    const int d = contact.law->components();
    for (int row = 0; row < d * contact.law->pairs(); ++row) {
      const double k = contact.law->stuck_stiffness(row % d, row / d);
      if (!takes(k)) continue;
      rows.push_back(begin + row);
      compliance_.insert(compliance_.end(), copies, 1 / k);
      counts[0] += copies, counts[1] += std::isinf(k) ? copies : 0;
    }
    MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPIU_INT, MPI_SUM, model.comm());
    if (counts[0] > 0) parts.push_back(map(model, contact, rows));
    rows_ += counts[0], rigid_ += counts[1];
  }
  if (parts.size() == 1) B_ = std::move(parts[0]);
  if (parts.size() <= 1) return;
  std::vector<Mat> raw(parts.begin(), parts.end());
  MatHandle nest;
  check(MatCreateNest(model.comm(), PetscInt(raw.size()), nullptr, 1, nullptr, raw.data(), nest.out()));
  check(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, B_.out()));
}

/// Those rows of B in real form.
MatHandle StiffContact::map(Model const& model, Contact const& contact,
                            std::vector<PetscInt> const& rows) const {
  IsHandle rows_set, cols_set;
  check(ISCreateGeneral(model.comm(), PetscInt(rows.size()), rows.data(), PETSC_COPY_VALUES, rows_set.out()));
  check(ISCreateStride(model.comm(), model.local_dofs(), model.first_dof(), 1, cols_set.out()));
  std::vector<PhasedMap> parts;
  for (auto const& [B, phase] : maps_of(contact)) {
    parts.push_back({{}, phase});
    check(MatCreateSubMatrix(B, rows_set, cols_set, MAT_INITIAL_MATRIX, parts.back().B.out()));
  }
  return real_form(parts, model.theta(), model.travelling());
}

void StiffContact::scale(Vec dofs) {
  VecHandle largest;
  check(MatDiagonalScale(B_, nullptr, dofs));
  check(MatCreateVecs(B_, nullptr, largest.out()));
  check(MatGetRowMaxAbs(B_, largest, nullptr));
  check(VecReciprocal(largest));
  check(MatDiagonalScale(B_, largest, nullptr));
  const ReadArray s(largest);
  for (size_t i = 0; i < compliance_.size(); ++i) compliance_[i] *= s[i] * s[i];
}

MatHandle StiffContact::beside(Mat K) const { return saddle(K, 1); }
MatHandle StiffContact::beside_mass(Mat M) const { return saddle(M, 0); }

/// [A, s B^H; s B, -s / k]
MatHandle StiffContact::saddle(Mat A, double scale) const {
  MatHandle scaled, transposed, nest, whole, corner;
  MPI_Comm comm;
  const PetscInt rows = PetscInt(compliance_.size());
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatDuplicate(B_, MAT_COPY_VALUES, scaled.out()));
  check(MatScale(scaled, scale));
  check(MatTranspose(scaled, MAT_INITIAL_MATRIX, transposed.out()));
  check(
      MatCreateAIJ(comm, rows, rows, PETSC_DETERMINE, PETSC_DETERMINE, 1, nullptr, 0, nullptr, corner.out()));
  PetscInt first;
  check(MatGetOwnershipRange(corner, &first, nullptr));
  for (PetscInt i = 0; i < rows; ++i)
    if (compliance_[i] > 0)
      check(MatSetValue(corner, first + i, first + i, -scale * compliance_[i], INSERT_VALUES));
  check(MatAssemblyBegin(corner, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(corner, MAT_FINAL_ASSEMBLY));
  Mat blocks[4] = {A, transposed, scaled, corner};
  check(MatCreateNest(comm, 2, nullptr, 2, nullptr, blocks, nest.out()));
  check(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, whole.out()));
  return whole;
}

}  // namespace fretwave::model
