#include "blocked_product.h"

#include <algorithm>
#include <cstring>

#include "contact/vectorise.h"

namespace fretwave {

namespace {

// Coefficients in a register of AVX2. GCC 12 keeps wider ones of machines without AVX-512 in memory: 142
// nonzeros in each of 168,000 rows times 7 coefficients take 0.32 s instead of 0.047.
constexpr int width = 4;
constexpr int most = BlockedProduct::most / width;  // registers, of the machine's 16
using Register = double __attribute__((vector_size(width * sizeof(double))));

using Rows = SparseRows;

/// y += A x of some registers of each dof's coefficients, from x and y on. Behind the m of a dof, the next
/// one's are summed too, and left out of y.
template <int registers>
FRETWAVE_INLINE void multiply(Rows const& A, double const* x, double* y, size_t m, int coefficients) {
  for (PetscInt row = 0; row < A.count; ++row, y += m) {
    Register sum[registers] = {};
    for (PetscInt k = A.begin[row]; k < A.begin[row + 1]; ++k) {
      double const* of_dof = x + size_t(A.column[k]) * m;
      for (int r = 0; r < registers; ++r) {
        Register in;
        std::memcpy(&in, of_dof + r * width, sizeof in);
        sum[r] += A.value[k] * in;
      }
    }
    for (int i = 0; i < coefficients; ++i) y[i] += sum[i / width][i % width];
  }
}

/// By as few registers as hold the coefficients.
template <int registers = 1>
FRETWAVE_INLINE void multiply_by_fewest(Rows const& A, double const* x, double* y, size_t m,
                                        int coefficients) {
  if constexpr (registers < most)
    if (coefficients > registers * width) return multiply_by_fewest<registers + 1>(A, x, y, m, coefficients);
  multiply<registers>(A, x, y, m, coefficients);
}

FRETWAVE_VECTORISE
void multiply(Rows const& A, double const* x, double* y, int m) {
  for (int first = 0; first < m; first += most * width)
    multiply_by_fewest(A, x + first, y + first, size_t(m), std::min(most * width, m - first));
}

FRETWAVE_VECTORISE
void multiply_transposed(Rows const& A, double const* x, double* y, int m) {
  for (PetscInt row = 0; row < A.count; ++row)
    for (PetscInt k = A.begin[row]; k < A.begin[row + 1]; ++k) {
      const double a = A.value[k];
      double const* in = x + size_t(row) * m;
      double* out = y + size_t(A.column[k]) * m;
#pragma omp simd
      for (int i = 0; i < m; ++i) out[i] += a * in[i];
    }
}

}  // namespace

BlockedProduct::BlockedProduct(Mat A, int m) : m_(m) {
  MPI_Comm comm;
  PetscInt const* dofs = nullptr;
  PetscBool parallel;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatGetLocalSize(A, &local_, nullptr));
  check(PetscObjectBaseTypeCompare(reinterpret_cast<PetscObject>(A), MATMPIAIJ, &parallel));
  if (parallel) {
    parts_.resize(2);
    check(MatMPIAIJGetSeqAIJ(A, &parts_[0].A, &parts_[1].A, &dofs));
    check(MatGetSize(parts_[1].A, nullptr, &others_));
    parts_[1].first_column = local_;
  } else {
    parts_.push_back({A, 0});
  }
  columns_.assign(size_t(local_ + others_) * m + width, 0.0);
  check(VecCreateMPIWithArray(comm, 1, local_ * m, PETSC_DECIDE, columns_.data(), mine_.out()));
  if (!parallel) return;
  check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, others_ * m, columns_.data() + size_t(local_) * m,
                              ghosts_.out()));
  IsHandle from;
  check(ISCreateBlock(PETSC_COMM_SELF, m, others_, dofs, PETSC_COPY_VALUES, from.out()));
  check(VecScatterCreate(mine_, from, ghosts_, nullptr, exchange_.out()));
}

/// visit(rows) of a part.
template <class Visit>
void BlockedProduct::with_rows(Part const& part, Visit visit) const {
  Rows rows;
  PetscBool done;
  check(MatGetRowIJ(part.A, 0, PETSC_FALSE, PETSC_FALSE, &rows.count, &rows.begin, &rows.column, &done));
  check(MatSeqAIJGetArrayRead(part.A, &rows.value));
  visit(rows);
  check(MatSeqAIJRestoreArrayRead(part.A, &rows.value));
  check(MatRestoreRowIJ(part.A, 0, PETSC_FALSE, PETSC_FALSE, &rows.count, &rows.begin, &rows.column, &done));
}

/// visit(rows, coefficients) of both parts; others' coefficients come while this rank's are worked on.
template <class Visit>
void BlockedProduct::with_parts(Visit visit) {
  if (exchange_) check(VecScatterBegin(exchange_, mine_, ghosts_, INSERT_VALUES, SCATTER_FORWARD));
  for (Part const& part : parts_) {
    if (&part != parts_.data())
      check(VecScatterEnd(exchange_, mine_, ghosts_, INSERT_VALUES, SCATTER_FORWARD));
    with_rows(part, [&](Rows const& rows) { visit(rows, columns_.data() + size_t(part.first_column) * m_); });
  }
}

void BlockedProduct::multiply_add(Vec y) {
  const WriteArray out(y);
  with_parts([&](Rows const& rows, double const* x) { multiply(rows, x, out.data(), m_); });
}

void BlockedProduct::multiply_exactly(Vec y, Vec low) {
  const WriteArray out(y), below(low);
  with_parts([&](Rows const& rows, double const* x) {
    fretwave::multiply_exactly(rows, x, out.data(), below.data(), m_);
  });
}

void BlockedProduct::transposed_multiply_add(Vec y) {
  const std::vector<double> x(columns_.begin(), columns_.begin() + std::ptrdiff_t(local_) * m_);
  std::ranges::fill(columns_, 0.0);
  for (Part const& part : parts_)
    with_rows(part, [&](Rows const& rows) {
      multiply_transposed(rows, x.data(), columns_.data() + size_t(part.first_column) * m_, m_);
    });
  if (exchange_) {
    check(VecScatterBegin(exchange_, ghosts_, mine_, ADD_VALUES, SCATTER_REVERSE));
    check(VecScatterEnd(exchange_, ghosts_, mine_, ADD_VALUES, SCATTER_REVERSE));
  }
  const WriteArray out(y);
  for (size_t k = 0; k < size_t(local_) * m_; ++k) out[PetscInt(k)] += columns_[k];
}

}  // namespace fretwave
