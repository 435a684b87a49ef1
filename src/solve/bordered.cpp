#include "solve/bordered.h"

#include <algorithm>

#include "error.h"

namespace fretwave::solve {

namespace {

constexpr PetscInt dense_limit =
    600;  // LAPACK's LU of 600 unknowns: some 5 ms; above, MUMPS and sparsity win

MatHandle coo_matrix(MPI_Comm comm, PetscInt rows, PetscInt cols, std::vector<PetscInt>& i,
                     std::vector<PetscInt>& j) {
  MatHandle A;
  check(MatCreate(comm, A.out()));
  check(MatSetSizes(A, rows, cols, PETSC_DETERMINE, PETSC_DETERMINE));
  check(MatSetType(A, MATAIJ));
  auto i_copy = i, j_copy = j;  // PETSc may reorder them
  check(MatSetPreallocationCOO(A, PetscCount(i.size()), i_copy.data(), j_copy.data()));
  return A;
}

}  // namespace

double last_entry(Vec y) {
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(y), &comm));
  const int last = comm_size(comm) - 1;
  double value = 0;
  if (comm_rank(comm) == last) value = ReadArray(y)[local_size(y) - 1];
  MPI_Bcast(&value, 1, MPI_DOUBLE, last, comm);
  return value;
}

void set_last_entry(Vec y, double value) {
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(y), &comm));
  WriteArray out(y);
  if (comm_rank(comm) == comm_size(comm) - 1) out[local_size(y) - 1] = value;
}

Bordered::Bordered(Problem& problem)
    : problem_(problem), row_(problem.unknowns()), equations_(problem.equations()) {}

void Bordered::close(Vec row, double value) {
  check(VecCopy(row, row_));
  value_ = value;
}

void Bordered::residual(Vec y, Vec g) {
  problem_.residual(y, equations_);
  double along;
  check(VecDot(row_, y, &along));
  WriteArray out(g);
  ReadArray in(equations_);
  std::copy_n(in.data(), problem_.local_equations(), out.data());
  if (problem_.last_rank()) out[problem_.local_equations()] = along - value_;
}

void Bordered::product(Vec y, Vec dy, Vec dg) {
  problem_.product(y, dy, equations_);
  double along;
  check(VecDot(row_, dy, &along));
  WriteArray out(dg);
  ReadArray in(equations_);
  std::copy_n(in.data(), problem_.local_equations(), out.data());
  if (problem_.last_rank()) out[problem_.local_equations()] = along;
}

void Problem::transposed_product(Vec, Vec, Vec) {
  throw InputError("the Jacobian of this problem has no transpose", "a transposed product",
                   "a harmonic balance, or the direct route", "take a KSP that needs none, as fgmres");
}

/// [J; row^T]^T (dr, d) = J^T dr + d row.
void Bordered::transposed_product(Vec y, Vec dg, Vec dy) {
  double last = 0;
  {
    const ReadArray in(dg);
    std::copy_n(in.data(), problem_.local_equations(), WriteArray(equations_).data());
    last = last_entry(dg);
  }
  problem_.transposed_product(y, equations_, dy);
  check(VecAXPY(dy, last, row_));
}

MatHandle Bordered::matrix() {
  rows_.clear(), cols_.clear();
  problem_.pattern(rows_, cols_);
  problem_entries_ = PetscInt(rows_.size());
  PetscInt begin, end;
  check(VecGetOwnershipRange(row_, &begin, &end));
  const PetscInt global = global_size(row_);
  for (PetscInt k = begin; k < end; ++k) rows_.push_back(global - 1), cols_.push_back(k);
  v_.resize(rows_.size());
  dense_ = comm_size(problem_.comm()) == 1 && global <= dense_limit;
  if (!dense_) return coo_matrix(problem_.comm(), end - begin, end - begin, rows_, cols_);
  MatHandle A;
  check(MatCreateSeqDense(problem_.comm(), global, global, nullptr, A.out()));
  return A;
}

void Bordered::assemble(Vec y, Mat J) {
  problem_.values(y, std::span(v_).first(problem_entries_));
  {
    ReadArray row(row_);
    std::copy(row.span().begin(), row.span().end(), v_.begin() + problem_entries_);
  }
  if (!dense_) {
    check(MatSetValuesCOO(J, v_.data(), INSERT_VALUES));
    return;
  }
  double* a;
  PetscInt ld;
  check(MatZeroEntries(J));
  check(MatDenseGetLDA(J, &ld));
  check(MatDenseGetArray(J, &a));
  for (size_t k = 0; k < v_.size(); ++k) a[size_t(cols_[k]) * ld + rows_[k]] += v_[k];
  check(MatDenseRestoreArray(J, &a));
  check(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
}

namespace {

void fill(Problem& problem, Vec y, size_t entries, Mat J) {
  std::vector<double> v(entries);
  problem.values(y, v);
  check(MatSetValuesCOO(J, v.data(), INSERT_VALUES));
}

}  // namespace

MatHandle assemble(Problem& problem, Vec y) {
  std::vector<PetscInt> rows, cols;
  problem.pattern(rows, cols);
  MatHandle J = coo_matrix(problem.comm(), problem.local_equations(), local_size(y), rows, cols);
  fill(problem, y, rows.size(), J);
  return J;
}

void assemble(Problem& problem, Vec y, Mat J) {
  std::vector<PetscInt> rows, cols;
  problem.pattern(rows, cols);
  fill(problem, y, rows.size(), J);
}

}  // namespace fretwave::solve
