#include "proportional.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fretwave {

namespace {

/// visit(entries, values of A, of B) of this rank's rows, while both have them in the same
/// places; false where they have not.
template <class Visit>
bool with_both(Mat A, Mat B, Visit visit) {
  PetscInt begin, end;
  check(MatGetOwnershipRange(A, &begin, &end));
  bool alike = true;
  for (PetscInt row = begin; row < end && alike; ++row) {
    PetscInt a_count, b_count;
    PetscInt const *a_cols, *b_cols;
    PetscScalar const *a, *b;
    check(MatGetRow(A, row, &a_count, &a_cols, &a));
    check(MatGetRow(B, row, &b_count, &b_cols, &b));
    alike = a_count == b_count && std::equal(a_cols, a_cols + a_count, b_cols) && visit(a_count, a, b);
    check(MatRestoreRow(B, row, &b_count, &b_cols, &b));
    check(MatRestoreRow(A, row, &a_count, &a_cols, &a));
  }
  return alike;
}

}  // namespace

double multiple_of(Mat A, Mat B) {
  double mine[2] = {0, 0};  // the largest entry of B, and what A is there over it
  int alike = with_both(A, B, [&](PetscInt count, double const* a, double const* b) {
    for (PetscInt k = 0; k < count; ++k)
      if (std::abs(b[k]) > mine[0]) mine[0] = std::abs(b[k]), mine[1] = a[k] / b[k];
    return true;
  });
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  double most = 0, times = 0;
  const auto all = gathered(std::span<double const>(mine, 2), comm);
  for (size_t rank = 0; rank < all.size(); rank += 2)
    if (all[rank] > most) most = all[rank], times = all[rank + 1];
  alike = alike && with_both(A, B, [&](PetscInt count, double const* a, double const* b) {
            for (PetscInt k = 0; k < count; ++k)
              if (std::abs(a[k] - times * b[k]) > 4 * std::numeric_limits<double>::epsilon() * std::abs(a[k]))
                return false;
            return true;
          });
  MPI_Allreduce(MPI_IN_PLACE, &alike, 1, MPI_INT, MPI_LAND, comm);
  return alike && std::isfinite(times) ? times : 0;
}

}  // namespace fretwave
