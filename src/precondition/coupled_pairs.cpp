#include "precondition/coupled_pairs.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "log.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

// Near a soft motion the blocks enlarge what is left: 3e-2 took twice as many iterations outside.
const Tuned tolerance("pairs_tolerance", 1e-3, "relative residual of the pairs' coupling", 1);

}  // namespace

CoupledPairs::CoupledPairs(MPI_Comm comm, std::vector<PairCorrection const*> own, Between between, int most)
    : comm_(comm), own_(std::move(own)), between_(std::move(between)) {
  for (auto const* E : own_) local_ += size_t(E->size());
  const auto all = gathered(std::span<size_t const>(&local_, 1), comm);
  begin_ = std::accumulate(all.begin(), all.begin() + comm_rank(comm), size_t(0));
  size_ = std::accumulate(all.begin(), all.end(), size_t(0));
  gmres_.emplace(
      comm, local_, [this](std::span<double const> f, std::span<double> out) { product(f, out); }, tolerance,
      most);
}

/// E b of this rank's pairs, b of all.
std::vector<double> CoupledPairs::multiply_pairs(std::vector<double> const& b) const {
  const std::vector<float> rounded(b.begin() + begin_, b.begin() + begin_ + local_);
  std::vector<float> f(local_);
  size_t at = 0;
  for (auto const* E : own_) {
    E->apply(&rounded[at], &f[at]);
    at += size_t(E->size());
  }
  return {f.begin(), f.end()};
}

/// out = f + E (G - G_pp) f
void CoupledPairs::product(std::span<double const> f, std::span<double> out) const {
  const auto all = gathered(f, comm_);
  std::vector<double> u(all.size(), 0.0);
  between_(all.data(), u.data());
  sum_over_ranks(u, comm_);
  std::ranges::transform(multiply_pairs(u), f, out.begin(), std::plus());
}

std::vector<double> CoupledPairs::forces(std::vector<double> const& b) {
  static const log::Event coupling("FwPairs");
  const log::Span span(coupling);
  return gathered(std::span<double const>(gmres_->solve(multiply_pairs(b))), comm_);
}

}  // namespace fretwave::precondition
