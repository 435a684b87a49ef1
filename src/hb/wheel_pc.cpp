#include "hb/wheel_pc.h"

namespace fretwave::hb {

namespace {

constexpr double beside = 1e-3;  // shift of the fundamental's exponent from where its block is singular

}  // namespace

WheelPreconditioner::WheelPreconditioner(HarmonicProblem& problem)
    : PairwisePreconditioner(problem),
      unit_(int(problem.model().unit())),
      sectors_(int(problem.model().dofs() / problem.model().unit())) {
  for (auto const& term : problem.model().terms()) terms_.push_back(average(term.A));
}

/// A_k: mean over the sectors of the block that acts on the sector k places ahead. Collective.
WheelPreconditioner::Blocks WheelPreconditioner::average(Mat A) const {
  Blocks mine, all;
  for_entries(A, [&](PetscInt row, PetscInt col, double value) {
    auto& block = mine[int(col / unit_ - row / unit_ + sectors_) % sectors_];
    block.resize(size_t(unit_) * unit_);
    block[size_t(col % unit_) * unit_ + row % unit_] += value / sectors_;
  });
  std::vector<int> ahead;
  for (auto const& [k, block] : mine) ahead.push_back(k);
  for (int k : gathered(std::span<int const>(ahead), problem_.comm())) all.try_emplace(k);
  for (auto& [k, block] : all) {
    if (mine.contains(k)) block = std::move(mine[k]);
    block.resize(size_t(unit_) * unit_);
    MPI_Allreduce(MPI_IN_PLACE, block.data(), int(block.size()), MPI_DOUBLE, MPI_SUM, problem_.comm());
  }
  return all;
}

/// The border: columns of the unfolding and of the scalars; rows of the normalisation, the unfolding and the
/// closing.
void WheelPreconditioner::prepare(Exponents const&, Vec y, Vec row) {
  const Place fundamental = place(problem_.harmonics().fundamental());
  columns_.clear(), rows_.clear();
  for (auto const& g : problem_.unfolding_vectors())
    columns_.push_back(fundamental.gather(gathered(g).data()));
  for (int part = 0; part < scalars_ - 1; ++part) {
    rows_.emplace_back(n_);
    rows_.back()[problem_.dof()] = part ? complex(0, -1) : 1;
  }
  rows_.insert(rows_.end(), columns_.begin(), columns_.end());
  for (int j = 0; j < scalars_; ++j)
    columns_.push_back(fundamental.gather(gathered(problem_.scalar_column(y, j)).data()));
  const auto closing = gathered(row);
  rows_.push_back(fundamental.gather(closing.data()));
  const size_t size = rows_.size();
  corner_.assign(size * size, 0.0);
  for (size_t j = 0; j < size; ++j) corner_[j * size + size - 1] = closing[size_t(n_) * m_ + j];
}

std::unique_ptr<CyclicInverse> WheelPreconditioner::cyclic(int harmonic, Exponents const& e) const {
  std::map<int, std::vector<complex>> blocks;
  const auto block = [&](int k) -> std::vector<complex>& {
    auto& A = blocks[k];
    A.resize(size_t(unit_) * unit_);
    return A;
  };
  for (size_t j = 0; j < terms_.size(); ++j) {
    const complex c = problem_.stiffness().coefficients(problem_.model().terms()[j], e)[harmonic] /
                      problem_.stiffness_scale();
    for (auto const& [k, A] : terms_[j]) {
      auto& sum = block(k);
      for (size_t i = 0; i < A.size(); ++i) sum[i] += c * A[i];
    }
  }
  const bool mean = problem_.harmonics().orders()[harmonic] == 0;
  add_contact(harmonic, [&](PetscInt i, PetscInt j, Rotation const& r) {
    const int ahead = int(j / unit_ - i / unit_ + sectors_) % sectors_;
    block(ahead)[size_t(j % unit_) * unit_ + i % unit_] +=
        (mean ? complex(r.cc) : r.nearest()) / double(sectors_);
  });
  return std::make_unique<CyclicInverse>(place(harmonic), sectors_, blocks);
}

std::unique_ptr<HarmonicInverse> WheelPreconditioner::inverse(int harmonic, Exponents const& at) const {
  if (harmonic != problem_.harmonics().fundamental()) return cyclic(harmonic, at);
  Exponents e = at;
  e.s[harmonic] *= 1 + beside;
  return std::make_unique<BorderedCyclicInverse>(cyclic(harmonic, e), columns_, rows_, corner_,
                                                 size_t(n_) * m_);
}

}  // namespace fretwave::hb
