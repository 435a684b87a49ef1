#include "wheel/sector_factor.h"

#include <algorithm>

#include "lapack.h"
#include "log.h"
#include "together.h"

namespace fretwave::wheel {

namespace {

constexpr int together_at_most = 64;  // columns of a solve: matrix products inside MUMPS

MatHandle inner_matrix(std::vector<int> const& dofs, std::vector<int> const& number, SparseBlock const& K,
                       std::vector<char> const& is_shared) {
  std::vector<PetscInt> counts;
  for (const int dof : dofs) counts.push_back(K.first[dof + 1] - K.first[dof]);
  MatHandle out;
  const PetscInt n = PetscInt(dofs.size());
  check(MatCreateSeqAIJ(PETSC_COMM_SELF, n, n, 0, counts.data(), out.out()));
  std::vector<PetscInt> columns;
  std::vector<double> values;
  for (PetscInt row = 0; row < n; ++row) {
    columns.clear(), values.clear();
    for (int k = K.first[dofs[row]]; k < K.first[dofs[row] + 1]; ++k)
      if (!is_shared[K.columns[k]]) columns.push_back(number[K.columns[k]]), values.push_back(K.values[k]);
    check(MatSetValues(out, 1, &row, PetscInt(columns.size()), columns.data(), values.data(), INSERT_VALUES));
  }
  check(MatAssemblyBegin(out, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(out, MAT_FINAL_ASSEMBLY));
  return out;
}

}  // namespace

SectorFactor::SectorFactor(Circulant<SparseBlock> const& K, int sectors, MPI_Comm comm)
    : n_(K.at(0).rows()), sectors_(sectors) {
  static const log::Event making("FwSectorFactor");
  const log::Span span(making);
  find_interface(K);
  split(K);
  together(comm, "factorising a sector", [&] {
    inner_ = std::make_unique<model::StaticFactor>(inner_matrix(inner_dofs_, number_, K.at(0), is_shared_));
  });
  if (inner_->definite()) condense(comm);
}

/// Of every coupling between sectors one side: the rows or the columns of A_k, k up to N / 2, whichever are
/// fewer.
void SectorFactor::find_interface(Circulant<SparseBlock> const& K) {
  const int n = n_, N = sectors_;
  std::vector<char> rows(n, 0), columns(n, 0);
  for (auto const& [k, A] : K)
    if (k > 0 && 2 * k <= N)
      for_entries(A, [&](int row, int column, double a) {
        if (a != 0) rows[row] = columns[column] = 1;
      });
  is_shared_ = std::ranges::count(rows, 1) < std::ranges::count(columns, 1) ? rows : columns;
  for (int dof = 0; dof < n; ++dof) {
    auto& set = is_shared_[dof] ? shared_ : inner_dofs_;
    number_.push_back(int(set.size()));
    set.push_back(dof);
  }
}

void SectorFactor::split(Circulant<SparseBlock> const& K) {
  for (auto const& [k, A] : K)
    for_entries(A, [&, k = k](int row, int column, double a) {
      if (!is_shared_[column] || a == 0) return;
      (is_shared_[row] ? B_ : P_)[k].push_back({number_[row], number_[column], a});
    });
  for (auto const& [k, entries] : P_) ahead_.push_back(k);
}

/// Columns of all P_k, one k after the other, as they stand on the right.
MatHandle SectorFactor::columns_of(int first, int count) const {
  MatHandle out;
  check(MatCreateSeqDense(PETSC_COMM_SELF, PetscInt(inner_dofs_.size()), count, nullptr, out.out()));
  check(MatZeroEntries(out));
  const DenseArray to(out);
  for (size_t i = 0; i < ahead_.size(); ++i)
    for (Entry const& e : P_.at(ahead_[i])) {
      const int column = int(i) * interface() + e.column - first;
      if (column >= 0 && column < count) to.column(column)[e.row] += e.value;
    }
  return out;
}

/// G, each rank its share of the columns. Collective.
void SectorFactor::condense(MPI_Comm comm) {
  const int b = interface(), size = b * int(ahead_.size());
  G_.assign(size_t(size) * size, 0.0);
  const auto end = [&](int rank) { return int(PetscInt64(size) * rank / comm_size(comm)); };
  const int stop = end(comm_rank(comm) + 1);
  together(comm, "condensing a sector", [&] {
    for (int first = end(comm_rank(comm)); first < stop; first += together_at_most) {
      const int count = std::min(together_at_most, stop - first);
      const MatHandle right = columns_of(first, count);
      MatHandle X;
      check(MatDuplicate(right, MAT_DO_NOT_COPY_VALUES, X.out()));
      inner_->solve(right, X);
      const DenseArray x(X);
      for (int j = 0; j < count; ++j)
        for (size_t i = 0; i < ahead_.size(); ++i)
          for (Entry const& e : P_.at(ahead_[i]))
            G_[size_t(first + j) * size + i * b + e.column] += e.value * x.column(j)[e.row];
    }
  });
  sum_over_ranks(G_, comm);
}

bool SectorFactor::take(int d) {
  if (!inner_->definite()) return false;
  if (S_.contains(d)) return true;
  const size_t b = size_t(interface()), size = b * ahead_.size();
  std::vector<complex> S(b * b);
  for (auto const& [k, entries] : B_)
    for (Entry const& e : entries) S[size_t(e.column) * b + e.row] += turned_by(k, d) * e.value;
  for (size_t l = 0; l < ahead_.size(); ++l)
    for (size_t k = 0; k < ahead_.size(); ++k) {
      const complex t = std::conj(turned_by(ahead_[k], d)) * turned_by(ahead_[l], d);
      for (size_t j = 0; j < b; ++j)
        for (size_t i = 0; i < b; ++i) S[j * b + i] -= t * G_[(l * b + j) * size + k * b + i];
    }
  const int n = interface();
  int info = 0;
  if (n > 0) zpotrf_("L", &n, S.data(), &n, &info);
  if (info == 0) S_[d] = std::move(S);
  return info == 0;
}

/// x := K_ii^-1 x of columns of inner dofs.
void SectorFactor::solve_inner(std::vector<complex>& x) const {
  const size_t n = inner_dofs_.size(), columns = n == 0 ? 0 : x.size() / n;
  const size_t most = together_at_most / 2;
  for (size_t first = 0; first < columns; first += most) {
    const size_t count = std::min(most, columns - first);
    MatHandle right, found;
    check(MatCreateSeqDense(PETSC_COMM_SELF, PetscInt(n), PetscInt(2 * count), nullptr, right.out()));
    check(MatDuplicate(right, MAT_DO_NOT_COPY_VALUES, found.out()));
    complex* at = x.data() + first * n;
    {
      const DenseArray to(right);
      for (size_t j = 0; j < count; ++j)
        for (size_t i = 0; i < n; ++i)
          to.column(PetscInt(2 * j))[i] = at[j * n + i].real(),
                                 to.column(PetscInt(2 * j + 1))[i] = at[j * n + i].imag();
    }
    inner_->solve(right, found);
    const DenseArray from(found);
    for (size_t j = 0; j < count; ++j)
      for (size_t i = 0; i < n; ++i)
        at[j * n + i] = {from.column(PetscInt(2 * j))[i], from.column(PetscInt(2 * j + 1))[i]};
  }
}

/// P_d^H x
std::vector<complex> SectorFactor::onto_shared(int d, complex const* inner) const {
  std::vector<complex> out(shared_.size());
  for (auto const& [k, entries] : P_) {
    const complex t = std::conj(turned_by(k, d));
    for (Entry const& e : entries) out[e.column] += t * e.value * inner[e.row];
  }
  return out;
}

/// inner = P_d x
void SectorFactor::from_shared(int d, complex const* x, complex* inner) const {
  for (auto const& [k, entries] : P_) {
    const complex t = turned_by(k, d);
    for (Entry const& e : entries) inner[e.row] += t * e.value * x[e.column];
  }
}

// x_b = S_d^-1 (r_b - P_d^H y), x_i = y - K_ii^-1 P_d x_b, y = K_ii^-1 r_i
void SectorFactor::solve(std::vector<int> const& diameters, complex* x) const {
  const size_t n = size_t(n_), inner = inner_dofs_.size(), b = shared_.size();
  const int N = sectors_, size = int(b);
  const size_t columns = diameters.size();
  const auto low = [&](size_t j) { return std::min(diameters[j], N - diameters[j]); };
  const auto turned = [&](size_t j, complex a) { return 2 * diameters[j] > N ? std::conj(a) : a; };
  std::vector<complex> y(columns * inner), moved(y.size()), of_shared(columns * b);
  for (size_t j = 0; j < columns; ++j)
    for (size_t i = 0; i < inner; ++i) y[j * inner + i] = turned(j, x[j * n + size_t(inner_dofs_[i])]);
  solve_inner(y);
  for (size_t j = 0; j < columns; ++j) {
    const auto taken = onto_shared(low(j), &y[j * inner]);
    for (size_t i = 0; i < b; ++i) of_shared[j * b + i] = turned(j, x[j * n + size_t(shared_[i])]) - taken[i];
  }
  for (size_t first = 0, end = 0; first < columns && b > 0; first = end) {
    while (end < columns && low(end) == low(first)) ++end;
    const int count = int(end - first);
    int info;
    zpotrs_("L", &size, &count, S_.at(low(first)).data(), &size, &of_shared[first * b], &size, &info);
  }
  for (size_t j = 0; j < columns && b > 0; ++j) from_shared(low(j), &of_shared[j * b], &moved[j * inner]);
  if (b > 0) solve_inner(moved);
  for (size_t j = 0; j < columns; ++j) {
    for (size_t i = 0; i < inner; ++i)
      x[j * n + size_t(inner_dofs_[i])] = turned(j, y[j * inner + i] - moved[j * inner + i]);
    for (size_t i = 0; i < b; ++i) x[j * n + size_t(shared_[i])] = turned(j, of_shared[j * b + i]);
  }
}

double SectorFactor::megabytes() const {
  return (inner_ ? inner_->megabytes() : 0) +
         (double(G_.size()) * sizeof(double) +
          double(S_.size()) * double(shared_.size() * shared_.size()) * sizeof(complex)) /
             1e6;
}

}  // namespace fretwave::wheel
