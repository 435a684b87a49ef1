#include "hb/harmonic_pc.h"

#include <algorithm>
#include <numeric>

namespace fretwave::hb {

namespace {

/// A distributed matrix whole and dense (column-major) on every rank.
std::vector<double> whole(Mat A) {
  MPI_Comm comm;
  PetscInt n, begin, end;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatGetSize(A, &n, nullptr));
  check(MatGetOwnershipRange(A, &begin, &end));
  std::vector<double> dense(size_t(n) * n, 0.0);
  for (PetscInt row = begin; row < end; ++row) {
    PetscInt count;
    PetscInt const* cols;
    PetscScalar const* values;
    check(MatGetRow(A, row, &count, &cols, &values));
    for (PetscInt k = 0; k < count; ++k) dense[size_t(cols[k]) * n + row] = values[k];
    check(MatRestoreRow(A, row, &count, &cols, &values));
  }
  MPI_Allreduce(MPI_IN_PLACE, dense.data(), int(dense.size()), MPI_DOUBLE, MPI_SUM, comm);
  return dense;
}

void sum_over_ranks(double* x, size_t n, MPI_Comm comm) {
  if (comm_size(comm) > 1) MPI_Allreduce(MPI_IN_PLACE, x, int(n), MPI_DOUBLE, MPI_SUM, comm);
}

}  // namespace

HarmonicPreconditioner::HarmonicPreconditioner(HarmonicProblem& problem)
    : problem_(problem),
      n_(int(problem.model().dofs())),
      m_(problem.harmonics().block_size()),
      scalars_(problem.scalar_count()),
      rank_(comm_rank(problem.comm())),
      size_(comm_size(problem.comm())) {
  for (auto const& term : problem.model().terms()) terms_.push_back(whole(term.A));
}

/// Numbers the pairs of all ranks; returns their per-harmonic tangents.
std::vector<Rotation> HarmonicPreconditioner::gather_contact(std::vector<PairTangents> const& contacts) {
  std::vector<int> components;
  for (auto const& contact : contacts) components.insert(components.end(), contact.pairs, contact.components);
  const int mine = int(components.size());
  const auto counts = gathered(std::span(&mine, 1), problem_.comm());
  first_pair_ = std::accumulate(counts.begin(), counts.begin() + rank_, 0);

  std::vector<Weight> weights;
  std::vector<Rotation> tangents;
  int first = first_pair_;
  for (auto const& contact : contacts) {
    for (Weight w : contact.weights) weights.push_back({first + w.pair, w.component, w.dof, w.value});
    const size_t ld = size_t(contact.components) * m_;
    for (int p = 0; p < contact.pairs; ++p) {
      const auto own = harmonic_tangents(problem_.harmonics(), contact.components, &contact.D[p * ld * ld]);
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

/// Z_n / k_ref
std::vector<complex> HarmonicPreconditioner::structure(int harmonic, Exponents const& e) const {
  std::vector<complex> A(size_t(n_) * n_);
  for (size_t j = 0; j < terms_.size(); ++j) {
    const complex c = problem_.stiffness().coefficients(problem_.model().terms()[j], e)[harmonic] /
                      problem_.stiffness_scale();
    for (size_t k = 0; k < A.size(); ++k) A[k] += c * terms_[j][k];
  }
  return A;
}

/// visit(dof, dof, weight, index of the per-harmonic block) for all entries of B^T (.) B.
template <class Visit>
void HarmonicPreconditioner::for_contact(int harmonic, Visit visit) const {
  for (Pair const& pair : pairs_)
    for (size_t a = pair.first_weight; a < pair.end_weight; ++a)
      for (size_t b = pair.first_weight; b < pair.end_weight; ++b)
        visit(weights_[a].dof, weights_[b].dof, weights_[a].value * weights_[b].value,
              pair.first_block +
                  (size_t(harmonic) * pair.components + weights_[a].component) * pair.components +
                  weights_[b].component);
}

std::vector<complex> HarmonicPreconditioner::block(int harmonic, Exponents const& e) const {
  auto A = structure(harmonic, e);
  const bool mean = problem_.harmonics().orders()[harmonic] == 0;
  for_contact(harmonic, [&](PetscInt i, PetscInt j, double weight, size_t k) {
    A[size_t(j) * n_ + i] += weight * (mean ? tangents_[k].cc : tangents_[k].nearest());
  });
  return A;
}

/// Rows (rc, rs, normalisation, closing) over (qc, qs, z).
std::vector<double> HarmonicPreconditioner::bordered_block(Exponents const& e, Vec y, Vec row) const {
  Harmonics const& h = problem_.harmonics();
  const int first = h.fundamental(), offset = h.offset(first), size = 2 * n_ + scalars_;
  std::vector<double> F(size_t(size) * size, 0.0);
  const auto at = [&](int i, int j) -> double& { return F[size_t(j) * size + i]; };
  const auto add = [&](int i, int j, double weight, Rotation const& r) {
    at(i, j) += weight * r.cc, at(i, n_ + j) += weight * r.cs;
    at(n_ + i, j) += weight * r.sc, at(n_ + i, n_ + j) += weight * r.ss;
  };
  const auto A = structure(first, e);
  for (int j = 0; j < n_; ++j)
    for (int i = 0; i < n_; ++i) add(i, j, 1, Rotation::of(A[size_t(j) * n_ + i]));
  for_contact(first,
              [&](PetscInt i, PetscInt j, double weight, size_t k) { add(i, j, weight, tangents_[k]); });
  const auto closing = gathered(row);
  for (int j = 0; j < scalars_; ++j) {
    const auto column = gathered(problem_.scalar_column(y, j));
    for (int i = 0; i < n_; ++i)
      for (int part = 0; part < 2; ++part)
        at(part * n_ + i, 2 * n_ + j) = column[size_t(i) * m_ + offset + part];
    at(size - 1, 2 * n_ + j) = closing[size_t(n_) * m_ + j];
  }
  for (int i = 0; i < n_; ++i)
    for (int part = 0; part < 2; ++part)
      at(size - 1, part * n_ + i) = closing[size_t(i) * m_ + offset + part];
  for (int part = 0; part < scalars_ - 1; ++part) at(2 * n_ + part, part * n_ + int(problem_.dof())) = 1;
  return F;
}

/// Per-harmonic blocks of B P^-1 B^T of all pairs.
std::vector<Rotation> HarmonicPreconditioner::compliance() const {
  std::vector<Rotation> G(tangents_.size());
  for (int i = 0; i < problem_.harmonics().count(); ++i) {
    if (!mine(i)) continue;
    for_contact(i, [&](PetscInt row, PetscInt col, double weight, size_t k) {
      const Rotation g = inverses_[i]->entry(int(row), int(col));
      G[k].cc += weight * g.cc, G[k].cs += weight * g.cs, G[k].sc += weight * g.sc, G[k].ss += weight * g.ss;
    });
  }
  sum_over_ranks(&G[0].cc, 4 * G.size(), problem_.comm());
  return G;
}

void HarmonicPreconditioner::correct_pairs(std::vector<PairTangents>&& contacts) {
  corrections_.clear();
  if (pairs_.empty()) return;
  const auto G = compliance();
  for (auto const& contact : contacts) {
    const size_t ld = size_t(contact.components) * m_;
    for (int p = 0; p < contact.pairs; ++p) {
      const size_t at = pairs_[first_pair_ + corrections_.size()].first_block;
      double const* D = &contact.D[p * ld * ld];
      corrections_.emplace_back(problem_.harmonics(), contact.components, std::vector<double>(D, D + ld * ld),
                                &tangents_[at], &G[at]);
    }
  }
}

void HarmonicPreconditioner::build(Vec y, Vec row) {
  Harmonics const& h = problem_.harmonics();
  const Exponents e = problem_.exponents(y);
  auto contacts = problem_.pair_tangents(y);
  for (auto& contact : contacts)
    for (double& d : contact.D) d /= problem_.stiffness_scale();
  tangents_ = gather_contact(contacts);
  inverses_.clear(), inverses_.resize(h.count());
  const auto bordered = bordered_block(e, y, row);
  for (int i = 0; i < h.count(); ++i) {
    if (!mine(i)) continue;
    const Place place{n_, m_, h.offset(i), h.orders()[i] == 0};
    inverses_[i] =
        i == h.fundamental() ? invert_bordered(place, bordered, scalars_) : invert(place, block(i, e));
  }
  correct_pairs(std::move(contacts));
}

/// P^-1 x
std::vector<double> HarmonicPreconditioner::solve(std::vector<double> const& x) const {
  std::vector<double> z(x.size(), 0.0);
  for (auto const& inverse : inverses_)
    if (inverse) inverse->apply(x.data(), z.data());
  sum_over_ranks(z.data(), z.size(), problem_.comm());
  return z;
}

/// B^T E B y
std::vector<double> HarmonicPreconditioner::correction(std::vector<double> const& y) const {
  std::vector<double> out(y.size(), 0.0), u, f;
  for (size_t p = 0; p < corrections_.size(); ++p) {
    Pair const& pair = pairs_[first_pair_ + p];
    u.assign(corrections_[p].size(), 0.0), f.resize(u.size());
    for (size_t w = pair.first_weight; w < pair.end_weight; ++w)
      for (int k = 0; k < m_; ++k)
        u[weights_[w].component * m_ + k] += weights_[w].value * y[weights_[w].dof * m_ + k];
    corrections_[p].apply(u.data(), f.data());
    for (size_t w = pair.first_weight; w < pair.end_weight; ++w)
      for (int k = 0; k < m_; ++k)
        out[weights_[w].dof * m_ + k] += weights_[w].value * f[weights_[w].component * m_ + k];
  }
  sum_over_ranks(out.data(), out.size(), problem_.comm());
  return out;
}

std::string HarmonicPreconditioner::describe() const {
  return std::to_string(problem_.harmonics().count()) + " dense blocks of " + std::to_string(n_) + " dofs";
}

void HarmonicPreconditioner::apply(Vec x, Vec z) {
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
