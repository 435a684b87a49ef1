#include "hb/dynamic_stiffness.h"

#include <algorithm>
#include <cmath>

#include "lapack.h"
#include "log.h"
#include "proportional.h"
#include "tuned.h"

namespace fretwave::hb {

namespace {

const Tuned dense_share("stiffness_dense_share", 0.25,
                        "share of nonzero entries from which a dense product is the faster one");

constexpr PetscInt few = 16;      // dofs, of which a dense product is not worth its way
constexpr PetscInt coarse = 100;  // dofs of a model whose stiffness is hardly above that of its bending

bool is_dense(Mat A) {
  MatInfo info;
  PetscInt n;
  check(MatGetSize(A, &n, nullptr));
  check(MatGetInfo(A, MAT_GLOBAL_SUM, &info));
  return n > few && info.nz_used > dense_share * double(n) * double(n);
}

}  // namespace

DynamicStiffness::DynamicStiffness(model::Model const& model, Harmonics const& h)
    : model_(model), harmonics_(h) {
  for (auto const& term : model.terms()) {
    row_sums_.emplace_back(model.local_dofs(), 0.0);
    for_entries(term.A, [&](PetscInt row, PetscInt, double value) {
      row_sums_.back()[row - model.first_dof()] += std::abs(value);
    });
    const bool stiffness = term.order == 0 && term.phase == 0;
    blocked_.emplace_back();
    blocked_.back().cancels = stiffness && model.dofs() > coarse;
    if (!is_dense(term.A)) {
      blocked_.back().sparse.emplace(term.A, h.block_size());
      continue;
    }
    blocked_.back().dense.assign(size_t(model.local_dofs()) * model.dofs(), 0.0);
    for (auto const& entry : entries(term.A))
      blocked_.back().dense[size_t(entry.row - model.first_dof()) * model.dofs() + entry.col] = entry.value;
    if (stiffness)
      blocked_.back().split = SplitMatrix(blocked_.back().dense, int(model.local_dofs()), int(model.dofs()));
  }
  work_ = make_vector(model.comm(), model.local_dofs() * h.block_size());
  find_parts();
}

/// Damping in proportion to stiffness, or to mass, goes with its product.
void DynamicStiffness::find_parts() {
  auto const& terms = model_.terms();
  parts_.resize(terms.size());
  for (size_t j = 0; j < terms.size(); ++j) parts_[j].push_back({j, 1});
  for (size_t j = 0; j < terms.size(); ++j)
    for (size_t i = 0; terms[j].order == 1 && i < terms.size() && !parts_[j].empty(); ++i) {
      if (terms[i].order == 1 || terms[i].phase != terms[j].phase) continue;
      const double times = multiple_of(terms[j].A, terms[i].A);
      if (times == 0) continue;
      parts_[i].push_back({j, times});
      parts_[j].clear();
    }
}

/// Coefficients of a product, of those that its terms have; none where none has any.
template <class Of>
DynamicStiffness::Coefficients DynamicStiffness::sum(std::vector<Part> const& parts, Of of) const {
  Coefficients out;
  for (auto const& [term, times] : parts) {
    const Coefficients c = of(model_.terms()[term]);
    if (out.empty()) out.resize(c.size());
    for (size_t i = 0; i < c.size(); ++i) out[i] += times * c[i];
  }
  return out;
}

/// Of all terms or of those of one order.
DynamicStiffness::Coefficients DynamicStiffness::coefficients(std::vector<Part> const& parts,
                                                              Exponents const& e, int order) const {
  return sum(parts, [&](model::Term const& term) {
    return order < 0 || term.order == order ? coefficients(term, e) : Coefficients();
  });
}

complex DynamicStiffness::phase(model::Term const& term, int n) const {
  return std::polar(1.0, -term.phase * n * model_.theta());
}

// Laxalde et al. 2008, eq. 7 in complex form: (K + s C + s^2 M) q; EPMC (Krack 2015) replaces C by C - g M, g
// = 2 zeta w0.
std::vector<complex> DynamicStiffness::coefficients(model::Term const& term, Exponents const& e) const {
  std::vector<complex> c(harmonics_.count());
  for (int i = 0; i < harmonics_.count(); ++i) {
    const complex s = e.s[i];
    c[i] = (term.order == 0   ? 1.0
            : term.order == 1 ? s
                              : s * s - e.inertia_damping * s) *
           phase(term, harmonics_.orders()[i]);
  }
  return c;
}

std::vector<complex> DynamicStiffness::coefficient_derivatives(model::Term const& term, Exponents const& e,
                                                               Exponents const& change) const {
  std::vector<complex> c(harmonics_.count());
  for (int i = 0; i < harmonics_.count(); ++i) {
    const complex s = e.s[i], ds = change.s[i];
    const complex d = term.order == 0   ? 0.0
                      : term.order == 1 ? ds
                                        : (2.0 * s - e.inertia_damping) * ds - change.inertia_damping * s;
    c[i] = d * phase(term, harmonics_.orders()[i]);
  }
  return c;
}

/// y += A (c x): with blocks innermost, Y^T (m x local) += X^T (m x all) A^T.
void DynamicStiffness::accumulate(std::vector<complex> const& c, Blocked& A, Vec x, Vec y, bool exactly) {
  static const log::Event structure("FwStructure");
  const log::Span span(structure);
  const int m = harmonics_.block_size(), local = int(model_.local_dofs()), all = int(model_.dofs());
  if (A.sparse) {
    multiply(harmonics_, c, ReadArray(x).data(), A.sparse->columns(), local);
    if (!exactly || !A.cancels) return A.sparse->multiply_add(y);
    check(VecSet(work_, 0));
    A.sparse->multiply_exactly(y, work_);
    check(VecAXPY(y, 1, work_));
    return;
  }
  multiply(harmonics_, c, ReadArray(x).data(), WriteArray(work_).data(), local);
  const auto X = gathered(work_);
  if (local == 0) return;
  WriteArray Y(y);
  if (exactly && A.split) return A.split.multiply_add(X.data(), Y.data(), m);
  lapack::multiply("NN", {m, local, all}, 1.0, {X.data(), m}, {A.dense.data(), all}, 1.0, Y.data(), m);
}

void DynamicStiffness::multiply_add(Exponents const& e, Vec x, Vec y, int order, bool exactly) {
  for (size_t j = 0; j < blocked_.size(); ++j)
    if (const auto c = coefficients(parts_[j], e, order); !c.empty())
      accumulate(c, blocked_[j], x, y, exactly);
}

void DynamicStiffness::multiply_add(Exponents const& e, Vec x, Vec y, int order) {
  multiply_add(e, x, y, order, false);
}

void DynamicStiffness::multiply_add_exactly(Exponents const& e, Vec x, Vec y) {
  multiply_add(e, x, y, -1, true);
}

/// Z of a change acts on the coefficients of a dof, A on its dofs: A x is made once for all changes.
void DynamicStiffness::derivative_multiply_add(Exponents const& e, Exponents const& change, Vec x, Vec y) {
  products_.resize(blocked_.size());
  for (size_t j = 0; j < blocked_.size(); ++j) {
    const auto c = sum(parts_[j], [&](model::Term const& term) {
      return term.order > 0 ? coefficient_derivatives(term, e, change) : Coefficients();
    });
    if (c.empty()) continue;
    if (!products_[j]) {
      products_[j] = like(y);
      check(VecSet(products_[j], 0));
      accumulate(Coefficients(size_t(harmonics_.count()), 1.0), blocked_[j], x, products_[j]);
    }
    multiply(harmonics_, c, ReadArray(products_[j]).data(), WriteArray(work_).data(),
             int(model_.local_dofs()));
    check(VecAXPY(y, 1, work_));
  }
}

/// (A (x) c)^T = A^T (x) conj(c): as a block on (cos, sin), c = a + i b is [[a, b], [-b, a]].
void DynamicStiffness::transposed_multiply_add(Exponents const& e, Vec x, Vec y) {
  for (size_t j = 0; j < blocked_.size(); ++j) {
    const auto c = coefficients(parts_[j], e, -1);
    if (c.empty()) continue;
    accumulate_transposed(conjugate(c), blocked_[j], x, y);
  }
}

/// y += A^T (c x): of dense rows every rank has a part of all entries.
void DynamicStiffness::accumulate_transposed(std::vector<complex> const& c, Blocked& A, Vec x, Vec y) {
  const int m = harmonics_.block_size(), local = int(model_.local_dofs()), all = int(model_.dofs());
  multiply(harmonics_, c, ReadArray(x).data(), A.sparse ? A.sparse->columns() : WriteArray(work_).data(),
           local);
  if (A.sparse) return A.sparse->transposed_multiply_add(y);
  std::vector<double> parts(size_t(all) * m);
  if (local)
    lapack::multiply("NT", {m, all, local}, 1.0, {ReadArray(work_).data(), m}, {A.dense.data(), all}, 0.0,
                     parts.data(), m);
  MPI_Allreduce(MPI_IN_PLACE, parts.data(), as_int(PetscInt64(parts.size()), "a dense product's entries"),
                MPI_DOUBLE, MPI_SUM, model_.comm());
  WriteArray Y(y);
  double const* mine = parts.data() + size_t(model_.first_dof()) * m;
  for (size_t k = 0; k < size_t(local) * m; ++k) Y[PetscInt(k)] += mine[k];
}

double DynamicStiffness::rounding(Exponents const& e, Vec x) const {
  const int m = harmonics_.block_size();
  ReadArray in(x);
  double square = 0;
  for (int i = 0; i < harmonics_.count(); ++i)
    for (size_t j = 0; j < row_sums_.size(); ++j) {
      const double c = std::norm(coefficients(model_.terms()[j], e)[i]);
      for (PetscInt dof = 0; dof < model_.local_dofs(); ++dof) {
        double const* q = in.data() + dof * m + harmonics_.offset(i);
        const double motion = q[0] * q[0] + (harmonics_.orders()[i] ? q[1] * q[1] : 0);
        square += c * row_sums_[j][dof] * row_sums_[j][dof] * motion;
      }
    }
  MPI_Allreduce(MPI_IN_PLACE, &square, 1, MPI_DOUBLE, MPI_SUM, model_.comm());
  return std::numeric_limits<double>::epsilon() * std::sqrt(square);
}

void DynamicStiffness::pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) const {
  entries_.clear();
  const PetscInt m = harmonics_.block_size();
  const auto place = [&](PetscInt row, PetscInt col) { rows.push_back(row), cols.push_back(col); };
  for (auto const& term : model_.terms()) {
    entries_.push_back(entries(term.A));
    for (auto const& entry : entries_.back())
      for (int i = 0; i < harmonics_.count(); ++i) {
        const PetscInt row = entry.row * m + harmonics_.offset(i), col = entry.col * m + harmonics_.offset(i);
        place(row, col);
        if (harmonics_.orders()[i] == 0) continue;
        place(row, col + 1), place(row + 1, col), place(row + 1, col + 1);
      }
  }
}

double* DynamicStiffness::values(Exponents const& e, double scale, double* v) const {
  for (size_t j = 0; j < entries_.size(); ++j) {
    const auto c = coefficients(model_.terms()[j], e);
    for (auto const& entry : entries_[j])
      for (int i = 0; i < harmonics_.count(); ++i) {
        const complex a = scale * entry.value * c[i];
        *v++ = a.real();
        if (harmonics_.orders()[i] == 0) continue;
        *v++ = a.imag(), *v++ = -a.imag(), *v++ = a.real();
      }
  }
  return v;
}

}  // namespace fretwave::hb
