#include "precondition/condensed_pc.h"

#include <algorithm>
#include <cstdio>

#include "error.h"
#include "fault.h"
#include "lapack.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

const Tuned shift("condensed_shift", 1e-3,
                  "relative shift of the fundamental's exponent from the eigenvalue");
const Tuned far("condensed_far", 1e-2,
                "relative change of the exponents that makes the sparse factors stale");

}  // namespace

CondensedPreconditioner::CondensedPreconditioner(HarmonicProblem& problem)
    : problem_(problem),
      factors_(problem),
      m_(problem.harmonics().block_size()),
      scalars_(problem.scalar_count()),
      blocks_(size_t(problem.model().dofs()) * m_),
      first_rank_(comm_rank(problem.comm()) == 0) {
  VecHandle y = problem.unknowns();
  check(VecScatterCreateToZero(y, to_first_.out(), whole_.out()));
}

bool CondensedPreconditioner::moved(Exponents const& e) const {
  if (made_at_.s.empty() || made_in_ != problem_.stiffness_scale()) return true;
  double change = std::abs(e.inertia_damping - made_at_.inertia_damping), size = 0;
  for (size_t i = 0; i < e.s.size(); ++i) {
    change = std::max(change, std::abs(e.s[i] - made_at_.s[i]));
    size = std::max(size, std::abs(e.s[i]));
  }
  return change > far * size;
}

void CondensedPreconditioner::factorise(Exponents e, std::vector<PairTangents> const& contacts) {
  const Exponents at = e;
  made_at_ = {};  // until all harmonics have their factors
  if (scalars_ > 1) e.s[problem_.harmonics().fundamental()] *= 1 + shift;
  factors_.factorise(e, contacts);
  G_.clear();
  for (int i = 0; i < problem_.harmonics().count(); ++i) G_.push_back(factors_.compliance(i, rows_));
  made_at_ = at, made_in_ = problem_.stiffness_scale();
}

/// dD of all pairs on rank 0.
void CondensedPreconditioner::gather_tangents(std::vector<PairTangents> const& contacts) {
  Harmonics const& h = problem_.harmonics();
  std::vector<double> mine;
  complex const* t = factors_.tangents().data();
  for (auto const& contact : contacts) {
    const int d = contact.components;
    const size_t ld = size_t(d) * m_, begin = mine.size();
    mine.insert(mine.end(), contact.D.begin(), contact.D.end());
    for (int p = 0; p < contact.pairs; ++p)
      for (int i = 0; i < h.count(); ++i)
        for (int r = 0; r < d; ++r)
          for (int c = 0; c < d; ++c, ++t) {
            double* at = &mine[begin + p * ld * ld + (r * m_ + h.offset(i)) * ld + c * m_ + h.offset(i)];
            at[0] -= t->real();
            if (h.orders()[i] == 0) continue;
            at[1] -= t->imag(), at[ld] += t->imag(), at[ld + 1] -= t->real();
          }
  }
  const auto all = gathered(std::span<double const>(mine), problem_.comm());
  dD_.clear();
  if (!first_rank_) return;
  auto from = all.begin();
  for (auto const& pair : rows_.pairs) {
    const size_t ld = size_t(pair.components) * m_;
    dD_.emplace_back(from, from + ld * ld);
    from += ld * ld;
  }
}

/// C, R, S and what the factors make of them. Rows: normalisation (with three scalars), then the closing row.
void CondensedPreconditioner::border(Vec y, Vec row) {
  C_.clear(), R_.clear(), S_.assign(size_t(scalars_) * scalars_, 0.0);
  const auto fetch = [&](Vec v, std::vector<double>& out) {
    check(VecScatterBegin(to_first_, v, whole_, INSERT_VALUES, SCATTER_FORWARD));
    check(VecScatterEnd(to_first_, v, whole_, INSERT_VALUES, SCATTER_FORWARD));
    if (first_rank_) out.insert(out.end(), ReadArray(whole_).data(), ReadArray(whole_).data() + blocks_);
  };
  VecHandle padded = problem_.unknowns();
  for (int j = 0; j < scalars_; ++j) {
    {
      const ReadArray in(problem_.scalar_column(y, j));
      std::copy(in.span().begin(), in.span().end(), WriteArray(padded).data());
    }
    fetch(padded, C_);
  }
  if (first_rank_) {
    R_.assign(blocks_ * (scalars_ - 1), 0.0);
    Harmonics const& h = problem_.harmonics();
    for (int j = 0; j < scalars_ - 1; ++j)
      for (auto const& [dof, weight] : problem_.row())
        R_[j * blocks_ + size_t(dof) * m_ + h.offset(h.fundamental()) + j] = weight;
  }
  fetch(row, R_);
  if (first_rank_) {
    ReadArray closing(whole_);
    for (int j = 0; j < scalars_; ++j) S_[j * scalars_ + scalars_ - 1] = closing[blocks_ + j];
  }
  AC_ = C_, AR_ = R_;
  factors_.solve(AC_.data(), scalars_, blocks_);
  factors_.solve(AR_.data(), scalars_, blocks_, true);
}

/// u = B q
std::vector<double> CondensedPreconditioner::contact_motion(double const* q) const {
  std::vector<double> u(size_t(rows_.count) * m_, 0.0);
  for (auto const& b : rows_.entries)
    for (int k = 0; k < m_; ++k) u[size_t(b.row) * m_ + k] += b.value * q[size_t(b.dof) * m_ + k];
  return u;
}

/// x -= B^T dD u
void CondensedPreconditioner::subtract_force(double const* u, double* x) const {
  std::vector<double> f(size_t(rows_.count) * m_, 0.0);
  for (size_t p = 0; p < dD_.size(); ++p) {
    const size_t ld = size_t(rows_.pairs[p].components) * m_, at = size_t(rows_.pairs[p].first_row) * m_;
    for (size_t r = 0; r < ld; ++r)
      for (size_t c = 0; c < ld; ++c) f[at + r] += dD_[p][r * ld + c] * u[at + c];
  }
  for (auto const& b : rows_.entries)
    for (int k = 0; k < m_; ++k) x[size_t(b.dof) * m_ + k] -= b.value * f[size_t(b.row) * m_ + k];
}

double CondensedPreconditioner::along_row(int j, double const* q) const {
  double sum = 0;
  for (size_t k = 0; k < blocks_; ++k) sum += R_[j * blocks_ + k] * q[k];
  return sum;
}

/// T += [G; -R A^-1 B^T] dD, pair by pair.
void CondensedPreconditioner::add_contact(std::vector<double>& T) const {
  Harmonics const& h = problem_.harmonics();
  const size_t contact = size_t(rows_.count) * m_, size = size_;
  std::vector<double> BAR(size_t(scalars_) * contact);
  for (int j = 0; j < scalars_; ++j)
    std::ranges::copy(contact_motion(&AR_[j * blocks_]), BAR.begin() + j * contact);
  for (size_t p = 0; p < dD_.size(); ++p) {
    const size_t ld = size_t(rows_.pairs[p].components) * m_, at = size_t(rows_.pairs[p].first_row) * m_;
    for (size_t c = 0; c < ld; ++c) {
      double* column = &T[(at + c) * size];
      for (int i = 0; i < h.count(); ++i)
        for (int k = 0; k < rows_.pairs[p].components; ++k) {
          double const* d = &dD_[p][(k * m_ + h.offset(i)) * ld + c];
          complex const* G = &G_[i][size_t(rows_.pairs[p].first_row + k) * rows_.count];
          if (h.orders()[i] == 0) {
            for (int r = 0; r < rows_.count; ++r) column[size_t(r) * m_ + h.offset(i)] += G[r].real() * d[0];
            continue;
          }
          for (int r = 0; r < rows_.count; ++r) {
            double* block = column + size_t(r) * m_ + h.offset(i);
            block[0] += G[r].real() * d[0] + G[r].imag() * d[ld];
            block[1] += G[r].real() * d[ld] - G[r].imag() * d[0];
          }
        }
      for (int j = 0; j < scalars_; ++j)
        for (size_t r = 0; r < ld; ++r) column[contact + j] -= BAR[j * contact + at + r] * dD_[p][r * ld + c];
    }
  }
}

/// T += [., B A^-1 C; ., S - R A^-1 C]
void CondensedPreconditioner::add_border(std::vector<double>& T) const {
  const size_t contact = size_t(rows_.count) * m_, size = size_;
  for (int j = 0; j < scalars_; ++j) {
    double* column = &T[(contact + j) * size];
    std::ranges::copy(contact_motion(&AC_[j * blocks_]), column);
    for (int i = 0; i < scalars_; ++i)
      column[contact + i] = S_[j * scalars_ + i] - along_row(i, &AC_[j * blocks_]);
  }
}

void CondensedPreconditioner::condense() {
  size_ = as_int(PetscInt64(rows_.count) * m_ + scalars_, "coefficients of the contact");
  int info = 0;
  together(problem_.comm(), "condensing the structure on its contact", [&] {
    if (!first_rank_) return;
    fault::point("condensed system");
    T_.assign(size_t(size_) * size_, 0.0);
    for (int k = 0; k < rows_.count * m_; ++k) T_[size_t(k) * size_ + k] = 1;
    add_contact(T_);
    add_border(T_);
    pivots_.resize(size_);
    dgetrf_(&size_, &size_, T_.data(), &size_, pivots_.data(), &info);
    if (fault::value("condensed system")) info = 1;
  });
  MPI_Bcast(&info, 1, MPI_INT, 0, problem_.comm());
  if (info > 0)
    throw SingularBlock("the condensed contact system is singular (LAPACK info " + std::to_string(info) +
                        "): contact alone does not hold the structure");
  // dgetrf and two rounds of solves for the border, over the two rounds of an application and its dgetrs; ten
  // operations of dgetrf, in cache, take the time of one on a right-hand side
  const double solve = 8 * 2 * factors_.entries() + 2 * double(size_) * size_,
               lu = 2.0 / 3 * size_ * double(size_) * size_;
  build_cost_ = 2 + lu / 10 / solve;
}

void CondensedPreconditioner::build(Vec y, Vec row) {
  const Exponents e = problem_.scaled(y).exponents;
  auto contacts = problem_.pair_tangents(y);
  if (rows_.pairs.empty()) rows_ = ContactRows::of(contacts, problem_.comm());
  if (moved(e)) factorise(e, contacts);
  gather_tangents(contacts);
  border(y, row);
  condense();
}

void CondensedPreconditioner::apply(Vec x, Vec z) {
  check(VecScatterBegin(to_first_, x, whole_, INSERT_VALUES, SCATTER_FORWARD));
  check(VecScatterEnd(to_first_, x, whole_, INSERT_VALUES, SCATTER_FORWARD));
  {
    WriteArray all(whole_);
    std::vector<double> q(all.data(), all.data() + (first_rank_ ? blocks_ : 0)), u;
    factors_.solve(q.data(), 1, blocks_);
    if (first_rank_) {
      u = contact_motion(q.data());
      for (int j = 0; j < scalars_; ++j) u.push_back(all[blocks_ + j] - along_row(j, q.data()));
      const int one = 1;
      int info;
      dgetrs_("N", &size_, &one, T_.data(), &size_, pivots_.data(), u.data(), &size_, &info);
      subtract_force(u.data(), all.data());
      for (int j = 0; j < scalars_; ++j) {
        const double zj = all[blocks_ + j] = u[size_t(rows_.count) * m_ + j];
        for (size_t k = 0; k < blocks_; ++k) all[k] -= zj * C_[j * blocks_ + k];
      }
    }
    factors_.solve(all.data(), 1, blocks_);
  }
  check(VecScatterBegin(to_first_, whole_, z, INSERT_VALUES, SCATTER_REVERSE));
  check(VecScatterEnd(to_first_, whole_, z, INSERT_VALUES, SCATTER_REVERSE));
}

std::string CondensedPreconditioner::describe() const {
  char text[160];
  std::snprintf(text, sizeof text, "%zu sparse %s factors (%.0f MB) condensed on %d contact rows", G_.size(),
                factors_.symmetric() ? "symmetric" : "general", factors_.megabytes(), rows_.count);
  return G_.empty() ? "sparse factors, not made yet" : text;
}

}  // namespace fretwave::precondition
