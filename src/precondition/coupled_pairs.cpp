#include "precondition/coupled_pairs.h"

#include "log.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

// Near a soft motion the blocks enlarge what is left: 3e-2 took twice as many iterations outside.
const Tuned tolerance("pairs_tolerance", 1e-3, "relative residual of the pairs' coupling");

}  // namespace

CoupledPairs::CoupledPairs(MPI_Comm comm, std::vector<PairCorrection const*> own, Between between, int most)
    : comm_(comm), own_(std::move(own)), between_(std::move(between)) {
  PC pc;
  PetscInt local = 0;
  for (auto const* E : own_) local += E->size();
  right_ = make_vector(comm, local), f_ = like(right_);
  check(VecGetOwnershipRange(f_, &begin_, nullptr));
  check(VecGetSize(f_, &size_));
  check(MatCreateShell(comm, local, local, size_, size_, this, A_.out()));
  check(MatShellSetOperation(A_, MATOP_MULT, reinterpret_cast<void (*)(void)>(shell_product)));
  check(KSPCreate(comm, ksp_.out()));
  check(KSPSetOperators(ksp_, A_, A_));
  check(KSPSetType(ksp_, KSPGMRES));
  check(KSPGMRESSetRestart(ksp_, most));
  check(KSPSetTolerances(ksp_, tolerance, PETSC_DEFAULT, PETSC_DEFAULT, most));
  check(KSPGetPC(ksp_, &pc));
  check(PCSetType(pc, PCNONE));
}

/// f = E b, f of this rank's pairs, b of all.
void CoupledPairs::multiply_pairs(std::vector<double> const& b, double* f) const {
  double const* from = b.data() + begin_;
  for (auto const* E : own_) {
    E->apply(from, f);
    from += E->size(), f += E->size();
  }
}

PetscErrorCode CoupledPairs::shell_product(Mat A, Vec f, Vec out) {
  CoupledPairs* pairs;
  const PetscErrorCode code = MatShellGetContext(A, &pairs);
  if (code) return code;
  return pairs->guard_.run([&] { pairs->product(f, out); });
}

/// out = f + E (G - G_pp) f
void CoupledPairs::product(Vec f, Vec out) const {
  const auto in = gathered(f);
  std::vector<double> u(in.size(), 0.0);
  between_(in.data(), u.data());
  sum_over_ranks(u, comm_);
  multiply_pairs(u, WriteArray(out).data());
  check(VecAXPY(out, 1, f));
}

std::vector<double> CoupledPairs::forces(std::vector<double> const& b) {
  static const log::Event coupling("FwPairs");
  const log::Span span(coupling);
  multiply_pairs(b, WriteArray(right_).data());
  const PetscErrorCode code = KSPSolve(ksp_, right_, f_);
  guard_.rethrow();
  check(code);
  return gathered(f_);
}

}  // namespace fretwave::precondition
