#include "precondition/pairwise_pc.h"

#include <algorithm>
#include <numeric>

#include "fault.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

const Tuned most("pairs_most", 120, "iterations on the pairs' coupling, at the most");

}  // namespace

PairwisePreconditioner::PairwisePreconditioner(HarmonicProblem& problem)
    : problem_(problem),
      n_(as_int(problem.model().dofs(), "dofs in dense blocks")),
      m_(problem.harmonics().block_size()),
      scalars_(problem.scalar_count()),
      rank_(comm_rank(problem.comm())),
      size_(comm_size(problem.comm())) {}

Place PairwisePreconditioner::place(int harmonic) const {
  Harmonics const& h = problem_.harmonics();
  return {n_, m_, h.offset(harmonic), h.orders()[harmonic] == 0};
}

/// Numbers the pairs of all ranks; returns their per-harmonic tangents.
std::vector<Rotation> PairwisePreconditioner::gather_contact(std::vector<PairTangents> const& contacts) {
  std::vector<int> components;
  for (auto const& contact : contacts) components.insert(components.end(), contact.pairs, contact.components);
  const int mine = int(components.size());
  const auto counts = gathered(std::span(&mine, 1), problem_.comm());
  first_pair_ = std::accumulate(counts.begin(), counts.begin() + rank_, 0);

  std::vector<Weight> weights;
  std::vector<Rotation> tangents;
  int first = first_pair_;
  for (auto const& contact : contacts) {
    for (Weight w : contact.weights) {
      w.pair += first;
      weights.push_back(w);
    }
    const size_t ld = size_t(contact.components) * m_;
    for (int p = 0; p < contact.pairs; ++p) {
      const auto own =
          harmonic_tangents(problem_.harmonics(), contact.components, &contact.D[p * ld * ld], true);
      tangents.insert(tangents.end(), own.begin(), own.end());
    }
    first += contact.pairs;
  }
  weights_ = gathered(std::span<Weight const>(weights), problem_.comm());
  pairs_.clear();
  size_t weight = 0, block = 0;
  for (int d : gathered(std::span<int const>(components), problem_.comm())) {
    Pair pair{d, weight, weight, block};
    while (weight < weights_.size() && weights_[weight].pair == int(pairs_.size())) ++weight;
    pair.end_weight = weight;
    block += size_t(d) * d * problem_.harmonics().count();
    pairs_.push_back(pair);
  }
  return gathered(std::span<Rotation const>(tangents), problem_.comm());
}

/// e^{-i k n theta}, which another sector's displacement carries (model::Term).
complex PairwisePreconditioner::phase(Weight const& w, int harmonic) const {
  return std::polar(1.0, -w.phase * problem_.harmonics().orders()[harmonic] * problem_.model().theta());
}

/// Per-harmonic blocks of B P^-1 B^H of all pairs.
std::vector<Rotation> PairwisePreconditioner::compliance() const {
  std::vector<Rotation> G(tangents_.size());
  for (int i = 0; i < problem_.harmonics().count(); ++i) {
    if (!mine(i)) continue;
    for_contact(i, [&](Weight const& row, Weight const& col, size_t k) {
      Rotation g = inverses_[i]->entry(int(row.dof), int(col.dof));
      if (row.phase || col.phase) g = g.between(phase(row, i), std::conj(phase(col, i)));
      G[k].add(row.value * col.value, g);
    });
  }
  static_assert(sizeof(Rotation) == 4 * sizeof(double));
  sum_over_ranks(std::span(&G[0].cc, 4 * G.size()), problem_.comm());
  return G;
}

/// Rows of pairs that are not idle, numbered over all ranks; the pair of each.
std::vector<int> PairwisePreconditioner::number_rows() {
  std::vector<int> busy, pair_of;
  for (auto const& correction : corrections_) busy.push_back(!correction.idle());
  const auto all = gathered(std::span<int const>(busy), problem_.comm());
  for (size_t p = 0; p < pairs_.size(); ++p) {
    pairs_[p].first_row = all[p] ? int(pair_of.size()) : -1;
    if (all[p]) pair_of.insert(pair_of.end(), pairs_[p].components, int(p));
  }
  return pair_of;
}

/// visit(weight, row) for the rows of pairs that are not idle.
template <class Visit>
void PairwisePreconditioner::for_rows(Visit visit) const {
  for (Pair const& pair : pairs_)
    for (size_t k = pair.first_weight; pair.first_row >= 0 && k < pair.end_weight; ++k)
      visit(weights_[k], pair.first_row + weights_[k].component);
}

std::vector<ContactEntry> PairwisePreconditioner::entries(int harmonic) const {
  std::vector<ContactEntry> B;
  for_rows([&](Weight const& w, int row) { B.push_back({row, int(w.dof), w.value * phase(w, harmonic)}); });
  return B;
}

void PairwisePreconditioner::couple(std::vector<PairTangents>&& contacts) {
  corrections_.clear(), coupled_.reset();
  if (pairs_.empty()) return;
  together(problem_.comm(), "correcting contact pairs", [&] {
    for (auto const& contact : contacts) {
      const size_t ld = size_t(contact.components) * m_;
      for (int p = 0; p < contact.pairs; ++p) {
        const size_t at = pairs_[first_pair_ + corrections_.size()].first_block;
        double const* D = &contact.D[p * ld * ld];
        fault::point("pair correction");
        corrections_.emplace_back(problem_.harmonics(), contact.components,
                                  std::vector<double>(D, D + ld * ld), &tangents_[at], &G_[at]);
      }
    }
  });
  const auto pair_of = number_rows();
  if (pair_of.empty()) return;
  std::vector<PairCorrection const*> own;
  for (auto const& correction : corrections_)
    if (!correction.idle()) own.push_back(&correction);
  if (pair_of != pair_of_) {  // or the inverses are new
    between_.clear();
    for (int i = 0; i < problem_.harmonics().count(); ++i)
      if (mine(i)) between_.push_back(inverses_[i]->between_pairs(entries(i), pair_of));
    pair_of_ = pair_of;
  }
  const auto between = [this](double const* f, double* u) {
    for (auto const& G : between_) G->apply(f, u);
  };
  coupled_ = std::make_unique<CoupledPairs>(problem_.comm(), std::move(own), between, most.count());
}

void PairwisePreconditioner::build(Vec y, Vec row) {
  Harmonics const& h = problem_.harmonics();
  const Exponents e = problem_.scaled(y).exponents;
  auto contacts = problem_.pair_tangents(y);
  tangents_ = gather_contact(contacts);
  inverses_.clear(), inverses_.resize(h.count());
  pair_of_.clear();
  prepare(e, y, row);
  together(problem_.comm(), "inverting harmonic blocks", [&] {
    for (int i = 0; i < h.count(); ++i)
      if (mine(i)) inverses_[i] = inverse(i, e);
  });
  if (!pairs_.empty()) G_ = compliance();
  couple(std::move(contacts));
}

void PairwisePreconditioner::follow(Vec y) { couple(problem_.pair_tangents(y)); }

/// P^-1 x
std::vector<double> PairwisePreconditioner::solve(std::vector<double> const& x) const {
  std::vector<double> z(x.size(), 0.0);
  for (auto const& inverse : inverses_)
    if (inverse) inverse->apply(x.data(), z.data());
  sum_over_ranks(z, problem_.comm());
  return z;
}

/// to += weight (phase) from, harmonic blocks.
void PairwisePreconditioner::add_turned(Weight const& w, bool conjugate, double const* from,
                                        double* to) const {
  if (!w.phase) {
    for (int k = 0; k < m_; ++k) to[k] += w.value * from[k];
    return;
  }
  Harmonics const& h = problem_.harmonics();
  std::vector<complex> factor(h.count());
  for (int i = 0; i < h.count(); ++i)
    factor[i] = w.value * (conjugate ? std::conj(phase(w, i)) : phase(w, i));
  std::vector<double> turned(m_);
  multiply(h, factor, from, turned.data(), 1);
  for (int k = 0; k < m_; ++k) to[k] += turned[k];
}

/// B^H F B y
std::vector<double> PairwisePreconditioner::contact_forces(std::vector<double> const& y) const {
  std::vector<double> u(coupled_->size(), 0.0), out(y.size(), 0.0);
  for_rows([&](Weight const& w, int row) { add_turned(w, false, &y[w.dof * m_], &u[size_t(row) * m_]); });
  const auto f = coupled_->forces(u);
  for_rows([&](Weight const& w, int row) { add_turned(w, true, &f[size_t(row) * m_], &out[w.dof * m_]); });
  return out;
}

void PairwisePreconditioner::apply(Vec x, Vec z) {
  auto y = solve(gathered(x));
  if (coupled_) {
    const auto corrected = solve(contact_forces(y));
    for (size_t k = 0; k < y.size(); ++k) y[k] -= corrected[k];
  }
  PetscInt begin;
  check(VecGetOwnershipRange(z, &begin, nullptr));
  WriteArray local(z);
  std::copy_n(y.data() + begin, local_size(z), local.data());
}

}  // namespace fretwave::precondition
