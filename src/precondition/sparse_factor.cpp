#include "precondition/sparse_factor.h"

#include <zmumps_c.h>

#include "error.h"
#include "mumps.h"

namespace fretwave::precondition {

struct SparseFactor::Instance : Mumps<ZMUMPS_STRUC_C, zmumps_c> {
  using Mumps::Mumps;
  void need_block(char const* what) const {
    if (status() == -10)
      throw SingularBlock(
          "a harmonic block of the preconditioner is singular (MUMPS INFOG(1) = -10 at pivot " +
          std::to_string(id.infog[1]) + "): a free motion at this harmonic");
    need(what + std::string(" a harmonic block"));
  }
};

SparseFactor::SparseFactor(MPI_Comm comm, SparsePattern const& pattern, SparseFactor const* model)
    : mumps_(std::make_unique<Instance>(comm, pattern.symmetric)) {
  auto& id = mumps_->id;
  id.n = pattern.size;
  id.nnz_loc = MUMPS_INT8(pattern.rows.size());
  id.irn_loc = const_cast<int*>(pattern.rows.data());
  id.jcn_loc = const_cast<int*>(pattern.cols.data());
  std::vector<int> order;
  if (model && comm_rank(comm) == 0) {
    int const* other = model->mumps_->id.sym_perm;
    order.assign(other, other + pattern.size);
    id.perm_in = order.data();
  }
  if (model) mumps_->icntl(7) = 1;  // given ordering
  mumps_->run(Instance::analyse);
  id.perm_in = nullptr;
  mumps_->need_block("analyse");
}

SparseFactor::SparseFactor(SparseFactor&&) noexcept = default;
SparseFactor::~SparseFactor() = default;

void SparseFactor::factorise(std::vector<std::complex<double>> values) {
  auto& mumps = *mumps_;
  mumps.id.a_loc = reinterpret_cast<ZMUMPS_COMPLEX*>(values.data());
  mumps.run_factorise();
  mumps.id.a_loc = nullptr;
  mumps.need_block("factorise");
}

void SparseFactor::solve(std::complex<double>* x, int columns, bool transposed) {
  auto& id = mumps_->id;
  mumps_->icntl(9) = transposed ? 0 : 1;
  id.rhs = reinterpret_cast<ZMUMPS_COMPLEX*>(x);
  id.nrhs = columns;
  id.lrhs = id.n;
  mumps_->run(Instance::solve);
  id.rhs = nullptr;
  mumps_->need_block("solve with");
}

double SparseFactor::megabytes() const { return mumps_->megabytes(); }
double SparseFactor::entries() const { return mumps_->entries(); }

}  // namespace fretwave::precondition
