#include "precondition/basis_pc.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "fault.h"
#include "lapack.h"
#include "log.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

const Tuned cheap("basis_cheap", 600, "rows up to which the mean stiffness follows at every step");

/// The range of harmonics of a rank: as many coefficients for each.
std::pair<int, int> range_of(Harmonics const& h, int rank, int size) {
  const auto begin = [&](int r) {
    int i = 0;
    while (i < h.count() && h.offset(i) * size < r * h.block_size()) ++i;
    return i;
  };
  return {begin(rank), begin(rank + 1)};
}

}  // namespace

BasisPreconditioner::BasisPreconditioner(HarmonicProblem& problem)
    : problem_(problem),
      basis_(*problem.model().stuck_basis()),
      n_(as_int(problem.model().dofs(), "dofs in dense blocks")),
      m_(problem.harmonics().block_size()),
      scalars_(problem.scalar_count()),
      rank_(comm_rank(problem.comm())),
      size_(comm_size(problem.comm())),
      first_(range_of(problem.harmonics(), rank_, size_).first),
      last_(range_of(problem.harmonics(), rank_, size_).second),
      blocks_(basis_, problem.harmonics(), first_, last_) {
  const MatHandle C = problem.model().sum(1);
  damping_ = C ? basis_.diagonal(C) : std::vector<double>(n_, 0.0);
  std::vector<int> components;
  for (auto const& contact : problem.model().contacts())
    components.insert(components.end(), contact.law->pairs(), contact.law->components());
  const int mine = int(components.size());
  const auto counts = gathered(std::span(&mine, 1), problem.comm());
  first_pair_ = std::accumulate(counts.begin(), counts.begin() + rank_, 0);
  int row = 0;
  for (const int d : gathered(std::span<int const>(components), problem.comm())) {
    pairs_.push_back({d, row});
    row += d;
  }
}

/// Border of the fundamental in the basis.
ModalBorder BasisPreconditioner::border(Vec y, Vec row) {
  ModalBorder out{scalars_, {}, {}, std::vector<double>(size_t(scalars_) * scalars_, 0.0)};
  const int offset = problem_.harmonics().offset(problem_.harmonics().fundamental());
  const auto part_of = [&](std::vector<double> const& blocks, int part) {
    std::vector<double> q(n_);
    for (int i = 0; i < n_; ++i) q[i] = blocks[size_t(i) * m_ + offset + part];
    return q;
  };
  const auto add = [&](std::vector<double> const& q, std::vector<double>& to) {
    for (int j = 0; j < n_; ++j) {
      float const* phi = &basis_.shapes()[size_t(j) * n_];
      to.push_back(std::inner_product(q.begin(), q.end(), phi, 0.0));
    }
  };
  const auto closing = gathered(row);
  for (int j = 0; j < scalars_; ++j) {
    const auto column = gathered(problem_.scalar_column(y, j));
    for (int part = 0; part < 2; ++part) add(part_of(column, part), out.columns);
    out.corner[size_t(j) * scalars_ + scalars_ - 1] = closing[size_t(n_) * m_ + j];
  }
  std::vector<double> observed(n_, 0.0);
  for (auto const& [dof, weight] : problem_.row()) observed[dof] += weight;
  for (int i = 0; i < scalars_ - 1; ++i)
    for (int part = 0; part < 2; ++part) add(part == i ? observed : std::vector<double>(n_, 0.0), out.rows);
  for (int part = 0; part < 2; ++part) add(part_of(closing, part), out.rows);
  return out;
}

/// z of this rank's harmonics.
std::vector<std::vector<complex>> BasisPreconditioner::structure(Exponents const& e) const {
  const double scale = problem_.stiffness_scale();
  std::vector<std::vector<complex>> z(last_ - first_, std::vector<complex>(n_, 1 / scale));
  bool taken[3] = {};
  for (auto const& term : problem_.model().terms()) {
    if (term.order == 0 || std::exchange(taken[term.order], true)) continue;
    const auto c = problem_.terms().stiffness().coefficients(term, e);
    auto const& diagonal = term.order == 1 ? damping_ : basis_.theta();
    for (int i = first_; i < last_; ++i)
      for (int j = 0; j < n_; ++j) z[i - first_][j] += c[i] / scale * diagonal[j];
  }
  return z;
}

void BasisPreconditioner::build(Vec y, Vec row) {
  const auto contacts = problem_.pair_tangents(y);
  auto z = structure(problem_.scaled(y).exponents);
  auto border = this->border(y, row);
  means_ = mean_tangents(contacts);
  together(problem_.comm(), "inverting harmonic blocks", [&] {
    blocks_.set_structure(std::move(z), 1 / problem_.stiffness_scale(), std::move(border));
    take_contact();
  });
  couple(contacts);
}

/// The mean stiffness follows where that is cheap, and where a pair begins to slip.
void BasisPreconditioner::follow(Vec y) {
  const auto contacts = problem_.pair_tangents(y);
  auto means = mean_tangents(contacts);
  bool begins = false;
  size_t at = 0;
  for (size_t p = 0; p < pairs_.size(); ++p) {
    begins |= place_[pairs_[p].first_row] < 0 && moves(int(p), means, at);
    at += size_t(pairs_[p].components) * pairs_[p].components;
  }
  if (begins || blocks_.rows() <= cheap) {
    means_ = std::move(means);
    together(problem_.comm(), "inverting harmonic blocks", [&] { take_contact(); });
  }
  couple(contacts);
}

/// This rank's coefficients of harmonic blocks, at some places of all: coefficients x columns.
std::vector<float> BasisPreconditioner::own(double const* blocks, std::vector<int> const& places,
                                            int columns) const {
  const int c = blocks_.coefficients(), begin = blocks_.begin();
  std::vector<float> out(size_t(c) * columns);
  for (size_t j = 0; j < places.size(); ++j)
    for (int k = 0; k < c; ++k) out[size_t(places[j]) * c + k] = float(blocks[j * m_ + begin + k]);
  return out;
}

void BasisPreconditioner::apply(Vec x, Vec z) {
  const auto all = gathered(x);
  const int c = blocks_.coefficients(), begin = blocks_.begin();
  std::vector<int> dofs(n_);
  std::iota(dofs.begin(), dofs.end(), 0);
  const std::vector<double> closing(all.begin() + size_t(n_) * m_, all.begin() + size_t(n_) * m_ + scalars_);
  std::vector<float> forces(size_t(c) * n_);
  lapack::multiply("NN", {c, n_, n_}, 1.0f, {own(all.data(), dofs, n_).data(), c},
                   {basis_.shapes().data(), n_}, 0.0f, forces.data(), c);
  auto found = blocks_.solve(forces, closing);
  if (coupled_) {
    std::vector<double> u(coupled_->size(), 0.0);
    const auto motion = blocks_.motion(found.modes);
    for (size_t row = 0; row < busy_rows_.size(); ++row)
      for (int k = 0; k < c; ++k) u[row * m_ + begin + k] = motion[size_t(busy_rows_[row]) * c + k];
    sum_over_ranks(u, problem_.comm());
    const auto f = coupled_->forces(u);
    blocks_.subtract(own(f.data(), busy_rows_, blocks_.rows()), forces);
    found = blocks_.solve(forces, closing);
  }
  std::vector<float> q(size_t(c) * n_);
  lapack::multiply("NT", {c, n_, n_}, 1.0f, {found.modes.data(), c}, {basis_.shapes().data(), n_}, 0.0f,
                   q.data(), c);
  std::vector<double> out(all.size(), 0.0);
  for (int i = 0; i < n_; ++i)
    for (int k = 0; k < c; ++k) out[size_t(i) * m_ + begin + k] = q[size_t(i) * c + k];
  std::copy(found.scalars.begin(), found.scalars.end(), out.begin() + size_t(n_) * m_);
  sum_over_ranks(out, problem_.comm());
  PetscInt first;
  check(VecGetOwnershipRange(z, &first, nullptr));
  std::copy_n(out.begin() + first, local_size(z), WriteArray(z).data());
}

/// Flops of the rows' inverse over those of an application, in which pairs are coupled by some fifteen
/// iterations.
double BasisPreconditioner::build_cost() const {
  const double n = n_, r = blocks_.rows();
  return 1 + 2.7 * r * r * r / (m_ * (4 * n * n + 12 * r * n + 30 * r * r));
}

std::string BasisPreconditioner::describe() const {
  return std::to_string(problem_.harmonics().count()) + " blocks of " + std::to_string(n_) +
         " modes of stuck pairs";
}

}  // namespace fretwave::precondition
