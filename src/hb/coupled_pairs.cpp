#include "hb/coupled_pairs.h"

#include <algorithm>

#include "log.h"

namespace fretwave::hb {

namespace {

constexpr double tolerance = 1e-3;
constexpr int most =
    400;  // iterations, none forgotten: they creep until enough of the pairs' modes are found

}  // namespace

CoupledPairs::CoupledPairs(MPI_Comm comm, int size, std::vector<Own> own,
                           std::vector<std::unique_ptr<HarmonicBlock>> between)
    : comm_(comm), size_(size), own_(std::move(own)), between_(std::move(between)) {
  PC pc;
  right_ = make_vector(PETSC_COMM_SELF, size), f_ = like(right_);
  check(MatCreateShell(PETSC_COMM_SELF, size, size, size, size, this, A_.out()));
  check(MatShellSetOperation(A_, MATOP_MULT, reinterpret_cast<void (*)(void)>(product)));
  check(KSPCreate(PETSC_COMM_SELF, ksp_.out()));
  check(KSPSetOperators(ksp_, A_, A_));
  check(KSPSetType(ksp_, KSPGMRES));
  check(KSPGMRESSetRestart(ksp_, most));
  check(KSPSetTolerances(ksp_, tolerance, PETSC_DEFAULT, PETSC_DEFAULT, most));
  check(KSPGetPC(ksp_, &pc));
  check(PCSetType(pc, PCNONE));
}

/// f = E b
void CoupledPairs::multiply_pairs(double const* b, double* f) const {
  std::fill_n(f, size_, 0.0);
  for (auto const& [first, E] : own_) E->apply(b + first, f + first);
  sum_over_ranks(std::span(f, size_), comm_);
}

PetscErrorCode CoupledPairs::product(Mat A, Vec f, Vec out) {
  CoupledPairs const* pairs;
  const PetscErrorCode code = MatShellGetContext(A, &pairs);
  if (code) return code;
  std::vector<double> u(pairs->size_, 0.0);
  const ReadArray in(f);
  for (auto const& G : pairs->between_) G->apply(in.data(), u.data());
  sum_over_ranks(u, pairs->comm_);
  const WriteArray to(out);
  pairs->multiply_pairs(u.data(), to.data());
  for (int k = 0; k < pairs->size_; ++k) to[k] += in[k];
  return 0;
}

std::vector<double> CoupledPairs::forces(std::span<double const> b) const {
  static const log::Event coupling("FwPairs");
  const log::Span span(coupling);
  multiply_pairs(b.data(), WriteArray(right_).data());
  check(KSPSolve(ksp_, right_, f_));
  const ReadArray f(f_);
  return {f.data(), f.data() + size_};
}

}  // namespace fretwave::hb
