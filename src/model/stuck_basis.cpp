#include "model/stuck_basis.h"

#include <algorithm>
#include <cmath>

#include "blocked_product.h"
#include "lapack.h"
#include "log.h"
#include "model/moving_modes.h"
#include "proportional.h"
#include "tuned.h"

namespace fretwave::model {

namespace {

const Tuned all_modes("stuck_all_modes", 800, "dofs up to which all modes of stuck pairs are made");
const Tuned moves("stuck_moves", 1e-6,
                  "inertia, over that of the first mode, down to which modes are made where not all are");
constexpr double asymmetry = 1e-9;  // of the largest entry
constexpr double stiffest = 1e-5;   // share of its motion that the structure leaves a stuck pair's spring

bool symmetric(std::vector<double> const& A, size_t n) {
  double largest = 0, apart = 0;
  for (size_t j = 0; j < n; ++j)
    for (size_t i = 0; i <= j; ++i) {
      largest = std::max(largest, std::abs(A[j * n + i]));
      apart = std::max(apart, std::abs(A[j * n + i] - A[i * n + j]));
    }
  return apart <= asymmetry * largest;
}

bool plain(Model const& model) {
  const auto of_sector = [](Term const& term) { return term.phase != 0; };
  const auto reaches = [](Contact const& contact) { return !contact.ahead.empty(); };
  return !model.unit() && std::ranges::none_of(model.terms(), of_sector) &&
         std::ranges::none_of(model.contacts(), reaches);
}

}  // namespace

std::vector<ContactEntry> contact_entries(Model const& model) {
  int mine = 0, first = 0;
  for (auto const& contact : model.contacts()) mine += contact.law->components() * contact.law->pairs();
  MPI_Exscan(&mine, &first, 1, MPI_INT, MPI_SUM, model.comm());
  if (comm_rank(model.comm()) == 0) first = 0;
  std::vector<ContactEntry> entries;
  for (auto const& contact : model.contacts()) {
    PetscInt begin;
    check(MatGetOwnershipRange(contact.B, &begin, nullptr));
    for_entries(contact.B, [&](PetscInt row, PetscInt dof, double value) {
      entries.push_back({first + int(row - begin), int(dof), value});
    });
    first += contact.law->components() * contact.law->pairs();
  }
  return gathered(std::span<ContactEntry const>(entries), model.comm());
}

std::vector<double> stuck_stiffness(Model const& model) {
  std::vector<double> k;
  for (auto const& contact : model.contacts())
    for (int pair = 0; pair < contact.law->pairs(); ++pair)
      for (int component = 0; component < contact.law->components(); ++component)
        k.push_back(contact.law->stuck_stiffness(component, pair));
  return gathered(std::span<double const>(k), model.comm());
}

bool has_stuck_stiffness(Model const& model, std::vector<double> const& stiffness) {
  return plain(model) && !stiffness.empty() &&
         std::ranges::all_of(stiffness, [](double k) { return std::isfinite(k); });
}

bool too_stiff(std::vector<double> const& motions, std::vector<double> const& stiffness) {
  const size_t rows = stiffness.size();
  std::vector<double> compliance(rows, 0.0);
  for (size_t k = 0; k < motions.size(); ++k) compliance[k % rows] += motions[k] * motions[k];
  for (size_t row = 0; row < rows; ++row)
    if (1 - stiffness[row] * compliance[row] < stiffest) return true;
  return false;
}

std::unique_ptr<StuckBasis> StuckBasis::of(Model const& model, bool asked) {
  static const log::Event making("FwStuckBasis");
  const log::Span span(making);
  auto out = std::make_unique<StuckBasis>();
  out->stiffness_ = stuck_stiffness(model);
  const MatHandle K = model.sum(0), M = model.sum(2);
  if (!has_stuck_stiffness(model, out->stiffness_) || !K || !M) return nullptr;
  const auto entries = contact_entries(model);
  const size_t n = model.dofs(), rows = out->stiffness_.size();
  auto stiffness = whole(K), mass = whole(M);
  if (!symmetric(stiffness, n) || !symmetric(mass, n)) return nullptr;
  std::vector<std::vector<ContactEntry>> of_row(rows);
  for (ContactEntry const& e : entries) of_row[e.row].push_back(e);
  for (size_t row = 0; row < rows; ++row)
    for (ContactEntry const& a : of_row[row])
      for (ContactEntry const& b : of_row[row])
        stiffness[size_t(b.dof) * n + a.dof] += out->stiffness_[row] * a.value * b.value;
  if (!out->solve(std::move(stiffness), mass, model.first_dof(), model.local_dofs(), asked)) return nullptr;
  out->motions_.assign(rows * n, 0.0);
  for (size_t j = 0; j < n; ++j)
    for (ContactEntry const& e : entries) out->motions_[j * rows + e.row] += e.value * mass[j * n + e.dof];
  return too_stiff(out->motions_, out->stiffness_) ? nullptr : std::move(out);
}

/// False if K is not positive definite. The columns are left in M; of so many dofs from the first on this
/// rank has them.
bool StuckBasis::solve(std::vector<double> K, std::vector<double>& M, size_t first, size_t local, bool all) {
  const int n = int(std::lround(std::sqrt(double(M.size()))));
  auto moving = n > all_modes && !all ? moving_modes(K, M, n, moves) : std::nullopt;
  if (moving)
    theta_ = std::move(moving->theta), M = std::move(moving->columns);
  else if (!solve_whole(std::move(K), M, n))
    return false;
  modes_ = int(theta_.size()), local_ = int(local), dofs_ = n;
  theta_.resize(n, 0.0);
  for (double& value : theta_) value = std::max(value, 0.0);  // motions without mass
  shapes_.resize(local * n);
  for (int j = 0; j < n; ++j)
    std::copy_n(M.data() + size_t(j) * n + first, local, shapes_.data() + size_t(j) * local);
  return true;
}

/// All modes; false if K is not positive definite.
bool StuckBasis::solve_whole(std::vector<double> K, std::vector<double>& M, int n) {
  const int type = 1;
  std::vector<double> theta(n);
  double size = 0;
  int ints = 0, info = 0, ask = -1;
  dsygvd_(&type, "V", "U", &n, M.data(), &n, K.data(), &n, theta.data(), &size, &ask, &ints, &ask, &info);
  std::vector<double> work(static_cast<size_t>(size));
  std::vector<int> places(ints);
  const int room = int(work.size());
  dsygvd_(&type, "V", "U", &n, M.data(), &n, K.data(), &n, theta.data(), work.data(), &room, places.data(),
          &ints, &info);
  if (info) return false;
  theta_.assign(theta.rbegin(), theta.rend());
  for (int j = 0; j < n / 2; ++j)  // the highest frequency comes first
    std::swap_ranges(M.begin() + std::ptrdiff_t(j) * n, M.begin() + std::ptrdiff_t(j + 1) * n,
                     M.begin() + std::ptrdiff_t(n - 1 - j) * n);
  return true;
}

/// In proportion to M, or to K, of which Psi^T K Psi = 1 - (B Psi)^T k B Psi, no product is needed.
std::vector<double> StuckBasis::damping(Model const& model) const {
  std::vector<double> out(size(), 0.0);
  const MatHandle C = model.sum(1);
  if (!C) return out;
  if (const double of_mass = multiple_of(C, model.sum(2)); of_mass != 0) {
    for (int j = 0; j < modes_; ++j) out[j] = of_mass * theta_[j];
    return out;
  }
  const double of_stiffness = multiple_of(C, model.sum(0));
  if (of_stiffness == 0) return diagonal(C);
  for (int j = 0; j < held(); ++j) {
    double structure = 1;
    for (int row = 0; row < rows(); ++row)
      structure -= stiffness_[row] * std::pow(motions_[size_t(j) * rows() + row], 2);
    out[j] = of_stiffness * structure;
  }
  return out;
}

/// Of Psi^T A Psi, over the columns that are held.
std::vector<double> StuckBasis::diagonal(Mat A) const {
  std::vector<double> out(size(), 0.0);
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  const int together = std::clamp(held(), 1, BlockedProduct::most);
  BlockedProduct product(A, together);
  const VecHandle moved = make_vector(comm, PetscInt(local_) * together);
  const auto mode = [&](int i, int j) {
    return factor_ ? exactly_[size_t(j) * local_ + i] : double(shapes_[size_t(j) * local_ + i]);
  };
  for (int first = 0; first < held(); first += together) {
    const int count = std::min(together, held() - first);
    for (int i = 0; i < local_; ++i)
      for (int j = 0; j < count; ++j) product.columns()[size_t(i) * together + j] = mode(i, first + j);
    check(VecSet(moved, 0));
    product.multiply_add(moved);
    const ReadArray in(moved);
    for (int i = 0; i < local_; ++i)
      for (int j = 0; j < count; ++j) out[first + j] += mode(i, first + j) * in[size_t(i) * together + j];
  }
  sum_over_ranks(out, comm);
  return out;
}

void StuckBasis::forces(double const* x, int coefficients, double* g, double* moved) const {
  static const log::Event projection("FwBasis");
  const log::Span span(projection);
  const int c = coefficients;
  if (factor_) {
    std::vector<double> other(moved ? 0 : size_t(c) * local_);
    if (!moved) moved = other.data();
    factor_->solve(x, c, moved);
    lapack::multiply("NN", {c, modes_, local_}, 1.0, {x, c}, {exactly_.data(), local_}, 0.0, g, c);
    static_forces(moved, c, g);
    return;
  }
  const int lead = lapack::filled_up(c);
  const auto in = lapack::filled_up(x, c, local_);
  std::vector<float> out(size_t(lead) * size());
  lapack::multiply("NN", {lead, size(), local_}, 1.0f, {in.data(), lead}, {shapes_.data(), local_}, 0.0f,
                   out.data(), lead);
  lapack::take(out, c, size(), g);
}

void StuckBasis::motion(double const* g, int coefficients, double* q) const {
  static const log::Event projection("FwBasis");
  const log::Span span(projection);
  const int c = coefficients;
  if (factor_) {
    std::vector<double> modal(g, g + size_t(c) * modes_);
    static_motion(g + modal.size(), c, modal.data(), q);
    lapack::multiply("NT", {c, local_, modes_}, 1.0, {modal.data(), c}, {exactly_.data(), local_}, 1.0, q, c);
    return;
  }
  const int lead = lapack::filled_up(c);
  const auto in = lapack::filled_up(g, c, size());
  std::vector<float> out(size_t(lead) * local_);
  lapack::multiply("NT", {lead, local_, size()}, 1.0f, {in.data(), lead}, {shapes_.data(), local_}, 0.0f,
                   out.data(), lead);
  lapack::take(out, c, local_, q);
}

double StuckBasis::flops() const {
  if (!factor_) return 4 * dofs_ * size();
  const double forces = 4 * factor_->entries(), motion = keeps_static_ ? 2 * dofs_ * rows() : forces;
  return 4 * dofs_ * modes_ + 2 * double(rows()) * rows() + forces + motion;
}

}  // namespace fretwave::model
