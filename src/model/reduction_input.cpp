#include "model/reduction_input.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "error.h"
#include "text.h"

namespace fretwave::model {

namespace {

/// Different lists would send the ranks into different collective calls.
void expect_same_on_all_ranks(MPI_Comm comm, std::vector<PetscInt> const& kept) {
  std::array<double, 3> sums{double(kept.size()), 0, 0};
  for (size_t i = 0; i < kept.size(); ++i)
    sums[1] += double(kept[i]), sums[2] += double(i + 1) * double(kept[i]);
  std::array<double, 6> bounds;
  for (int i = 0; i < 3; ++i) bounds[i] = sums[i], bounds[i + 3] = -sums[i];
  MPI_Allreduce(MPI_IN_PLACE, bounds.data(), 6, MPI_DOUBLE, MPI_MAX, comm);
  for (int i = 0; i < 3; ++i)
    if (bounds[i] != -bounds[i + 3])
      throw InputError("the kept dofs differ between the ranks", "different lists", "one list",
                       "give every rank the same kept dofs in the same order");
}

void check_kept(std::vector<PetscInt> const& kept, PetscInt dofs) {
  const std::string range = "0 .. " + std::to_string(dofs - 1);
  if (kept.empty())
    throw InputError("no dof is kept", "none", "one at least", "keep the contact and observation dofs");
  for (PetscInt dof : kept)
    if (dof < 0 || dof >= dofs)
      throw InputError("a kept dof does not exist", std::to_string(dof), range, "number dofs from 0");
  std::vector<PetscInt> sorted = kept;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end())
    throw InputError("a dof is kept twice", std::to_string(*twice), "each dof once",
                     "remove the repeated entry");
  if (PetscInt(kept.size()) == dofs)
    throw InputError("every dof is kept: nothing to reduce", std::to_string(dofs),
                     "fewer than " + std::to_string(dofs), "use the model as it is");
}

void check_wanted(ComponentModes wanted, PetscInt internal) {
  if (wanted.highest_omega < 0 || !std::isfinite(wanted.highest_omega))
    throw InputError("the highest frequency of the component modes is no frequency",
                     short_text(wanted.highest_omega) + " rad/s", "> 0",
                     "give a frequency, or a number of modes");
  if (wanted.highest_omega == 0 && (wanted.count < 0 || wanted.count > internal))
    throw InputError("the number of component modes does not fit the internal dofs",
                     std::to_string(wanted.count), "0 .. " + std::to_string(internal),
                     "ask for fewer component modes");
}

void check_layout(Mat A, PetscInt local, PetscInt global, char const* name) {
  PetscInt rows, cols, local_rows, local_cols;
  check(MatGetSize(A, &rows, &cols));
  check(MatGetLocalSize(A, &local_rows, &local_cols));
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  int differs = rows != global || cols != global || local_rows != local || local_cols != local;
  MPI_Allreduce(MPI_IN_PLACE, &differs, 1, MPI_INT, MPI_MAX, comm);
  if (differs)
    throw InputError(std::string(name) + " does not have the size or the row layout of K",
                     std::to_string(rows) + " x " + std::to_string(cols),
                     std::to_string(global) + " x " + std::to_string(global),
                     "build all matrices with the same row distribution");
}

/// x^T A y against y^T A x for two vectors without pattern.
void check_symmetric(Mat A, char const* name) {
  VecHandle x, y, Ax, Ay;
  check(MatCreateVecs(A, x.out(), y.out()));
  check(MatCreateVecs(A, Ax.out(), Ay.out()));
  PetscInt first;
  check(VecGetOwnershipRange(x, &first, nullptr));
  {
    WriteArray a(x), b(y);
    for (PetscInt i = 0; i < local_size(x); ++i)
      a[i] = std::sin(1.7 * double(first + i)), b[i] = std::cos(2.3 * double(first + i) + 1);
  }
  double xAy, yAx, size, length;
  check(MatMult(A, x, Ax));
  check(MatMult(A, y, Ay));
  check(VecDot(x, Ay, &xAy));
  check(VecDot(y, Ax, &yAx));
  check(VecNorm(Ay, NORM_2, &size));
  check(VecNorm(x, NORM_2, &length));
  if (std::abs(xAy - yAx) > 1e-9 * size * length)
    throw InputError(std::string(name) + " is not symmetric",
                     short_text(std::abs(xAy - yAx) / (size * length)) + " relative", "<= 1e-9",
                     "give both triangles; put gyroscopic terms into C");
}

}  // namespace

void check_reduction_input(Mat K, Mat M, Mat C, std::vector<PetscInt> const& kept, ComponentModes wanted) {
  MPI_Comm comm;
  PetscInt global, local;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(K), &comm));
  check(MatGetSize(K, &global, nullptr));
  check(MatGetLocalSize(K, &local, nullptr));
  check_layout(K, local, global, "K");
  check_layout(M, local, global, "M");
  if (C) check_layout(C, local, global, "C");
  expect_same_on_all_ranks(comm, kept);
  check_kept(kept, global);
  check_wanted(wanted, global - PetscInt(kept.size()));
  check_symmetric(K, "K");
  check_symmetric(M, "M");
}

}  // namespace fretwave::model
