#include "precondition/harmonic_factors.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "fault.h"
#include "model/eigenproblem.h"
#include "precondition/pair_correction.h"
#include "together.h"

namespace fretwave::precondition {

namespace {

constexpr int columns_at_once = 48;  // right-hand sides: matrix products inside MUMPS

/// Z_n is complex symmetric if all terms are and no spatial phase enters.
bool symmetric(model::Model const& model) {
  return std::ranges::all_of(
      model.terms(), [](model::Term const& term) { return term.phase == 0 && model::symmetric(term.A); });
}

}  // namespace

HarmonicFactors::HarmonicFactors(HarmonicProblem& problem) : problem_(problem) {
  pattern_.size = as_int(problem.model().dofs(), "dofs in sparse blocks");
  pattern_.symmetric = precondition::symmetric(problem.model());
  find_terms();
}

/// One slot for each place that any term fills on this rank's rows.
void HarmonicFactors::find_terms() {
  model::Model const& model = problem_.model();
  terms_.resize(model.terms().size());
  std::vector<size_t> slot_of(pattern_.size);
  std::vector<PetscInt> seen(pattern_.size, -1);  // last row with an entry in the column
  for (PetscInt row = model.first_dof(); row < model.first_dof() + model.local_dofs(); ++row)
    for (size_t j = 0; j < terms_.size(); ++j) {
      PetscInt count;
      PetscInt const* cols;
      PetscScalar const* values;
      check(MatGetRow(model.terms()[j].A, row, &count, &cols, &values));
      for (PetscInt k = 0; k < count; ++k) {
        if (pattern_.symmetric && cols[k] > row) continue;
        if (seen[cols[k]] != row) {
          seen[cols[k]] = row, slot_of[cols[k]] = pattern_.rows.size();
          pattern_.rows.push_back(int(row) + 1), pattern_.cols.push_back(int(cols[k]) + 1);
        }
        terms_[j].push_back({slot_of[cols[k]], values[k]});
      }
      check(MatRestoreRow(model.terms()[j].A, row, &count, &cols, &values));
    }
  term_slots_ = pattern_.rows.size();
}

/// B^T (.) B of this rank's pairs, behind the terms' slots.
void HarmonicFactors::find_contact(std::vector<PairTangents> const& contacts) {
  const size_t harmonics = problem_.harmonics().count();
  size_t pairs_before = 0;
  for (auto const& contact : contacts) {
    const size_t d = contact.components;
    for (size_t first = 0, last = 0; first < contact.weights.size(); first = last) {
      const int pair = contact.weights[first].pair;
      while (last < contact.weights.size() && contact.weights[last].pair == pair) ++last;
      const size_t block = pairs_before + pair * harmonics * d * d;
      for (size_t a = first; a < last; ++a)
        for (size_t b = first; b < last; ++b) {
          Weight const &row = contact.weights[a], &col = contact.weights[b];
          if (pattern_.symmetric && col.dof > row.dof) continue;
          pattern_.rows.push_back(int(row.dof) + 1), pattern_.cols.push_back(int(col.dof) + 1);
          contact_.push_back({block + row.component * d + col.component, d * d, row.value * col.value});
        }
    }
    pairs_before += contact.pairs * harmonics * d * d;
  }
}

/// The complex factor nearest to each coupling, and its symmetric part.
void HarmonicFactors::average(std::vector<PairTangents> const& contacts) {
  Harmonics const& h = problem_.harmonics();
  tangents_.clear();
  for (auto const& contact : contacts) {
    const size_t d = contact.components, ld = d * h.block_size();
    for (int p = 0; p < contact.pairs; ++p) {
      const auto blocks = harmonic_tangents(h, int(d), &contact.D[p * ld * ld], false);
      for (int i = 0; i < h.count(); ++i)
        for (size_t r = 0; r < d; ++r)
          for (size_t c = 0; c < d; ++c) {
            const auto t = [&](size_t row, size_t col) {
              Rotation const& block = blocks[(i * d + row) * d + col];
              return h.orders()[i] == 0 ? complex(block.cc) : block.nearest();
            };
            tangents_.push_back(pattern_.symmetric ? (t(r, c) + t(c, r)) / 2.0 : t(r, c));
          }
    }
  }
}

std::vector<complex> HarmonicFactors::values(int harmonic, Exponents const& e) const {
  std::vector<complex> v(pattern_.rows.size());
  for (size_t j = 0; j < terms_.size(); ++j) {
    const complex c = problem_.terms().stiffness().coefficients(problem_.model().terms()[j], e)[harmonic] /
                      problem_.stiffness_scale();
    for (auto const& entry : terms_[j]) v[entry.slot] += c * entry.value;
  }
  for (size_t k = 0; k < contact_.size(); ++k)
    v[term_slots_ + k] = contact_[k].weight * tangents_[contact_[k].tangent + harmonic * contact_[k].step];
  return v;
}

void HarmonicFactors::factorise(Exponents const& e, std::vector<PairTangents> const& contacts) {
  average(contacts);
  if (factors_.empty()) {
    find_contact(contacts);
    for (int i = 0; i < problem_.harmonics().count(); ++i)
      factors_.emplace_back(problem_.comm(), pattern_, i > 0 ? &factors_[0] : nullptr);
  }
  for (int i = 0; i < problem_.harmonics().count(); ++i) {
    std::vector<complex> v;
    together(problem_.comm(), "assembling a sparse harmonic block", [&] {
      fault::point("sparse block");
      v = values(i, e);
      if (fault::value("sparse block") || !std::ranges::all_of(v, [](complex c) {
            return std::isfinite(c.real()) && std::isfinite(c.imag());
          }))
        throw SingularBlock("a harmonic block of the preconditioner is not finite");
    });
    factors_[i].factorise(std::move(v));
  }
}

// Real form of a on (qc, qs) is [ar ai; -ai ar]; its transpose is that of conj(a), so A^-T r = conj(A^-T
// conj(r)) with the complex transpose on the right.
void HarmonicFactors::solve(double* x, int columns, size_t ld, bool transposed) {
  Harmonics const& h = problem_.harmonics();
  const size_t n = pattern_.size, m = h.block_size();
  const bool first = comm_rank(problem_.comm()) == 0;
  const double sign = transposed ? 1 : -1;
  std::vector<complex> v(first ? n * columns : 0);
  for (int i = 0; i < h.count(); ++i) {
    const bool mean = h.orders()[i] == 0;
    const auto at = [&](size_t k) { return x + (k / n) * ld + (k % n) * m + h.offset(i); };
    for (size_t k = 0; k < v.size(); ++k) v[k] = {at(k)[0], mean ? 0 : sign * at(k)[1]};
    factors_[i].solve(v.data(), columns, transposed && !pattern_.symmetric);
    for (size_t k = 0; k < v.size(); ++k) {
      at(k)[0] = v[k].real();
      if (!mean) at(k)[1] = sign * v[k].imag();
    }
  }
}

std::vector<complex> HarmonicFactors::compliance(int harmonic, ContactRows const& rows) {
  const size_t n = pattern_.size, all = rows.count;
  const bool first_rank = comm_rank(problem_.comm()) == 0;
  std::vector<complex> G(first_rank ? all * all : 0), x;
  for (size_t first = 0; first < all; first += columns_at_once) {
    const size_t columns = std::min(all - first, size_t(columns_at_once));
    if (first_rank) {
      x.assign(n * columns, 0.0);
      for (auto const& b : rows.entries)
        if (size_t(b.row) >= first && size_t(b.row) < first + columns)
          x[(b.row - first) * n + b.dof] += b.value;
    }
    factors_[harmonic].solve(x.data(), int(columns));
    if (!first_rank) continue;
    for (size_t j = 0; j < columns; ++j)
      for (auto const& b : rows.entries) G[(first + j) * all + b.row] += b.value * x[j * n + b.dof];
  }
  return G;
}

double HarmonicFactors::megabytes() const {
  double sum = 0;
  for (auto const& factor : factors_) sum += factor.megabytes();
  return sum;
}

double HarmonicFactors::entries() const {
  double sum = 0;
  for (auto const& factor : factors_) sum += factor.entries();
  return sum;
}

}  // namespace fretwave::precondition
