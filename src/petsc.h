#pragma once
#include <petscsnes.h>

#include <algorithm>
#include <complex>
#include <limits>
#include <numeric>
#include <source_location>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "error.h"

namespace fretwave {

/// A PETSc, SLEPc or MUMPS call failed: its own text, and the line of ours that made the call.
struct PetscFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What an error number means, and what was said where it arose: of `PetscErrorMessage`, whose third argument
/// became one to constants.
template <class Char>
std::string words_of(PetscErrorCode (*message)(PetscErrorCode, char const**, Char**), PetscErrorCode code) {
  char const* meaning = nullptr;
  Char* said = nullptr;
  (void)message(code, &meaning, &said);
  return (meaning ? std::string(": ") + meaning : "") + (said && *said ? std::string(": ") + said : "");
}

inline void check(PetscErrorCode code, std::source_location where = std::source_location::current()) {
  if (code) [[unlikely]]
    throw PetscFailure("PETSc error " + std::to_string(int(code)) + " (called from " + where.file_name() +
                       ":" + std::to_string(where.line()) + ")" + words_of(PetscErrorMessage, code));
}

/// Move-only owner of one PETSc reference; converts to the raw handle, mirrors nothing of PETSc.
template <class T, auto Destroy>
class Handle {
 public:
  Handle() = default;
  Handle(Handle&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }
  ~Handle() { reset(); }
  /// Take one more reference to an object somebody else owns.
  static Handle share(T object) {
    Handle handle;
    if (object) check(PetscObjectReference(reinterpret_cast<PetscObject>(object)));
    handle.object_ = object;
    return handle;
  }
  void reset() {
    PetscBool finalized = PETSC_FALSE;
    (void)PetscFinalized(&finalized);
    if (object_ && !finalized) (void)Destroy(&object_);
    object_ = nullptr;
  }
  /// Address for PETSc's creating functions; frees what was held.
  T* out() {
    reset();
    return &object_;
  }
  operator T() const { return object_; }

 private:
  T object_ = nullptr;
};

using VecHandle = Handle<Vec, VecDestroy>;
using MatHandle = Handle<Mat, MatDestroy>;
using KspHandle = Handle<KSP, KSPDestroy>;
using SnesHandle = Handle<SNES, SNESDestroy>;
using ScatterHandle = Handle<VecScatter, VecScatterDestroy>;
using IsHandle = Handle<IS, ISDestroy>;

inline PetscInt global_size(Vec v) {
  PetscInt n;
  check(VecGetSize(v, &n));
  return n;
}

inline PetscInt local_size(Vec v) {
  PetscInt n;
  check(VecGetLocalSize(v, &n));
  return n;
}

/// This rank's entries of a vector, for the guard's lifetime.
class ReadArray {
 public:
  explicit ReadArray(Vec v) : v_(v) { check(VecGetArrayRead(v, &data_)); }
  ~ReadArray() { (void)VecRestoreArrayRead(v_, &data_); }
  ReadArray(ReadArray const&) = delete;
  double const* data() const { return data_; }
  double operator[](PetscInt i) const { return data_[i]; }
  std::span<double const> span() const { return {data_, size_t(local_size(v_))}; }

 private:
  Vec v_;
  double const* data_ = nullptr;
};

class WriteArray {
 public:
  explicit WriteArray(Vec v) : v_(v) { check(VecGetArray(v, &data_)); }
  ~WriteArray() { (void)VecRestoreArray(v_, &data_); }
  WriteArray(WriteArray const&) = delete;
  double* data() const { return data_; }
  double& operator[](PetscInt i) const { return data_[i]; }
  std::span<double> span() const { return {data_, size_t(local_size(v_))}; }

 private:
  Vec v_;
  double* data_ = nullptr;
};

/// This rank's rows of a dense matrix, column by column, for the guard's lifetime.
class DenseArray {
 public:
  explicit DenseArray(Mat A) : A_(A) {
    check(MatDenseGetLDA(A, &lead_));
    check(MatDenseGetArray(A, &data_));
  }
  ~DenseArray() { (void)MatDenseRestoreArray(A_, &data_); }
  DenseArray(DenseArray const&) = delete;
  double* column(PetscInt j) const { return data_ + size_t(j) * size_t(lead_); }

 private:
  Mat A_;
  double* data_ = nullptr;
  PetscInt lead_ = 0;
};

inline VecHandle make_vector(MPI_Comm comm, PetscInt local) {
  VecHandle v;
  check(VecCreateMPI(comm, local, PETSC_DECIDE, v.out()));
  return v;
}

inline VecHandle like(Vec v) {
  VecHandle w;
  check(VecDuplicate(v, w.out()));
  return w;
}

inline int comm_rank(MPI_Comm comm) {
  int rank;
  MPI_Comm_rank(comm, &rank);
  return rank;
}

inline int comm_size(MPI_Comm comm) {
  int size;
  MPI_Comm_size(comm, &size);
  return size;
}

/// visit(row, col, value) for the entries of this rank's rows.
template <class Visit>
void for_entries(Mat A, Visit visit) {
  PetscInt begin, end;
  check(MatGetOwnershipRange(A, &begin, &end));
  for (PetscInt row = begin; row < end; ++row) {
    PetscInt count;
    PetscInt const* cols;
    PetscScalar const* values;
    check(MatGetRow(A, row, &count, &cols, &values));
    for (PetscInt k = 0; k < count; ++k) visit(row, cols[k], values[k]);
    check(MatRestoreRow(A, row, &count, &cols, &values));
  }
}

struct MatEntry {
  PetscInt row, col;
  double value;
};

/// The entries of this rank's rows.
inline std::vector<MatEntry> entries(Mat A) {
  std::vector<MatEntry> out;
  for_entries(A, [&](PetscInt row, PetscInt col, double value) { out.push_back({row, col, value}); });
  return out;
}

/// A count as MPI, BLAS and MUMPS take it; `InputError` where it is beyond them. What all ranks count alike
/// is refused by all.
inline int as_int(PetscInt64 count, char const* what) {
  if (count < 0 || count > std::numeric_limits<int>::max())
    throw InputError(std::string(what) + ": too many for the 32-bit counts of MPI and BLAS",
                     std::to_string(count), "at most " + std::to_string(std::numeric_limits<int>::max()),
                     "reduce the model, or retain fewer harmonics");
  return int(count);
}

/// All ranks' items in rank order, on every rank. Collective.
template <class T>
std::vector<T> gathered(std::span<T const> mine, MPI_Comm comm) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (comm_size(comm) == 1) return {mine.begin(), mine.end()};
  std::vector<PetscInt64> sizes(comm_size(comm));
  const PetscInt64 own = PetscInt64(mine.size());
  MPI_Allgather(&own, 1, MPIU_INT64, sizes.data(), 1, MPIU_INT64, comm);
  const int total =
      as_int(std::accumulate(sizes.begin(), sizes.end(), PetscInt64(0)), "numbers gathered from all ranks");
  std::vector<int> counts(sizes.begin(), sizes.end()), starts(sizes.size(), 0);
  std::exclusive_scan(counts.begin(), counts.end(), starts.begin(), 0);
  std::vector<T> all(static_cast<size_t>(total));
  MPI_Datatype item;
  MPI_Type_contiguous(int(sizeof(T)), MPI_BYTE, &item);
  MPI_Type_commit(&item);
  MPI_Allgatherv(mine.data(), int(own), item, all.data(), counts.data(), starts.data(), item, comm);
  MPI_Type_free(&item);
  return all;
}

/// Sums over the ranks in place, in pieces that MPI's counts hold. Collective.
inline void sum_over_ranks(std::span<double> x, MPI_Comm comm) {
  constexpr size_t piece = size_t(1) << 30;
  if (comm_size(comm) == 1) return;
  for (size_t first = 0; first < x.size(); first += piece) {
    const auto part = x.subspan(first, std::min(piece, x.size() - first));
    MPI_Allreduce(MPI_IN_PLACE, part.data(), int(part.size()), MPI_DOUBLE, MPI_SUM, comm);
  }
}
inline void sum_over_ranks(std::span<std::complex<double>> x, MPI_Comm comm) {
  sum_over_ranks(std::span(reinterpret_cast<double*>(x.data()), 2 * x.size()), comm);
}

/// One rank's on all of them, in pieces that MPI's counts hold. Collective.
template <class T>
void broadcast(std::vector<T>& x, int from, MPI_Comm comm) {
  constexpr size_t piece = size_t(1) << 30;
  unsigned long long size = x.size();
  MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, from, comm);
  x.resize(size);
  const auto bytes = std::as_writable_bytes(std::span(x));
  for (size_t first = 0; first < bytes.size(); first += piece)
    MPI_Bcast(&bytes[first], int(std::min(piece, bytes.size() - first)), MPI_BYTE, from, comm);
}

/// A distributed matrix whole and dense (column-major) on every rank. Collective.
inline std::vector<double> whole(Mat A) {
  MPI_Comm comm;
  PetscInt n;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatGetSize(A, &n, nullptr));
  as_int(PetscInt64(n) * n, "entries of a dense block");
  std::vector<double> dense(size_t(n) * n, 0.0);
  for_entries(A, [&](PetscInt row, PetscInt col, double value) { dense[size_t(col) * n + row] = value; });
  sum_over_ranks(dense, comm);
  return dense;
}

/// A vector whole on every rank. Collective.
inline std::vector<double> gathered(Vec x) {
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(x), &comm));
  return gathered(ReadArray(x).span(), comm);
}

}  // namespace fretwave
