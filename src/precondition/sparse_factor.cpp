#include "precondition/sparse_factor.h"

#include <zmumps_c.h>

#include <algorithm>

#include "error.h"

namespace fretwave::precondition {

namespace {

enum Job { begin = -1, end = -2, analyse = 1, factorise_matrix = 2, solve_system = 3 };
constexpr int workspace_short[] = {-8, -9, -14, -15, -17, -20};  // INFOG(1), cured by a larger ICNTL(14)

}  // namespace

struct SparseFactor::Instance {
  ZMUMPS_STRUC_C id{};

  Instance(MPI_Comm comm, bool symmetric) {
    id.comm_fortran = MUMPS_INT(MPI_Comm_c2f(comm));
    id.par = 1;
    id.sym = symmetric ? 2 : 0;
    run(begin);
    for (int k : {1, 2, 3}) icntl(k) = -1;  // no output
    icntl(4) = 0;
    icntl(14) = 50;  // workspace beyond the estimate [%]
    icntl(18) = 3;   // entries distributed
    icntl(28) = 1;   // sequential analysis: the parallel one needs an ordering that Debian leaves out
  }
  ~Instance() {
    int finalised;
    MPI_Finalized(&finalised);
    if (!finalised) run(end);
  }
  Instance(Instance const&) = delete;
  MUMPS_INT& icntl(int k) { return id.icntl[k - 1]; }
  int status() const { return id.infog[0]; }
  void run(Job job) {
    id.job = job;
    zmumps_c(&id);
  }
  void need(char const* what) const {
    if (status() >= 0) return;
    if (status() == -10)
      throw SingularBlock(
          "a harmonic block of the preconditioner is singular (MUMPS INFOG(1) = -10 at pivot " +
          std::to_string(id.infog[1]) + "): a free motion at this harmonic");
    if (status() == -13)
      throw RankFailure("there is not enough memory for the sparse factors",
                        "MUMPS INFOG(1) = -13, INFOG(2) = " + std::to_string(id.infog[1]),
                        "use more ranks on more machines, fewer harmonics or a reduced model");
    throw PetscFailure(std::string("MUMPS cannot ") + what + " a harmonic block: INFOG(1) = " +
                       std::to_string(status()) + ", INFOG(2) = " + std::to_string(id.infog[1]));
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
  mumps_->run(analyse);
  id.perm_in = nullptr;
  mumps_->need("analyse");
}

SparseFactor::SparseFactor(SparseFactor&&) noexcept = default;
SparseFactor::~SparseFactor() = default;

void SparseFactor::factorise(std::vector<std::complex<double>> values) {
  auto& mumps = *mumps_;
  mumps.id.a_loc = reinterpret_cast<ZMUMPS_COMPLEX*>(values.data());
  for (int attempt = 0; attempt < 5; ++attempt, mumps.icntl(14) *= 2) {
    mumps.run(factorise_matrix);
    if (std::find(std::begin(workspace_short), std::end(workspace_short), mumps.status()) ==
        std::end(workspace_short))
      break;
  }
  mumps.id.a_loc = nullptr;
  mumps.need("factorise");
}

void SparseFactor::solve(std::complex<double>* x, int columns, bool transposed) {
  auto& id = mumps_->id;
  mumps_->icntl(9) = transposed ? 0 : 1;
  id.rhs = reinterpret_cast<ZMUMPS_COMPLEX*>(x);
  id.nrhs = columns;
  id.lrhs = id.n;
  mumps_->run(solve_system);
  id.rhs = nullptr;
  mumps_->need("solve with");
}

double SparseFactor::megabytes() const { return mumps_->id.infog[21]; }

/// MUMPS gives large counts in millions, with a minus sign.
double SparseFactor::entries() const {
  const double count = mumps_->id.infog[28];
  return count < 0 ? -1e6 * count : count;
}

}  // namespace fretwave::precondition
