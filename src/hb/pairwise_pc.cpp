#include "hb/pairwise_pc.h"

#include <algorithm>
#include <numeric>

#include "fault.h"
#include "together.h"

namespace fretwave::hb {

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

/// e^{-i k n theta}, which another sector's displacement carries (DESIGN section 3).
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

void PairwisePreconditioner::correct_pairs(std::vector<PairTangents>&& contacts) {
  corrections_.clear();
  if (pairs_.empty()) return;
  const auto G = compliance();
  together(problem_.comm(), "correcting contact pairs", [&] {
    for (auto const& contact : contacts) {
      const size_t ld = size_t(contact.components) * m_;
      for (int p = 0; p < contact.pairs; ++p) {
        const size_t at = pairs_[first_pair_ + corrections_.size()].first_block;
        double const* D = &contact.D[p * ld * ld];
        fault::point("pair correction");
        corrections_.emplace_back(problem_.harmonics(), contact.components,
                                  std::vector<double>(D, D + ld * ld), &tangents_[at], &G[at]);
      }
    }
  });
}

void PairwisePreconditioner::build(Vec y, Vec row) {
  Harmonics const& h = problem_.harmonics();
  const Exponents e = problem_.exponents(y);
  auto contacts = problem_.pair_tangents(y);
  for (auto& contact : contacts)
    for (double& d : contact.D) d /= problem_.stiffness_scale();
  tangents_ = gather_contact(contacts);
  inverses_.clear(), inverses_.resize(h.count());
  prepare(e, y, row);
  together(problem_.comm(), "inverting harmonic blocks", [&] {
    for (int i = 0; i < h.count(); ++i)
      if (mine(i)) inverses_[i] = inverse(i, e);
  });
  correct_pairs(std::move(contacts));
}

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

/// B^H E B y
std::vector<double> PairwisePreconditioner::correction(std::vector<double> const& y) const {
  std::vector<double> out(y.size(), 0.0), u, f;
  for (size_t p = 0; p < corrections_.size(); ++p) {
    Pair const& pair = pairs_[first_pair_ + p];
    const auto weights = std::span(weights_).subspan(pair.first_weight, pair.end_weight - pair.first_weight);
    u.assign(corrections_[p].size(), 0.0), f.resize(u.size());
    for (Weight const& w : weights) add_turned(w, false, &y[w.dof * m_], &u[w.component * m_]);
    corrections_[p].apply(u.data(), f.data());
    for (Weight const& w : weights) add_turned(w, true, &f[w.component * m_], &out[w.dof * m_]);
  }
  sum_over_ranks(out, problem_.comm());
  return out;
}

void PairwisePreconditioner::apply(Vec x, Vec z) {
  auto y = solve(gathered(x));
  if (!pairs_.empty()) {
    const auto corrected = solve(correction(y));
    for (size_t k = 0; k < y.size(); ++k) y[k] -= corrected[k];
  }
  PetscInt begin;
  check(VecGetOwnershipRange(z, &begin, nullptr));
  WriteArray local(z);
  std::copy_n(y.data() + begin, local_size(z), local.data());
}

}  // namespace fretwave::hb
