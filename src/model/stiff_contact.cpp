#include "model/stiff_contact.h"

#include <algorithm>
#include <cmath>

#include "model/phases.h"
#include "tuned.h"

namespace fretwave::model {

namespace {

const Tuned far_stiffer(
    "modes_far_stiffer", 1e3,
    "times the structure's own stiffness, from which linear modes take contact by its forces");

MatHandle rows_of(Mat B, std::vector<PetscInt> const& rows) {
  IsHandle rows_set, cols_set;
  MatHandle out;
  MPI_Comm comm;
  PetscInt begin, end;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(B), &comm));
  check(MatGetOwnershipRangeColumn(B, &begin, &end));
  check(ISCreateGeneral(comm, PetscInt(rows.size()), rows.data(), PETSC_COPY_VALUES, rows_set.out()));
  check(ISCreateStride(comm, end - begin, begin, 1, cols_set.out()));
  check(MatCreateSubMatrix(B, rows_set, cols_set, MAT_INITIAL_MATRIX, out.out()));
  return out;
}

/// The structure's own stiffness [force/length] at this rank's rows: k adds k b_j^2 to its K_jj. Collective.
std::vector<double> stiffness_at(Mat B, Mat K) {
  VecHandle diagonal;
  MatHandle weighted;
  check(MatCreateVecs(K, diagonal.out(), nullptr));
  check(MatGetDiagonal(K, diagonal));
  check(VecAbs(diagonal));
  check(MatDuplicate(B, MAT_COPY_VALUES, weighted.out()));
  check(MatDiagonalScale(weighted, nullptr, diagonal));
  std::vector<double> bK;
  for_entries(weighted, [&](PetscInt, PetscInt, double value) { bK.push_back(value); });
  PetscInt rows, first;
  check(MatGetLocalSize(B, &rows, nullptr));
  check(MatGetOwnershipRange(B, &first, nullptr));
  std::vector<double> own(static_cast<size_t>(rows)), size(own.size());
  auto next = bK.begin();
  for_entries(B, [&](PetscInt row, PetscInt, double b) {
    own[size_t(row - first)] += b * *next++, size[size_t(row - first)] += b * b;
  });
  for (size_t row = 0; row < own.size(); ++row)  // one that touches no dof is none
    own[row] = size[row] > 0 ? own[row] / (size[row] * size[row]) : INFINITY;
  return own;
}

}  // namespace

StiffContact::StiffContact(Model const& model, Mat K) {
  std::vector<MatHandle> parts;
  const PetscInt copies = model.travelling() ? 2 : 1;
  for (auto const& contact : model.contacts()) {
    const MatHandle B = real_form(maps_of(contact), model.theta(), model.travelling());
    const auto own = stiffness_at(B, K);
    PetscInt begin, counts[2] = {};
    check(MatGetOwnershipRange(B, &begin, nullptr));
    std::vector<PetscInt> rows;
    auto& taken = taken_[&contact];
    const int d = contact.law->components();
    for (int row = 0; row < d * contact.law->pairs(); ++row) {
      const double k = contact.law->stuck_stiffness(row % d, row / d);
      taken.push_back(k > far_stiffer * own[size_t(row * copies)]);
      for (PetscInt copy = 0; taken.back() && copy < copies; ++copy) {
        rows.push_back(begin + row * copies + copy), compliance_.push_back(1 / k);
        ++counts[0], counts[1] += std::isinf(k) ? 1 : 0;
      }
    }
    MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPIU_INT, MPI_SUM, model.comm());
    if (counts[0] > 0) parts.push_back(rows_of(B, rows));
    rows_ += counts[0], rigid_ += counts[1];
  }
  if (parts.size() == 1) B_ = std::move(parts[0]);
  if (parts.size() <= 1) return;
  std::vector<Mat> raw(parts.begin(), parts.end());
  MatHandle nest;
  check(MatCreateNest(model.comm(), PetscInt(raw.size()), nullptr, 1, nullptr, raw.data(), nest.out()));
  check(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, B_.out()));
}

bool StiffContact::takes(Contact const& contact, int component, int pair) const {
  return taken_.at(&contact)[size_t(pair) * contact.law->components() + component];
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
