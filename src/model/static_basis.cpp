/// The basis of stuck pairs of finite elements: lowest modes and static corrections by one real factor.
#include <slepceps.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "lapack.h"
#include "log.h"
#include "model/eigenproblem.h"
#include "model/stuck_basis.h"
#include "tuned.h"

namespace fretwave::model {

namespace {

using EpsHandle = Handle<EPS, EPSDestroy>;

const Tuned lowest("static_modes", 30, "modes of stuck pairs beside a static factor");
const Tuned negligible("static_negligible", 1e-6,
                       "share of a stuck pair's motion that static corrections leave out");
constexpr PetscInt columns_at_once = 48;  // right-hand sides: matrix products inside MUMPS
constexpr double tolerance = 1e-9;        // of the modes; their frequencies are exact to its square

MatHandle stuck(Model const& model) {
  auto parts = required(model, 0, "stiffness");
  for (auto const& contact : model.contacts())
    add_contact(parts, contact,
                [&](int component, int pair) { return contact.law->stuck_stiffness(component, pair); });
  return real_form(parts, model.theta(), false);
}

/// M phi = theta K_s phi with phi^T K_s phi = 1, theta descending, by the factor alone; columns of this
/// rank's dofs. An ST resets the KSP that it is left with.
std::vector<double> lowest_modes(StaticFactor const& factor, Mat M, PetscInt count,
                                 std::vector<double>& shapes) {
  EpsHandle eps;
  KspHandle other;
  ST st;
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(M), &comm));
  check(EPSCreate(comm, eps.out()));
  check(EPSSetOptionsPrefix(eps, "static_"));
  check(EPSSetOperators(eps, M, factor.stiffness()));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetDimensions(eps, count, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, tolerance, 1000));
  check(EPSSetWhichEigenpairs(eps, EPS_LARGEST_REAL));
  check(EPSGetST(eps, &st));
  check(STSetKSP(st, factor.ksp()));
  check(EPSSetFromOptions(eps));
  check(EPSSolve(eps));
  PetscInt converged;
  check(EPSGetConverged(eps, &converged));
  std::vector<double> theta;
  VecHandle phi;
  check(MatCreateVecs(M, phi.out(), nullptr));
  for (PetscInt k = 0; k < std::min(converged, count); ++k) {
    double value;
    check(EPSGetEigenpair(eps, k, &value, nullptr, phi, nullptr));
    if (!(value > 1e-14 * (theta.empty() ? 0 : theta[0]))) break;  // a motion without mass
    theta.push_back(value);
    const ReadArray in(phi);
    shapes.insert(shapes.end(), in.span().begin(), in.span().end());
  }
  check(KSPCreate(comm, other.out()));
  check(STSetKSP(st, other));
  return theta;
}

/// This rank's entries of the rows of B, by its own dofs.
std::vector<ContactEntry> own_entries(std::vector<ContactEntry> const& all, Model const& model) {
  std::vector<ContactEntry> own;
  for (ContactEntry e : all) {
    e.dof -= int(model.first_dof());
    if (e.dof >= 0 && e.dof < model.local_dofs()) own.push_back(e);
  }
  return own;
}

/// K_s^-1 B^T, into columns of this rank's dofs. Collective.
void contact_motions(StaticFactor const& factor, std::vector<ContactEntry> const& own, PetscInt rows,
                     double* to) {
  const size_t local = size_t(factor.local_dofs());
  for (PetscInt first = 0; first < rows; first += columns_at_once) {
    const PetscInt columns = std::min(rows - first, columns_at_once);
    const MatHandle B = dense_columns(factor.stiffness(), columns),
                    X = dense_columns(factor.stiffness(), columns);
    PetscInt lead;
    double* right;
    double const* found;
    check(MatDenseGetLDA(B, &lead));
    check(MatDenseGetArray(B, &right));
    for (ContactEntry const& e : own)
      if (e.row >= first && e.row < first + columns) right[size_t(e.row - first) * lead + e.dof] += e.value;
    check(MatDenseRestoreArray(B, &right));
    factor.solve(B, X);
    check(MatDenseGetLDA(X, &lead));
    check(MatDenseGetArrayRead(X, &found));
    for (PetscInt j = 0; j < columns; ++j)
      std::copy_n(found + size_t(j) * lead, local, to + size_t(first + j) * local);
    check(MatDenseRestoreArrayRead(X, &found));
  }
}

/// B x of columns of this rank's dofs, rows of all ranks' pairs. Collective.
std::vector<double> relative_motions(std::vector<ContactEntry> const& own, size_t rows, double const* x,
                                     size_t local, size_t columns, MPI_Comm comm) {
  std::vector<double> u(rows * columns, 0.0);
  for (size_t j = 0; j < columns; ++j)
    for (ContactEntry const& e : own) u[j * rows + e.row] += e.value * x[j * local + e.dof];
  sum_over_ranks(u, comm);
  return u;
}

/// Columns by their new order, in place: `order[j]` goes to j.
void permute(double* columns, size_t local, std::vector<int> order) {
  for (size_t j = 0; j < order.size(); ++j) {
    size_t from = size_t(order[j]);
    while (from < j) from = size_t(order[from]);  // where an earlier exchange has put it
    std::swap_ranges(columns + j * local, columns + (j + 1) * local, columns + from * local);
  }
}

/// P^T D G D P = L L^T by pivots down to a small one, D = k^(1/2): the columns found.
struct PivotedCholesky {
  std::vector<int> order;
  int rank = 0;
  std::vector<double> scale, L;
};

PivotedCholesky pivoted(std::vector<double> G, std::vector<double> const& stiffness) {
  const int n = int(stiffness.size());
  PivotedCholesky out{std::vector<int>(n), 0, std::vector<double>(n), std::move(G)};
  const double largest = *std::ranges::max_element(stiffness);
  for (int i = 0; i < n; ++i) out.scale[i] = std::sqrt(stiffness[i] > 0 ? stiffness[i] : largest);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) out.L[size_t(j) * n + i] *= out.scale[i] * out.scale[j];
  std::vector<double> work(size_t(2) * n);
  int info;
  const double smallest = negligible;
  dpstrf_("L", &n, out.L.data(), &n, out.order.data(), &out.rank, &smallest, work.data(), &info);
  for (int& place : out.order) --place;
  return out;
}

}  // namespace

std::pair<double, double> StuckBasis::size_with_factor(double dofs, double rows) {
  const double modes = std::min(double(lowest), dofs);
  return {rows * (2 * rows + modes), dofs * (rows + modes)};
}

std::unique_ptr<StuckBasis> StuckBasis::with_factor(Model const& model) {
  static const log::Event making("FwStaticBasis");
  const log::Span span(making);
  auto out = std::make_unique<StuckBasis>();
  out->stiffness_ = model::stuck_stiffness(model);
  const MatHandle M = model.sum(2);
  if (!has_stuck_stiffness(model, out->stiffness_) || !M || !model::symmetric(M)) return nullptr;
  const MatHandle K = stuck(model);
  if (!model::symmetric(K)) return nullptr;
  auto factor = std::make_unique<StaticFactor>(K);
  if (!factor->definite()) return nullptr;
  const PetscInt count = std::min(PetscInt(double(lowest)), std::max(PetscInt(1), model.dofs() / 3));
  out->theta_ = lowest_modes(*factor, M, count, out->exactly_);
  if (out->theta_.empty()) return nullptr;
  out->modes_ = int(out->theta_.size()), out->local_ = int(model.local_dofs()), out->dofs_ = model.dofs();
  out->factor_ = std::move(factor);
  out->add_static(contact_entries(model), model);
  return too_stiff(out->motions_, out->stiffness_) ? nullptr : std::move(out);
}

// With W = K_s^-1 B^T and U = B Phi: of what W moves beside the modes, W - Phi U^T, the contact sees G = B W
// - U U^T = L L^T, so that (W - Phi U^T) L^-T are of unit stiffness and move it by L.
void StuckBasis::add_static(std::vector<ContactEntry> const& all, Model const& model) {
  const auto own = own_entries(all, model);
  const size_t local = size_t(local_), r = stiffness_.size();
  const int rows = int(r), k = modes_, lead = std::max(1, local_);
  exactly_.resize(local * (size_t(k) + r));
  double* W = exactly_.data() + local * size_t(k);
  contact_motions(*factor_, own, rows, W);
  motions_ = relative_motions(own, r, exactly_.data(), local, size_t(k), model.comm());
  auto G = relative_motions(own, r, W, local, r, model.comm());
  lapack::multiply("NT", {rows, rows, k}, -1.0, {motions_.data(), rows}, {motions_.data(), rows}, 1.0,
                   G.data(), rows);
  const auto found = pivoted(std::move(G), stiffness_);
  permute(W, local, found.order);
  exactly_.resize(local * size_t(k + found.rank));
  W = exactly_.data() + local * size_t(k);
  std::vector<double> taken(size_t(found.rank) * size_t(k));  // U of those rows
  for (int l = 0; l < k; ++l)
    for (int j = 0; j < found.rank; ++j) taken[size_t(l) * found.rank + j] = motions_[l * r + found.order[j]];
  lapack::multiply("NT", {local_, found.rank, k}, -1.0, {exactly_.data(), local_}, {taken.data(), found.rank},
                   1.0, W, lead);
  for (int j = 0; j < found.rank; ++j)
    for (size_t i = 0; i < local; ++i) W[j * local + i] *= found.scale[found.order[j]];
  const double one = 1;
  if (local_ && found.rank)
    dtrsm_("R", "L", "T", "N", &local_, &found.rank, &one, found.L.data(), &rows, W, &local_);
  motions_.resize(r * size_t(k + found.rank));
  for (int j = 0; j < found.rank; ++j)
    for (int i = j; i < rows; ++i)
      motions_[size_t(k + j) * r + found.order[i]] = found.L[size_t(j) * r + i] / found.scale[found.order[i]];
  theta_.resize(size_t(k + found.rank), 0.0);
}

}  // namespace fretwave::model
