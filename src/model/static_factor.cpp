#include "model/static_factor.h"

#include "model/inertia.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::model {

namespace {

const Tuned held("static_held", 1000,
                 "megabytes of what all ranks hold of a static factor each, all copies, at the most");

/// Column-major sight of coefficients that lie innermost, or back.
void transpose(double const* in, PetscInt rows, int columns, double* out) {
  for (PetscInt i = 0; i < rows; ++i)
    for (int k = 0; k < columns; ++k) out[size_t(k) * rows + i] = in[size_t(i) * columns + k];
}

/// Coefficients, innermost, of this rank's rows into the columns of a dense matrix, and out of them.
void put_columns(double const* x, PetscInt rows, int columns, Mat A) {
  const DenseArray to(A);
  for (PetscInt i = 0; i < rows; ++i)
    for (int k = 0; k < columns; ++k) to.column(k)[i] = x[size_t(i) * columns + k];
}

void take_columns(Mat A, PetscInt rows, int columns, double* x) {
  const DenseArray from(A);
  for (PetscInt i = 0; i < rows; ++i)
    for (int k = 0; k < columns; ++k) x[size_t(i) * columns + k] = from.column(k)[i];
}

void solve_by_parts(Substructures const& parts, Mat B, Mat X, PetscInt local) {
  PetscInt columns;
  check(MatGetSize(B, nullptr, &columns));
  std::vector<double> x(size_t(local) * columns);
  take_columns(B, local, int(columns), x.data());
  parts.solve(x.data(), int(columns), x.data());
  put_columns(x.data(), local, int(columns), X);
}

}  // namespace

MatHandle dense_columns(Mat like, PetscInt columns) {
  MatHandle out;
  MPI_Comm comm;
  PetscInt rows, local;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(like), &comm));
  check(MatGetSize(like, &rows, nullptr));
  check(MatGetLocalSize(like, &local, nullptr));
  check(MatCreateDense(comm, local, PETSC_DECIDE, rows, columns, nullptr, out.out()));
  check(MatAssemblyBegin(out, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(out, MAT_FINAL_ASSEMBLY));
  return out;
}

StaticFactor::StaticFactor(Mat K) : K_(MatHandle::share(K)), parts_(Substructures::of(K, held)) {
  check(MatGetLocalSize(K_, &local_, nullptr));
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(K), &comm_));
  parts_ ? take_parts() : take_whole();
}

void StaticFactor::take_whole() {
  ksp_ = symmetric_factor(K_, "static_");
  definite_ = negative_pivots(ksp_) == 0 && null_pivots(ksp_) == 0;
  megabytes_ = factor_megabytes(ksp_), entries_ = factor_entries(ksp_);
  if (definite_) hold_whole();
}

void StaticFactor::take_parts() {
  PC pc;
  of_parts_.parts = parts_.get();
  definite_ = parts_->definite(), megabytes_ = parts_->megabytes(), entries_ = parts_->entries();
  check(KSPCreate(comm_, ksp_.out()));
  check(KSPSetOptionsPrefix(ksp_, "static_parts_"));  // SLEPc sets it from options
  check(KSPSetOperators(ksp_, K_, K_));
  check(KSPSetType(ksp_, KSPPREONLY));
  check(KSPGetPC(ksp_, &pc));
  check(PCSetType(pc, PCSHELL));
  check(PCShellSetContext(pc, &of_parts_));
  check(PCShellSetApply(pc, solve_parts));
}

PetscErrorCode StaticFactor::solve_parts(PC pc, Vec x, Vec y) {
  void* context;
  PetscCall(PCShellGetContext(pc, &context));
  auto& [parts, guard] = *static_cast<OfParts*>(context);
  return guard.run([&] {
    const ReadArray in(x);
    const WriteArray out(y);
    parts->solve(in.data(), 1, out.data());
  });
}

std::string StaticFactor::divided() const {
  if (!parts_) return "";
  return " in " + std::to_string(comm_size(comm_)) + " parts and " + std::to_string(parts_->between()) +
         " dofs between";
}

void StaticFactor::hold_whole() {
  PetscInt const* ranges;
  const int size = comm_size(comm_);
  if (size == 1 || size * megabytes_ > held) return;
  check(MatGetOwnershipRanges(K_, &ranges));
  first_.assign(ranges, ranges + size + 1);
  check(MatCreateRedundantMatrix(K_, size, PETSC_COMM_SELF, MAT_INITIAL_MATRIX, whole_K_.out()));
  together(comm_, "factorising the stiffness", [&] { whole_ = symmetric_factor(whole_K_, "static_"); });
  megabytes_ += size * factor_megabytes(whole_);
}

void StaticFactor::solve(Mat B, Mat X) const {
  if (parts_) return solve_by_parts(*parts_, B, X, local_);
  check(KSPMatSolve(ksp_, B, X));
  expect_factorised(ksp_);
}

/// Each rank solves for its share of the columns, of all dofs. Collective.
void StaticFactor::solve_share(double const* x, int coefficients, double* y) const {
  const int size = comm_size(comm_), rank = comm_rank(comm_);
  const auto columns = [&](int r) { return coefficients * (r + 1) / size - coefficients * r / size; };
  const int mine = columns(rank);
  std::vector<int> sent(size), received(size), from(size, 0), to(size, 0);
  for (int r = 0; r < size; ++r) {
    sent[r] = as_int(PetscInt64(local_) * columns(r), "a rank's columns");
    received[r] = as_int(PetscInt64(first_[r + 1] - first_[r]) * mine, "a rank's columns");
  }
  std::exclusive_scan(sent.begin(), sent.end(), from.begin(), 0);
  std::exclusive_scan(received.begin(), received.end(), to.begin(), 0);
  std::vector<double> own(size_t(local_) * coefficients), share(size_t(first_.back()) * mine);
  transpose(x, local_, coefficients, own.data());
  MPI_Alltoallv(own.data(), sent.data(), from.data(), MPI_DOUBLE, share.data(), received.data(), to.data(),
                MPI_DOUBLE, comm_);
  together(comm_, "solving with the stiffness", [&] {
    if (mine > 0) solve_whole(share, to, mine);
  });
  MPI_Alltoallv(share.data(), received.data(), to.data(), MPI_DOUBLE, own.data(), sent.data(), from.data(),
                MPI_DOUBLE, comm_);
  transpose(own.data(), coefficients, int(local_), y);
}

/// Some columns, those of one rank's dofs after those of another, from `first` on.
void StaticFactor::solve_whole(std::vector<double>& parts, std::vector<int> const& first, int columns) const {
  const MatHandle B = dense_columns(whole_K_, columns), X = dense_columns(whole_K_, columns);
  const auto with_each = [&](Mat A, auto copy) {
    PetscInt lead;
    double* entries;
    check(MatDenseGetLDA(A, &lead));
    check(MatDenseGetArray(A, &entries));
    for (size_t r = 0; r < first.size(); ++r) {
      const PetscInt rows = first_[r + 1] - first_[r];
      for (int k = 0; k < columns; ++k)
        copy(parts.data() + first[r] + size_t(k) * rows, rows, entries + size_t(k) * lead + first_[r]);
    }
    check(MatDenseRestoreArray(A, &entries));
  };
  with_each(B, [](double* part, PetscInt rows, double* whole) { std::copy_n(part, rows, whole); });
  check(KSPMatSolve(whole_, B, X));
  expect_factorised(whole_);
  with_each(X, [](double* part, PetscInt rows, double* whole) { std::copy_n(whole, rows, part); });
}

void StaticFactor::solve(double const* x, int coefficients, double* y) const {
  if (parts_) return parts_->solve(x, coefficients, y);
  if (whole_) return solve_share(x, coefficients, y);
  const MatHandle B = dense_columns(K_, coefficients), X = dense_columns(K_, coefficients);
  put_columns(x, local_, coefficients, B);
  solve(B, X);
  take_columns(X, local_, coefficients, y);
}

}  // namespace fretwave::model
