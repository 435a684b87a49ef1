#include "model/stuck_basis.h"

#include <algorithm>
#include <cmath>

#include "lapack.h"
#include "log.h"

namespace fretwave::model {

namespace {

constexpr double asymmetry = 1e-9;  // of the largest entry
constexpr double stiffest = 1e-5;   // share of its motion that the structure leaves a stuck pair's spring

struct Entry {
  int row, dof;
  double value;
};

/// Rows of B of all ranks' contacts, rank by rank, contact by contact.
std::vector<Entry> contact_rows(Model const& model) {
  int mine = 0, first = 0;
  for (auto const& contact : model.contacts()) mine += contact.law->components() * contact.law->pairs();
  MPI_Exscan(&mine, &first, 1, MPI_INT, MPI_SUM, model.comm());
  if (comm_rank(model.comm()) == 0) first = 0;
  std::vector<Entry> entries;
  for (auto const& contact : model.contacts()) {
    PetscInt begin;
    check(MatGetOwnershipRange(contact.B, &begin, nullptr));
    for_entries(contact.B, [&](PetscInt row, PetscInt dof, double value) {
      entries.push_back({first + int(row - begin), int(dof), value});
    });
    first += contact.law->components() * contact.law->pairs();
  }
  return gathered(std::span<Entry const>(entries), model.comm());
}

std::vector<double> stuck_stiffness(Model const& model) {
  std::vector<double> k;
  for (auto const& contact : model.contacts())
    for (int pair = 0; pair < contact.law->pairs(); ++pair)
      for (int component = 0; component < contact.law->components(); ++component)
        k.push_back(contact.law->stuck_stiffness(component, pair));
  return gathered(std::span<double const>(k), model.comm());
}

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

std::unique_ptr<StuckBasis> StuckBasis::of(Model const& model) {
  static const log::Event making("FwStuckBasis");
  const log::Span span(making);
  auto out = std::make_unique<StuckBasis>();
  out->stiffness_ = stuck_stiffness(model);
  const MatHandle K = model.sum(0), M = model.sum(2);
  if (!plain(model) || !K || !M || out->stiffness_.empty() ||
      !std::ranges::all_of(out->stiffness_, [](double k) { return std::isfinite(k); }))
    return nullptr;
  const auto entries = contact_rows(model);
  const size_t n = model.dofs(), rows = out->stiffness_.size();
  out->dofs_ = int(n);
  auto stiffness = whole(K), mass = whole(M);
  if (!symmetric(stiffness, n) || !symmetric(mass, n)) return nullptr;
  std::vector<std::vector<Entry>> of_row(rows);
  for (Entry const& e : entries) of_row[e.row].push_back(e);
  for (size_t row = 0; row < rows; ++row)
    for (Entry const& a : of_row[row])
      for (Entry const& b : of_row[row])
        stiffness[size_t(b.dof) * n + a.dof] += out->stiffness_[row] * a.value * b.value;
  if (!out->solve(std::move(stiffness), mass)) return nullptr;
  out->motions_.assign(rows * n, 0.0);
  for (size_t j = 0; j < n; ++j)
    for (Entry const& e : entries) out->motions_[j * rows + e.row] += e.value * mass[(n - 1 - j) * n + e.dof];
  for (size_t row = 0; row < rows; ++row) {
    double compliance = 0;
    for (size_t j = 0; j < n; ++j)
      compliance += out->motions_[j * rows + row] * out->motions_[j * rows + row];
    if (1 - out->stiffness_[row] * compliance < stiffest) return nullptr;
  }
  return out;
}

/// False if K is not positive definite; the shapes are left in M, the highest frequency first.
bool StuckBasis::solve(std::vector<double> K, std::vector<double>& M) {
  const int n = dofs_, type = 1;
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
  for (double& value : theta_) value = std::max(value, 0.0);  // motions without mass
  shapes_.resize(M.size());
  for (int j = 0; j < n; ++j) std::copy_n(&M[size_t(n - 1 - j) * n], n, &shapes_[size_t(j) * n]);
  return true;
}

std::vector<double> StuckBasis::diagonal(Mat A) const {
  const size_t n = dofs_;
  std::vector<double> out(n, 0.0);
  const auto dense = whole(A);
  for (size_t j = 0; j < n; ++j) {
    float const* phi = &shapes_[j * n];
    for (size_t col = 0; col < n; ++col) {
      double along = 0;
      for (size_t row = 0; row < n; ++row) along += phi[row] * dense[col * n + row];
      out[j] += along * phi[col];
    }
  }
  return out;
}

}  // namespace fretwave::model
