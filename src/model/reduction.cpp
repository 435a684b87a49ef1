#include "model/reduction.h"

#include <algorithm>
#include <utility>

#include "blocked_product.h"
#include "lapack.h"
#include "model/reduction_input.h"

namespace fretwave::model {

/// Columns at a time: bounds the memory beside T, which a product packs anew for each panel.
PetscInt Reduction::panel_of(PetscInt columns) { return std::clamp<PetscInt>(columns / 8, 64, 512); }

namespace {

constexpr PetscInt side_by_side = BlockedProduct::most;  // columns of a sparse product

/// visit(i, j) for all, in tiles that a cache holds by rows and by columns.
template <class Visit>
void for_tiles(PetscInt rows, PetscInt columns, Visit visit) {
  constexpr PetscInt side = 64;
  for (PetscInt begin = 0; begin < rows; begin += side)
    for (PetscInt j = 0; j < columns; ++j)
      for (PetscInt i = begin; i < std::min(begin + side, rows); ++i) visit(i, j);
}

/// This rank's dofs that are not kept.
std::vector<PetscInt> internal_dofs(std::vector<PetscInt> kept, PetscInt first, PetscInt local) {
  std::sort(kept.begin(), kept.end());
  std::vector<PetscInt> internal;
  for (PetscInt dof = first; dof < first + local; ++dof)
    if (!std::binary_search(kept.begin(), kept.end(), dof)) internal.push_back(dof);
  return internal;
}

/// What the theory says of the modal columns beside the kept dofs' K: no stiffness coupling, diag(omega^2),
/// unit modal mass; rounding removed.
std::vector<double> with_modal_block(std::vector<double> const& K, std::vector<double>& M,
                                     std::vector<double> const& omega, size_t kept) {
  const size_t n = kept + omega.size();
  std::vector<double> out(n * n, 0.0);
  for (size_t j = 0; j < kept; ++j) std::copy_n(&K[j * kept], kept, &out[j * n]);
  for (size_t j = kept; j < n; ++j) {
    out[j + j * n] = omega[j - kept] * omega[j - kept];
    for (size_t i = kept; i < n; ++i) M[i + j * n] = i == j;
  }
  return out;
}

}  // namespace

Reduction::Reduction(Mat K, Mat M, Mat C, std::vector<PetscInt> kept, ComponentModes wanted)
    : kept_(std::move(kept)) {
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(K), &comm_));
  check(MatGetSize(K, &global_, nullptr));
  check(MatGetLocalSize(K, &local_, nullptr));
  check(MatGetOwnershipRange(K, &first_, nullptr));
  check_reduction_input(K, M, C, kept_, wanted);

  double clock = MPI_Wtime();
  const auto lap = [&clock] { return MPI_Wtime() - std::exchange(clock, MPI_Wtime()); };
  internal_ = internal_dofs(kept_, first_, local_);
  IsHandle set;
  check(ISCreateGeneral(comm_, PetscInt(internal_.size()), internal_.data(), PETSC_COPY_VALUES, set.out()));
  FixedInterface component(K, M, set);
  times_.factorisation = lap();
  // the eigensolver takes over the factorisation and frees it at its end: constraint modes come first
  T_.reserve(size_t(local_) * (kept_.size() + size_t(wanted.count + ComponentModes::beyond(wanted.count))));
  const auto of_kept = place_constraint_modes(K, component);
  times_.constraint_modes = lap();
  const auto modes = component.modes(wanted);
  place_component_modes(modes);
  times_.component_modes = lap();
  M_ = congruence(M, true);
  if (C) C_ = congruence(C, false);
  K_ = with_modal_block(of_kept, M_, component_omega_, kept_.size());
  omit(PetscInt(modes.size()) - wanted.count);
  times_.projection = lap();
}

namespace {

/// Rows `begin` .. `end` of the first `columns` of a matrix, row by row, or its columns of the first rows.
std::vector<double> strip(std::vector<double> const& A, size_t n, size_t begin, size_t end, size_t columns,
                          bool transposed) {
  std::vector<double> out;
  for (size_t i = begin; i < end; ++i)
    for (size_t j = 0; j < columns; ++j) out.push_back(transposed ? A[j + i * n] : A[i + j * n]);
  return out;
}

/// The first rows and columns.
void crop(std::vector<double>& A, size_t n, size_t size) {
  if (A.empty()) return;
  for (size_t j = 0; j < size; ++j)
    std::copy_n(A.begin() + ptrdiff_t(j * n), size, A.begin() + ptrdiff_t(j * size));
  A.resize(size * size);
}

}  // namespace

/// The last modes are no coordinates; what couples them to these stays.
void Reduction::omit(PetscInt modes) {
  const size_t n = size_t(size()), kept = n - size_t(modes);
  omitted_.omega.assign(component_omega_.end() - modes, component_omega_.end());
  omitted_.M = strip(M_, n, kept, n, kept, false);
  if (!C_.empty()) {
    omitted_.from = strip(C_, n, kept, n, kept, false), omitted_.onto = strip(C_, n, kept, n, kept, true);
    for (size_t i = kept; i < n; ++i) omitted_.C.push_back(C_[i + i * n]);
  }
  for (auto* A : {&K_, &M_, &C_}) crop(*A, n, kept);
  component_omega_.resize(component_omega_.size() - size_t(modes));
  T_.resize(size_t(local_) * kept);
}

/// A T, columns `begin` .. `end`, as T has them; to twice the digits with what lies below these.
std::vector<double> Reduction::moved(BlockedProduct& A, PetscInt begin, PetscInt end,
                                     std::vector<double>* low) {
  std::vector<double> out(size_t(end - begin) * local_);
  if (low) low->resize(out.size());
  VecHandle product = make_vector(comm_, local_ * side_by_side);
  VecHandle below = low ? make_vector(comm_, local_ * side_by_side) : VecHandle();
  const auto take = [&](Vec from, double* to, PetscInt count) {
    const ReadArray in(from);
    for_tiles(local_, count,
              [&](PetscInt i, PetscInt j) { to[size_t(j) * local_ + i] = in.data()[i * side_by_side + j]; });
  };
  for (PetscInt first = begin; first < end; first += side_by_side) {
    const PetscInt count = std::min(side_by_side, end - first);
    const size_t at = size_t(first - begin) * local_;
    for_tiles(local_, count,
              [&](PetscInt i, PetscInt j) { A.columns()[i * side_by_side + j] = column(first + j)[i]; });
    check(VecSet(product, 0));
    if (low) {
      check(VecSet(below, 0));
      A.multiply_exactly(product, below);
      take(below, low->data() + at, count);
    } else {
      A.multiply_add(product);
    }
    take(product, out.data() + at, count);
  }
  return out;
}

void Reduction::place_component_modes(std::vector<ComponentMode> const& modes) {
  T_.reserve(size_t(local_) * (kept_.size() + modes.size()));  // `resize` would double it
  T_.resize(size_t(local_) * (kept_.size() + modes.size()));
  for (size_t j = 0; j < modes.size(); ++j) {
    component_omega_.push_back(modes[j].omega);
    ReadArray shape(modes[j].shape);
    double* out = column(PetscInt(kept_.size() + j));
    for (size_t i = 0; i < internal_.size(); ++i) out[internal_[i] - first_] = shape[PetscInt(i)];
  }
}

/// T^T A T, whole on every rank.
std::vector<double> Reduction::congruence(Mat A, bool symmetric) {
  const PetscInt n = size(), panel = panel_of(n);
  std::vector<double> out(size_t(n) * size_t(n));
  BlockedProduct product(A, side_by_side);
  for (PetscInt begin = 0; begin < n; begin += panel) {
    const PetscInt end = std::min(begin + panel, n);
    const auto AT = moved(product, begin, end);
    lapack::multiply("TN", {symmetric ? int(end) : int(n), int(end - begin), int(local_)}, 1.0,
                     {T_.data(), int(local_)}, {AT.data(), int(local_)}, 0.0,
                     out.data() + size_t(begin) * size_t(n), int(n));
  }
  sum_over_ranks(out, comm_);
  if (symmetric) lapack::mirror("U", int(n), out.data());
  return out;
}

std::vector<double> Reduction::expand(std::span<double const> reduced, PetscInt count) const {
  std::vector<double> full(size_t(local_) * size_t(count));
  lapack::multiply("NT", {int(count), int(local_), int(size())}, 1.0, {reduced.data(), int(count)},
                   {T_.data(), int(local_)}, 0.0, full.data(), int(count));
  return full;
}

std::vector<double> Reduction::project(std::span<double const> forces, PetscInt count) const {
  std::vector<double> reduced(size_t(size()) * size_t(count));
  lapack::multiply("NN", {int(count), int(size()), int(local_)}, 1.0, {forces.data(), int(count)},
                   {T_.data(), int(local_)}, 0.0, reduced.data(), int(count));
  sum_over_ranks(reduced, comm_);
  return reduced;
}

}  // namespace fretwave::model
