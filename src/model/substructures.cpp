#include "model/substructures.h"

#include <dmumps_c.h>

#include "lapack.h"
#include "model/inertia.h"
#include "mumps.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::model {

namespace {

const Tuned share_between("static_between", 0.1,
                          "share of dofs between ranks, up to which a static factor is one of substructures");

/// Dofs that those of later ranks are coupled to, of all ranks, ascending. Collective.
std::vector<PetscInt> dofs_between(Mat K, MPI_Comm comm) {
  PetscInt end;
  std::vector<PetscInt> mine;
  check(MatGetOwnershipRange(K, nullptr, &end));
  for_entries(K, [&](PetscInt row, PetscInt column, double a) {
    if (column >= end && a != 0 && (mine.empty() || mine.back() != row)) mine.push_back(row);
  });
  return gathered(std::span<PetscInt const>(mine), comm);
}

/// L L^T, in place of the lower triangle, of what is left of entries on a diagonal; false if that is not
/// positive definite.
bool is_factorised(std::vector<double>& S, std::vector<double> const& diagonal) {
  const int n = int(diagonal.size());
  int info = 0;
  dpotrf_("L", &n, S.data(), &n, &info);
  for (int i = 0; i < n && info == 0; ++i)
    if (!(std::pow(S[size_t(i) * n + i], 2) > null_pivot * diagonal[i])) return false;
  return info == 0;
}

/// Where dofs stand in an ascending list, -1 where they do not.
int place(std::vector<PetscInt> const& list, PetscInt dof) {
  const auto at = std::ranges::lower_bound(list, dof);
  return at != list.end() && *at == dof ? int(at - list.begin()) : -1;
}

}  // namespace

/// Of the inner dofs, with those touched behind them, whose complement MUMPS makes.
struct Substructures::Inner : Mumps<DMUMPS_STRUC_C, dmumps_c> {
  std::vector<int> inner;    ///< this rank's dofs that are not between
  std::vector<int> touched;  ///< places of those between that they are coupled to
  std::vector<int> rows, columns, behind;
  std::vector<double> values, complement, right, reduced;

  Inner() : Mumps(PETSC_COMM_SELF, true) {
    icntl(13) = 1;  // no ScaLAPACK root, or its pivots are not counted
    icntl(24) = 1;  // null pivots are counted
    id.cntl[2] = null_pivot;
    take_options("static_");
  }
  bool definite() const { return id.infog[11] == 0 && id.infog[27] == 0; }

  /// An entry of the lower triangle; touched dofs stand behind all inner ones.
  void add(int row, int column, double a) {
    rows.push_back(row + 1), columns.push_back(column + 1), values.push_back(a);
  }
  /// Leaves the dofs' part of S in `complement`, lower triangle, row by row.
  void factorise() {
    const size_t n = touched.size();
    id.n = int(inner.size() + n);
    id.nnz_loc = MUMPS_INT8(rows.size());
    id.irn_loc = rows.data(), id.jcn_loc = columns.data(), id.a_loc = values.data();
    behind.resize(n), complement.resize(n * n);
    std::iota(behind.begin(), behind.end(), int(inner.size()) + 1);
    icntl(19) = n > 0;
    id.size_schur = int(n), id.listvar_schur = behind.data(), id.schur = complement.data();
    run(analyse);
    need("analyse a substructure");
    run_factorise();
    need("factorise a substructure");
    rows = {}, columns = {}, values = {};
  }
  /// What forces x on inner dofs leave on those between; `move` goes on from there.
  void reduce(double const* x, size_t c, std::vector<double>& between) {
    const size_t n = inner.size() + touched.size();
    right.assign(n * c, 0.0);
    reduced.assign(touched.size() * c, 0.0);
    for (size_t k = 0; k < c; ++k)
      for (size_t i = 0; i < inner.size(); ++i) right[k * n + i] = x[inner[i] * c + k];
    id.rhs = right.data(), id.nrhs = int(c), id.lrhs = int(n);
    id.redrhs = reduced.data(), id.lredrhs = int(touched.size());
    solve_phase(touched.empty() ? 0 : 1);
    for (size_t k = 0; k < c; ++k)
      for (size_t i = 0; i < touched.size(); ++i)
        between[touched[i] * c + k] += reduced[k * touched.size() + i];
  }
  /// Of inner dofs, with the motion of those between.
  void move(std::vector<double> const& between, size_t c, double* y) {
    const size_t n = inner.size() + touched.size();
    for (size_t k = 0; k < c; ++k)
      for (size_t i = 0; i < touched.size(); ++i)
        reduced[k * touched.size() + i] = between[touched[i] * c + k];
    if (!touched.empty()) solve_phase(2);
    for (size_t k = 0; k < c; ++k)
      for (size_t i = 0; i < inner.size(); ++i) y[inner[i] * c + k] = right[k * n + i];
  }
  /// 1: on to the dofs behind, 2: back from them, 0: both, where there are none.
  void solve_phase(int phase) {
    icntl(26) = phase;
    run(solve);
    need("solve with a substructure");
  }
};

Substructures::~Substructures() = default;

std::unique_ptr<Substructures> Substructures::of(Mat K, double megabytes) {
  MPI_Comm comm;
  PetscInt dofs;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(K), &comm));
  check(MatGetSize(K, &dofs, nullptr));
  if (comm_size(comm) == 1) return nullptr;
  Partition partition(K);
  auto between = dofs_between(partition.matrix(), comm);
  const double of_all = 8e-6 * std::pow(double(between.size()), 2) * comm_size(comm);
  if (double(between.size()) > share_between * dofs || of_all > megabytes) return nullptr;
  return std::unique_ptr<Substructures>(new Substructures(std::move(partition), std::move(between)));
}

Substructures::Substructures(Partition partition, std::vector<PetscInt> between)
    : partition_(std::move(partition)), between_(std::move(between)) {
  const Mat K = partition_.matrix();
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(K), &comm_));
  check(MatGetOwnershipRange(K, &begin_, &end_));
  split(K);
  invert(condensed(K), diagonal_between(K));
  measure();
  partition_.release_matrix();
}

/// This rank's inner dofs; the number of each dof among them, -1 where it is between.
std::vector<int> Substructures::number_inner() {
  std::vector<int> number(end_ - begin_, -1);
  auto& inner = factor_->inner;
  for (int dof = 0; dof < int(end_ - begin_); ++dof)
    if (const int there = place(between_, begin_ + dof); there >= 0)
      own_between_.push_back({dof, there});
    else
      number[dof] = int(inner.size()), inner.push_back(dof);
  return number;
}

/// Gives the factor this rank's inner dofs, and what they are coupled to.
void Substructures::split(Mat K) {
  factor_ = std::make_unique<Inner>();
  const auto number = number_inner();
  auto &inner = factor_->inner, &touched = factor_->touched;
  std::vector<int> behind(between_.size(), -1);
  for_entries(K, [&](PetscInt row, PetscInt column, double a) {
    const int i = number[row - begin_];
    if (i < 0 || a == 0) return;
    if (column >= begin_ && column < end_ && number[column - begin_] >= 0) {
      if (column <= row) factor_->add(i, number[column - begin_], a);
      return;
    }
    const int there = place(between_, column);
    if (there < 0) return;  // there and not back: rounding of a symmetric matrix
    if (behind[there] < 0) behind[there] = int(touched.size()), touched.push_back(there);
    factor_->add(int(inner.size()) + behind[there], i, a);
  });
  if (inner.empty()) factor_ = nullptr;
}

std::vector<double> Substructures::diagonal_between(Mat K) const {
  std::vector<double> diagonal(between_.size());
  for_entries(K, [&](PetscInt row, PetscInt column, double a) {
    if (const int i = row == column ? place(between_, row) : -1; i >= 0) diagonal[i] = a;
  });
  sum_over_ranks(diagonal, comm_);
  return diagonal;
}

/// S, of both triangles the lower one. Collective.
std::vector<double> Substructures::condensed(Mat K) const {
  const size_t b = between_.size();
  std::vector<double> S;
  together(comm_, "factorising a substructure", [&] {
    S.resize(b * b);
    for_entries(K, [&](PetscInt row, PetscInt column, double a) {
      const int i = place(between_, row), j = i < 0 ? -1 : place(between_, column);
      if (j >= 0) S[size_t(j) * b + i] += a;
    });
    if (!factor_) return;
    factor_->factorise();
    auto const& touched = factor_->touched;
    for (size_t i = 0; i < touched.size(); ++i)
      for (size_t j = 0; j <= i; ++j) {
        const auto [first, last] = std::minmax(touched[i], touched[j]);
        S[size_t(first) * b + last] += factor_->complement[i * touched.size() + j];
      }
    factor_->complement = {};
  });
  sum_over_ranks(S, comm_);
  return S;
}

/// S^-1, this rank's share of it, unless K is not positive definite. Collective.
void Substructures::invert(std::vector<double> S, std::vector<double> const& diagonal) {
  const int b = int(between_.size()), rank = comm_rank(comm_), ranks = comm_size(comm_);
  for (int r = 0; r <= ranks; ++r) first_.push_back(int(PetscInt64(b) * r / ranks));
  int definite = (!factor_ || factor_->definite()) && (b == 0 || is_factorised(S, diagonal)), info = 0;
  MPI_Allreduce(MPI_IN_PLACE, &definite, 1, MPI_INT, MPI_MIN, comm_);
  definite_ = definite;
  if (!definite_ || b == 0) return;
  together(comm_, "inverting what joins substructures", [&] {
    dpotri_("L", &b, S.data(), &b, &info);
    lapack::mirror("L", b, S.data());
    const auto row = [&](int i) { return S.begin() + std::ptrdiff_t(i) * b; };
    inverse_.assign(row(first_[rank]), row(first_[rank + 1]));
  });
}

void Substructures::measure() {
  std::vector<double> size{8e-6 * double(inverse_.size()), double(inverse_.size())};
  if (factor_) size[0] += factor_->megabytes(), size[1] += factor_->entries();
  sum_over_ranks(size, comm_);
  megabytes_ = size[0], entries_ = size[1];
}

/// Coefficients, innermost, of forces on the dofs between, which they move. Collective.
void Substructures::move_between(std::vector<double>& x, int coefficients) const {
  const int rank = comm_rank(comm_), b = int(between_.size()), c = coefficients;
  const int rows = first_[rank + 1] - first_[rank];
  sum_over_ranks(x, comm_);
  std::vector<double> own(size_t(c) * rows);
  lapack::multiply("NN", {c, rows, b}, 1.0, {x.data(), c}, {inverse_.data(), b}, 0.0, own.data(), c);
  x = gathered(std::span<double const>(own), comm_);
}

void Substructures::solve(double const* x, int coefficients, double* y) const {
  const size_t c = size_t(coefficients);
  std::vector<double> part(size_t(end_ - begin_) * c);
  partition_.take(x, coefficients, part.data());
  std::vector<double> between(c * between_.size());
  for (auto [dof, there] : own_between_) std::copy_n(&part[dof * c], c, &between[there * c]);
  together(comm_, "solving with a substructure", [&] {
    if (factor_) factor_->reduce(part.data(), c, between);
  });
  move_between(between, coefficients);
  for (auto [dof, there] : own_between_) std::copy_n(&between[there * c], c, &part[dof * c]);
  together(comm_, "solving with a substructure", [&] {
    if (factor_) factor_->move(between, c, part.data());
  });
  partition_.give(part.data(), coefficients, y);
}

}  // namespace fretwave::model
