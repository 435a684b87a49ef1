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
const Tuned small("basis_small", 3,
                  "applications that the lower modes' blocks may take where the mean stiffness follows so");
const Tuned inertia(
    "basis_moves", 0.05,
    "inertia over stiffness of a mode at any harmonic, up to which the basis need not have it");
const Tuned few("basis_few", 0.3, "share of the slipping rows up to which further ones are added to them");

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

BasisPreconditioner::BasisPreconditioner(HarmonicProblem& problem, model::StuckBasis const& basis)
    : problem_(problem),
      basis_(&basis),
      n_(basis.size()),
      m_(problem.harmonics().block_size()),
      scalars_(problem.scalar_count()),
      rank_(comm_rank(problem.comm())),
      size_(comm_size(problem.comm())),
      local_(int(problem.model().local_dofs())),
      first_(range_of(problem.harmonics(), rank_, size_).first),
      last_(range_of(problem.harmonics(), rank_, size_).second) {
  take(basis);
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

void BasisPreconditioner::take(model::StuckBasis const& basis) {
  basis_ = &basis;
  blocks_.emplace(basis, problem_.harmonics(), first_, last_);
  damping_ = basis.damping(problem_.model());
}

/// Whether a mode that the basis does not have moves with inertia.
bool BasisPreconditioner::lacks_modes(Exponents const& e) const {
  return std::ranges::any_of(
      e.s, [&](complex s) { return std::abs(s * s - e.inertia_damping * s) * basis_->left_out() > inertia; });
}

/// The border of the fundamental on this rank's dofs.
void BasisPreconditioner::set_border_vectors(Vec y, Vec row) {
  const int offset = problem_.harmonics().offset(problem_.harmonics().fundamental()), v = 2 * scalars_;
  columns_.assign(size_t(v) * local_, 0.0), rows_ = columns_;
  const auto take = [&](Vec from, std::vector<double>& to, int scalar) {
    const ReadArray in(from);
    for (int i = 0; i < local_; ++i)
      for (int part = 0; part < 2; ++part)
        to[size_t(i) * v + 2 * scalar + part] = in[size_t(i) * m_ + offset + part];
  };
  for (int j = 0; j < scalars_; ++j) take(problem_.scalar_column(y, j), columns_, j);
  take(row, rows_, scalars_ - 1);
  const PetscInt first = problem_.model().first_dof();
  for (auto const& [dof, weight] : problem_.row())
    for (int i = 0; i < scalars_ - 1 && dof >= first && dof < first + local_; ++i)
      rows_[size_t(dof - first) * v + 2 * i + i] += weight;
}

/// Psi^T x of some vectors, by vector, and K_s^-1 x if it is asked for. Collective.
std::vector<double> BasisPreconditioner::in_basis(std::vector<double> const& x, int vectors,
                                                  double* moved) const {
  std::vector<double> g(size_t(vectors) * n_), out(g.size());
  basis_->forces(x.data(), vectors, g.data(), moved);
  sum_over_ranks(g, problem_.comm());
  for (int v = 0; v < vectors; ++v)
    for (int l = 0; l < n_; ++l) out[size_t(v) * n_ + l] = g[size_t(l) * vectors + v];
  return out;
}

/// Border of the fundamental in the basis.
ModalBorder BasisPreconditioner::border(Vec y, Vec row) {
  set_border_vectors(y, row);
  static_columns_.resize(basis_->factor() ? columns_.size() : 0);
  ModalBorder out{scalars_, in_basis(columns_, 2 * scalars_, static_columns_.data()),
                  in_basis(rows_, 2 * scalars_), std::vector<double>(size_t(scalars_) * scalars_, 0.0)};
  std::vector<double> closing(scalars_, 0.0);
  if (rank_ == size_ - 1) std::copy_n(ReadArray(row).data() + size_t(local_) * m_, scalars_, closing.begin());
  sum_over_ranks(closing, problem_.comm());
  for (int j = 0; j < scalars_; ++j) out.corner[size_t(j) * scalars_ + scalars_ - 1] = closing[j];
  if (basis_->factor()) leave_static(out);
  return out;
}

/// D C, of K_s^-1 C, and R Psi of the border, and its corner less R D C.
void BasisPreconditioner::leave_static(ModalBorder& border) {
  const int v = 2 * scalars_;
  const double scale = problem_.stiffness_scale();
  std::vector<double> modal(size_t(v) * n_);
  for (int k = 0; k < v; ++k)
    for (int l = 0; l < n_; ++l) modal[size_t(l) * v + k] = border.columns[size_t(k) * n_ + l];
  std::vector<double> by_modes(static_columns_.size());
  basis_->motion(modal.data(), v, by_modes.data());
  for (size_t k = 0; k < by_modes.size(); ++k)
    static_columns_[k] = scale * (static_columns_[k] - by_modes[k]);
  modal_rows_ = border.rows;
  std::vector<double> RDC(border.corner.size(), 0.0);
  for (int j = 0; j < scalars_; ++j)
    for (int i = 0; i < scalars_; ++i)
      for (int part = 0; part < 2; ++part)
        for (int dof = 0; dof < local_; ++dof)
          RDC[size_t(j) * scalars_ + i] +=
              rows_[size_t(dof) * v + 2 * i + part] * static_columns_[size_t(dof) * v + 2 * j + part];
  sum_over_ranks(RDC, problem_.comm());
  for (size_t k = 0; k < RDC.size(); ++k) border.corner[k] -= RDC[k];
}

/// z of this rank's harmonics.
std::vector<std::vector<complex>> BasisPreconditioner::structure(Exponents const& e) const {
  const double scale = problem_.stiffness_scale();
  std::vector<std::vector<complex>> z(last_ - first_, std::vector<complex>(n_, 1 / scale));
  bool taken[3] = {};
  for (auto const& term : problem_.model().terms()) {
    if (term.order == 0 || std::exchange(taken[term.order], true)) continue;
    const auto c = problem_.terms().stiffness().coefficients(term, e);
    auto const& diagonal = term.order == 1 ? damping_ : basis_->theta();
    for (int i = first_; i < last_; ++i)
      for (int j = 0; j < n_; ++j) z[i - first_][j] += c[i] / scale * diagonal[j];
  }
  return z;
}

void BasisPreconditioner::build(Vec y, Vec row) {
  const auto contacts = problem_.pair_tangents(y);
  const Exponents e = problem_.scaled(y).exponents;
  if (lacks_modes(e))
    if (auto const* whole = problem_.model().whole_stuck_basis()) take(*whole);
  auto z = structure(e);
  auto border = this->border(y, row);
  means_ = mean_tangents(contacts);
  together(problem_.comm(), "inverting harmonic blocks", [&] {
    blocks_->set_structure(std::move(z), 1 / problem_.stiffness_scale(), std::move(border));
    take_contact();
  });
  small_flops_ = blocks_->small_flops();
  MPI_Allreduce(MPI_IN_PLACE, &small_flops_, 1, MPI_DOUBLE, MPI_MAX, problem_.comm());
  couple(contacts);
}

/// The mean stiffness follows where that is cheap; else that of pairs alone that begin to slip, if they are
/// few.
void BasisPreconditioner::follow(Vec y) {
  const auto contacts = problem_.pair_tangents(y);
  auto means = mean_tangents(contacts);
  const auto began = beginning(means);
  int rows = 0;
  for (auto const& [pair, at] : began) rows += pairs_[pair].components;
  const bool dear = blocks_->rows() > cheap || small_flops_ > small * application_flops();
  if (!dear || rows > few * blocks_->rows()) {
    means_ = std::move(means);
    together(problem_.comm(), "inverting harmonic blocks", [&] { take_contact(); });
  } else if (rows > 0) {
    for (auto const& [pair, at] : began)
      std::copy_n(&means[at], pairs_[pair].components * pairs_[pair].components, &means_[at]);
    together(problem_.comm(), "adding slipping pairs", [&] { add_contact(began); });
  }
  couple(contacts);
}

/// This rank's coefficients of harmonic blocks, at some places of all: coefficients x columns.
std::vector<float> BasisPreconditioner::own(double const* blocks, std::vector<int> const& places,
                                            int columns) const {
  const int c = blocks_->coefficients(), lead = blocks_->lead(), begin = blocks_->begin();
  std::vector<float> out(size_t(lead) * columns);
  for (size_t j = 0; j < places.size(); ++j)
    for (int k = 0; k < c; ++k) out[size_t(places[j]) * lead + k] = float(blocks[j * m_ + begin + k]);
  return out;
}

/// Psi^T x, coefficients innermost, and behind it what is left of x on the border's rows. Collective.
std::vector<double> BasisPreconditioner::forces(Vec x) {
  const ReadArray in(x);
  std::vector<double> g(size_t(m_) * n_ + scalars_, 0.0);
  if (basis_->factor()) static_motion_.resize(size_t(m_) * local_);
  basis_->forces(in.data(), m_, g.data(), static_motion_.data());
  if (rank_ == size_ - 1) std::copy_n(in.data() + size_t(local_) * m_, scalars_, g.end() - scalars_);
  if (basis_->factor()) {
    const int offset = problem_.harmonics().offset(problem_.harmonics().fundamental());
    for (int dof = 0; dof < local_; ++dof)
      for (int v = 0; v < 2 * scalars_; ++v)
        *(g.end() - scalars_ + v / 2) -= problem_.stiffness_scale() * rows_[size_t(dof) * 2 * scalars_ + v] *
                                         static_motion_[size_t(dof) * m_ + offset + v % 2];
  }
  sum_over_ranks(g, problem_.comm());
  for (int v = 0; basis_->factor() && v < 2 * scalars_; ++v)
    for (int l = 0; l < n_; ++l) {
      const int offset = problem_.harmonics().offset(problem_.harmonics().fundamental());
      *(g.end() - scalars_ + v / 2) +=
          problem_.stiffness_scale() * modal_rows_[size_t(v) * n_ + l] * g[size_t(l) * m_ + offset + v % 2];
    }
  return g;
}

/// q += D (x - C zeta), its part in the basis apart.
void BasisPreconditioner::add_static(std::vector<double> const& scalars, double* q) const {
  const int offset = problem_.harmonics().offset(problem_.harmonics().fundamental()), v = 2 * scalars_;
  const double scale = problem_.stiffness_scale();
  for (size_t k = 0; k < static_motion_.size(); ++k) q[k] += scale * static_motion_[k];
  for (int dof = 0; dof < local_; ++dof)
    for (int k = 0; k < v; ++k)
      q[size_t(dof) * m_ + offset + k % 2] -= scalars[k / 2] * static_columns_[size_t(dof) * v + k];
}

void BasisPreconditioner::apply(Vec x, Vec z) {
  const auto all = forces(x);
  const int c = blocks_->coefficients(), lead = blocks_->lead(), begin = blocks_->begin();
  std::vector<int> places(n_);
  std::iota(places.begin(), places.end(), 0);
  const std::vector<double> closing(all.end() - scalars_, all.end());
  auto forces = own(all.data(), places, n_);
  auto found = blocks_->solve(forces, closing);
  if (coupled_) {
    std::vector<double> u(coupled_->size(), 0.0);
    const auto motion = blocks_->motion(found.modes);
    for (size_t row = 0; row < busy_rows_.size(); ++row)
      for (int k = 0; k < c; ++k) u[row * m_ + begin + k] = motion[size_t(busy_rows_[row]) * lead + k];
    sum_over_ranks(u, problem_.comm());
    const auto f = coupled_->forces(u);
    blocks_->subtract(own(f.data(), busy_rows_, blocks_->rows()), forces);
    found = blocks_->solve(forces, closing);
  }
  std::vector<double> eta(size_t(m_) * n_ + scalars_, 0.0);
  for (int l = 0; l < n_; ++l)
    for (int k = 0; k < c; ++k) eta[size_t(l) * m_ + begin + k] = found.modes[size_t(l) * lead + k];
  std::ranges::copy(found.scalars, eta.end() - scalars_);
  sum_over_ranks(eta, problem_.comm());
  const std::vector<double> scalars(eta.end() - scalars_, eta.end());
  if (basis_->factor())
    for (size_t k = 0; k < size_t(m_) * n_; ++k) eta[k] -= problem_.stiffness_scale() * all[k];
  const WriteArray out(z);
  basis_->motion(eta.data(), m_, out.data());
  if (basis_->factor()) add_static(scalars, out.data());
  if (rank_ == size_ - 1) std::ranges::copy(scalars, out.data() + size_t(local_) * m_);
}

/// Pairs are coupled in it by some fifteen iterations.
double BasisPreconditioner::application_flops() const {
  const double n = n_, r = blocks_->rows();
  return m_ * (basis_->flops() + 12 * r * n + 30 * r * r);
}

/// Flops of the rows' inverse over those of an application; what the border's columns and rows take is a
/// share of one. The lower modes' blocks are left out: with older ones, systems that are solved to few digits
/// (of estimates) keep fewer of these.
double BasisPreconditioner::build_cost() const {
  const double r = blocks_->rows();
  return 1 + 2.7 * r * r * r / application_flops();
}

std::string BasisPreconditioner::describe() const {
  const std::string modes = std::to_string(basis_->modes()) + " modes of stuck pairs",
                    blocks = std::to_string(problem_.harmonics().count()) + " blocks of " + modes;
  if (basis_->size() == basis_->modes()) return blocks;
  const std::string whole =
      blocks + " and " + std::to_string(basis_->size() - basis_->modes()) + " static motions";
  if (!basis_->factor()) return whole;
  auto const& factor = *basis_->factor();
  return whole + ", one real factor" + factor.divided() + " (" +
         std::to_string(int(std::ceil(factor.megabytes()))) + " MB)";
}

}  // namespace fretwave::precondition
