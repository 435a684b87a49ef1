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
  PetscInt local = 0;
  for (auto const* E : own_) local += E->size();
  gmres_.emplace(comm, local, [this](Vec f, Vec out) { product(f, out); }, tolerance, most);
  check(VecGetOwnershipRange(gmres_->right(), &begin_, nullptr));
  check(VecGetSize(gmres_->right(), &size_));
}

/// f = E b, f of this rank's pairs, b of all.
void CoupledPairs::multiply_pairs(std::vector<double> const& b, double* f) const {
  double const* from = b.data() + begin_;
  for (auto const* E : own_) {
    E->apply(from, f);
    from += E->size(), f += E->size();
  }
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
  multiply_pairs(b, WriteArray(gmres_->right()).data());
  return gathered(gmres_->solve());
}

}  // namespace fretwave::precondition
