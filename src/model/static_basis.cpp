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
// 138 million floats beside a factor of 21 million entries: 0.06 s for 15 coefficients, and 0.13 s
const Tuned quicker("static_quicker", 8,
                    "static motions of the contact over entries of the factor, up to which they are kept");
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
  const PetscErrorCode code = EPSSolve(eps);
  factor.rethrow();
  check(code);
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

/// u += B x of columns of this rank's dofs.
void add_relative_motion(std::vector<ContactEntry> const& own, double const* x, size_t lead, size_t columns,
                         double* u, size_t rows) {
  for (size_t j = 0; j < columns; ++j)
    for (ContactEntry const& e : own) u[j * rows + e.row] += e.value * x[j * lead + e.dof];
}

/// B K_s^-1 B^T, and K_s^-1 B^T by this rank's dofs if it is kept. Collective.
std::vector<double> contact_compliance(StaticFactor const& factor, std::vector<ContactEntry> const& own,
                                       PetscInt rows, MPI_Comm comm, std::vector<float>& kept) {
  std::vector<double> G(size_t(rows) * rows, 0.0);
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
    add_relative_motion(own, found, size_t(lead), size_t(columns), G.data() + size_t(first) * rows,
                        size_t(rows));
    for (PetscInt j = 0; j < columns && !kept.empty(); ++j)
      for (PetscInt dof = 0; dof < factor.local_dofs(); ++dof)
        kept[size_t(dof) * rows + first + j] = float(found[size_t(j) * lead + dof]);
    check(MatDenseRestoreArrayRead(X, &found));
  }
  sum_over_ranks(G, comm);
  return G;
}

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
  return {rows * (2 * rows + modes), dofs * (modes + 2 * columns_at_once)};
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
  const PetscInt count = std::min(PetscInt(lowest.count()), std::max(PetscInt(1), model.dofs() / 3));
  out->theta_ = lowest_modes(*factor, M, count, out->exactly_);
  if (out->theta_.empty()) return nullptr;
  out->modes_ = int(out->theta_.size()), out->local_ = int(model.local_dofs()), out->dofs_ = model.dofs();
  out->factor_ = std::move(factor), out->own_ = own_entries(contact_entries(model), model);
  out->add_static(model.comm());
  return too_stiff(out->motions_, out->stiffness_) ? nullptr : std::move(out);
}

// With W = K_s^-1 B^T and U = B Phi: of what W moves beside the modes, W - Phi U^T, the contact sees G = B W
// - U U^T, P^T D G D P = L L^T, so that (W - Phi U^T) P D L_1^-T are of unit stiffness and move it by D^-1 P
// L, with L_1 the triangle that L begins with.
void StuckBasis::add_static(MPI_Comm comm) {
  const size_t r = stiffness_.size();
  const int rows = int(r), k = modes_;
  motions_.assign(r * size_t(k), 0.0);
  add_relative_motion(own_, exactly_.data(), size_t(local_), size_t(k), motions_.data(), r);
  sum_over_ranks(motions_, comm);
  keeps_static_ = dofs_ * rows <= quicker * factor_->entries();
  if (keeps_static_) static_shapes_.resize(r * size_t(local_));
  auto G = contact_compliance(*factor_, own_, rows, comm, static_shapes_);
  lapack::multiply("NT", {rows, rows, k}, -1.0, {motions_.data(), rows}, {motions_.data(), rows}, 1.0,
                   G.data(), rows);
  triangle_ = pivoted(std::move(G), stiffness_);
  auto const& [order, rank, scale, L] = triangle_;
  motions_.resize(r * size_t(k + rank));
  for (int j = 0; j < rank; ++j)
    for (int i = j; i < rows; ++i)
      motions_[size_t(k + j) * r + order[i]] = L[size_t(j) * r + i] / scale[order[i]];
  theta_.resize(size_t(k + rank), 0.0);
}

/// Behind the modes' Phi^T x: L_1^-1 D P^T (B K_s^-1 x - U Phi^T x).
void StuckBasis::static_forces(double const* moved, int coefficients, double* g) const {
  const int c = coefficients, k = modes_, r = rows();
  auto const& [order, rank, scale, L] = triangle_;
  std::vector<double> u(size_t(c) * r, 0.0);
  for (ContactEntry const& e : own_)
    for (int i = 0; i < c; ++i) u[size_t(e.row) * c + i] += e.value * moved[size_t(e.dof) * c + i];
  lapack::multiply("NT", {c, r, k}, -1.0, {g, c}, {motions_.data(), r}, 1.0, u.data(), c);
  double* out = g + size_t(c) * k;
  for (int j = 0; j < rank; ++j)
    for (int i = 0; i < c; ++i) out[size_t(j) * c + i] = scale[order[j]] * u[size_t(order[j]) * c + i];
  const double one = 1;
  dtrsm_("R", "L", "T", "N", &c, &rank, &one, L.data(), &r, out, &c);
}

/// q = K_s^-1 B^T f of static motions g, f = P D L_1^-T g, and what they are short of along the modes: modal
/// -= U^T f. Collective.
void StuckBasis::static_motion(double const* g, int coefficients, double* modal, double* q) const {
  const int c = coefficients, k = modes_, r = rows();
  auto const& [order, rank, scale, L] = triangle_;
  std::vector<double> v(g, g + size_t(c) * rank), f(size_t(c) * r, 0.0);
  const double one = 1;
  dtrsm_("R", "L", "N", "N", &c, &rank, &one, L.data(), &r, v.data(), &c);
  for (int j = 0; j < rank; ++j)
    for (int i = 0; i < c; ++i) f[size_t(order[j]) * c + i] = scale[order[j]] * v[size_t(j) * c + i];
  lapack::multiply("NN", {c, k, r}, -1.0, {f.data(), c}, {motions_.data(), r}, 1.0, modal, c);
  if (keeps_static_) {
    const int lead = lapack::filled_up(c);
    std::vector<float> out(size_t(lead) * local_);
    lapack::multiply("NN", {lead, local_, r}, 1.0f, {lapack::filled_up(f.data(), c, r).data(), lead},
                     {static_shapes_.data(), r}, 0.0f, out.data(), lead);
    return lapack::take(out, c, local_, q);
  }
  std::vector<double> b(size_t(c) * local_, 0.0);
  for (ContactEntry const& e : own_)
    for (int i = 0; i < c; ++i) b[size_t(e.dof) * c + i] += e.value * f[size_t(e.row) * c + i];
  factor_->solve(b.data(), c, q);
}

}  // namespace fretwave::model
