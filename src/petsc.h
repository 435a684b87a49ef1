#pragma once
#include <petscsnes.h>

#include <source_location>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace fretwave {

/// A PETSc, SLEPc or MUMPS call failed: its own text, and the line of ours that made the call.
struct PetscFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline void check(PetscErrorCode code, std::source_location where = std::source_location::current()) {
  if (code) [[unlikely]] {
    const char* text = nullptr;
    (void)PetscErrorMessage(code, &text, nullptr);
    throw PetscFailure(std::string("PETSc error ") + std::to_string(int(code)) +
                       (text ? std::string(": ") + text : "") + " (called from " + where.file_name() + ":" +
                       std::to_string(where.line()) + ")");
  }
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

/// All ranks' items in rank order, on every rank. Collective.
template <class T>
std::vector<T> gathered(std::span<T const> mine, MPI_Comm comm) {
  static_assert(std::is_trivially_copyable_v<T>);
  const int ranks = comm_size(comm), bytes = int(mine.size_bytes());
  std::vector<int> counts(ranks), starts(ranks, 0);
  MPI_Allgather(&bytes, 1, MPI_INT, counts.data(), 1, MPI_INT, comm);
  for (int r = 1; r < ranks; ++r) starts[r] = starts[r - 1] + counts[r - 1];
  std::vector<T> all(size_t(starts.back() + counts.back()) / sizeof(T));
  MPI_Allgatherv(mine.data(), bytes, MPI_BYTE, all.data(), counts.data(), starts.data(), MPI_BYTE, comm);
  return all;
}

/// A vector whole on every rank. Collective.
inline std::vector<double> gathered(Vec x) {
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(x), &comm));
  return gathered(ReadArray(x).span(), comm);
}

}  // namespace fretwave
