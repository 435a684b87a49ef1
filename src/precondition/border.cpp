#include "precondition/border.h"

#include <algorithm>

#include "error.h"
#include "lapack.h"
#include "log.h"

namespace fretwave::precondition {

/// This rank's share of R q.
std::vector<double> Border::along_rows(Local const& q) const {
  std::vector<double> out;
  const int n = int(q.size()), step = 1;
  for (auto const& row : rows_) out.push_back(ddot_(&n, q.data(), &step, row.data(), &step));
  return out;
}

void Border::make(Solve solve, std::vector<Local> const& columns, std::vector<Local> rows,
                  std::vector<double> S, MPI_Comm comm) {
  comm_ = comm, solve_ = std::move(solve), rows_ = std::move(rows);
  AC_.clear();
  std::vector<double> RAC;
  for (auto const& column : columns) {
    AC_.push_back(solve_(column.data()));
    for (double share : along_rows(AC_.back())) RAC.push_back(share);
  }
  sum_over_ranks(RAC, comm_);
  for (size_t k = 0; k < S.size(); ++k) S[k] -= RAC[k];
  inverse_S_ = std::move(S);
  if (const int info = lapack::invert(inverse_S_, int(rows_.size())))
    throw SingularBlock("the border of the preconditioner is singular (LAPACK info " + std::to_string(info) +
                        "): the chosen dof does not move");
}

void Border::apply(double const* x, double* z) const {
  auto q = solve_(x);
  static const log::Event border("FwBorder");
  const log::Span span(border);
  const size_t size = rows_.size();
  auto rest = along_rows(q);
  for (double& r : rest) r = -r;
  const bool last = comm_rank(comm_) == comm_size(comm_) - 1;
  for (size_t i = 0; i < size && last; ++i) rest[i] += x[q.size() + i];
  MPI_Allreduce(MPI_IN_PLACE, rest.data(), int(size), MPI_DOUBLE, MPI_SUM, comm_);
  for (size_t j = 0; j < size; ++j) {
    double scalar = 0;
    for (size_t i = 0; i < size; ++i) scalar += inverse_S_[i * size + j] * rest[i];
    if (last) z[q.size() + j] = scalar;
    for (size_t k = 0; k < q.size(); ++k) q[k] -= scalar * AC_[j][k];
  }
  std::ranges::copy(q, z);
}

}  // namespace fretwave::precondition
