#include "model/reduction.h"

#include <petscblaslapack.h>

#include <algorithm>
#include <array>
#include <utility>

#include "blocked_product.h"
#include "model/reduction_input.h"

namespace fretwave::model {

namespace {

/// Columns at a time: bounds the memory beside T, which a product packs anew for each panel.
PetscInt panel_of(PetscInt columns) { return std::clamp<PetscInt>(columns / 8, 64, 512); }
constexpr PetscInt side_by_side = BlockedProduct::most;  // columns of a sparse product

struct Columns {
  double const* data;
  PetscInt lead;
};

/// C (m x n) = op(A) op(B) over k, column by column; size = {m, n, k}.
void multiply(char const* op_a, char const* op_b, std::array<PetscInt, 3> size, Columns A, Columns B,
              double* C, PetscInt lead) {
  std::array<PetscBLASInt, 6> n;
  const PetscInt in[6] = {size[0], size[1], size[2], A.lead, B.lead, lead};
  for (int i = 0; i < 6; ++i) check(PetscBLASIntCast(i < 3 ? in[i] : std::max<PetscInt>(in[i], 1), &n[i]));
  const double one = 1, zero = 0;
  BLASgemm_(op_a, op_b, &n[0], &n[1], &n[2], &one, A.data, &n[3], B.data, &n[4], &zero, C, &n[5]);
}

/// visit(i, j) for all, in tiles that a cache holds by rows and by columns.
template <class Visit>
void for_tiles(PetscInt rows, PetscInt columns, Visit visit) {
  constexpr PetscInt side = 64;
  for (PetscInt begin = 0; begin < rows; begin += side)
    for (PetscInt j = 0; j < columns; ++j)
      for (PetscInt i = begin; i < std::min(begin + side, rows); ++i) visit(i, j);
}

/// This rank's entries of K in the columns of the kept dofs, by column; `col` is a place among those.
std::vector<MatEntry> in_columns(Mat K, std::vector<PetscInt> const& kept) {
  std::vector<std::pair<PetscInt, PetscInt>> places;
  for (PetscInt j = 0; j < PetscInt(kept.size()); ++j) places.emplace_back(kept[j], j);
  std::sort(places.begin(), places.end());
  std::vector<MatEntry> out;
  for_entries(K, [&](PetscInt row, PetscInt col, double value) {
    const auto place = std::lower_bound(places.begin(), places.end(), std::pair<PetscInt, PetscInt>{col, 0});
    if (place != places.end() && place->first == col) out.push_back({row, place->second, value});
  });
  std::stable_sort(out.begin(), out.end(), [](auto const& a, auto const& b) { return a.col < b.col; });
  return out;
}

/// This rank's dofs that are not kept.
std::vector<PetscInt> internal_dofs(std::vector<PetscInt> kept, PetscInt first, PetscInt local) {
  std::sort(kept.begin(), kept.end());
  std::vector<PetscInt> internal;
  for (PetscInt dof = first; dof < first + local; ++dof)
    if (!std::binary_search(kept.begin(), kept.end(), dof)) internal.push_back(dof);
  return internal;
}

/// Lower triangle from the upper one.
void mirror(std::vector<double>& A, size_t n) {
  for (size_t j = 0; j < n; ++j)
    for (size_t i = 0; i < j; ++i) A[j + i * n] = A[i + j * n];
}

/// What the theory says of the modal columns: no stiffness coupling, diag(omega^2), unit modal mass; rounding
/// removed.
void impose_modal_block(std::vector<double>& K, std::vector<double>& M, size_t kept,
                        std::vector<double> const& omega) {
  const size_t n = kept + omega.size();
  for (size_t j = kept; j < n; ++j)
    for (size_t i = 0; i < n; ++i) {
      const double square = omega[j - kept] * omega[j - kept];
      K[i + j * n] = K[j + i * n] = i == j ? square : 0;
      if (i >= kept) M[i + j * n] = i == j;
    }
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
  const auto internal = internal_dofs(kept_, first_, local_);
  IsHandle set;
  check(ISCreateGeneral(comm_, PetscInt(internal.size()), internal.data(), PETSC_COPY_VALUES, set.out()));
  FixedInterface component(K, M, set);
  times_.factorisation = lap();
  // the eigensolver takes over the factorisation and frees it at its end: constraint modes come first
  T_.reserve(size_t(local_) * (kept_.size() + size_t(wanted.count + ComponentModes::beyond(wanted.count))));
  place_constraint_modes(K, component, internal);
  times_.constraint_modes = lap();
  const auto modes = component.modes(wanted);
  place_component_modes(modes, internal);
  times_.component_modes = lap();
  K_ = congruence(K, PetscInt(kept_.size()), true);
  M_ = congruence(M, size(), true);
  if (C) C_ = congruence(C, size(), false);
  impose_modal_block(K_, M_, kept_.size(), component_omega_);
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

/// A T, columns `begin` .. `end`, as T has them.
std::vector<double> Reduction::moved(BlockedProduct& A, PetscInt begin, PetscInt end) {
  std::vector<double> out(size_t(end - begin) * local_);
  VecHandle product = make_vector(comm_, local_ * side_by_side);
  for (PetscInt first = begin; first < end; first += side_by_side) {
    const PetscInt count = std::min(side_by_side, end - first);
    double* to = out.data() + size_t(first - begin) * local_;
    for_tiles(local_, count,
              [&](PetscInt i, PetscInt j) { A.columns()[i * side_by_side + j] = column(first + j)[i]; });
    check(VecSet(product, 0));
    A.multiply_add(product);
    const ReadArray from(product);
    for_tiles(local_, count, [&](PetscInt i, PetscInt j) {
      to[size_t(j) * local_ + i] = from.data()[i * side_by_side + j];
    });
  }
  return out;
}

void Reduction::place_component_modes(std::vector<ComponentMode> const& modes,
                                      std::vector<PetscInt> const& internal) {
  T_.reserve(size_t(local_) * (kept_.size() + modes.size()));  // `resize` would double it
  T_.resize(size_t(local_) * (kept_.size() + modes.size()));
  for (size_t j = 0; j < modes.size(); ++j) {
    component_omega_.push_back(modes[j].omega);
    ReadArray shape(modes[j].shape);
    double* out = column(PetscInt(kept_.size() + j));
    for (size_t i = 0; i < internal.size(); ++i) out[internal[i] - first_] = shape[PetscInt(i)];
  }
}

/// Unit displacement of one kept dof, the others held, and the static response inside: -K_ii^-1 K_ib, panel
/// by panel.
void Reduction::place_constraint_modes(Mat K, FixedInterface const& component,
                                       std::vector<PetscInt> const& internal) {
  const PetscInt kept = PetscInt(kept_.size()), panel = panel_of(kept);
  T_.resize(size_t(local_) * kept_.size());
  for (PetscInt j = 0; j < kept; ++j)
    if (kept_[j] >= first_ && kept_[j] < first_ + local_) column(j)[kept_[j] - first_] = 1;
  const auto coupling = in_columns(K, kept_);
  MatHandle B, X;
  auto entry = coupling.begin();
  for (PetscInt begin = 0; begin < kept; begin += panel) {
    const PetscInt end = std::min(begin + panel, kept);
    if (begin == 0 || end - begin < panel) {
      B = component.columns(end - begin);
      X = component.columns(end - begin);
    }
    check(MatZeroEntries(B));
    for (DenseArray forces(B); entry != coupling.end() && entry->col < end; ++entry)
      if (const auto place = std::lower_bound(internal.begin(), internal.end(), entry->row);
          place != internal.end() && *place == entry->row)
        forces.column(entry->col - begin)[place - internal.begin()] = -entry->value;
    component.solve(B, X);
    DenseArray solution(X);
    for (PetscInt j = begin; j < end; ++j)
      for (size_t i = 0; i < internal.size(); ++i)
        column(j)[internal[i] - first_] = solution.column(j - begin)[i];
  }
}

/// T^T A T over the first n columns of T, whole on every rank. Of K too: (K T)_b alone is its condensed part,
/// but with the errors of the solves to first order; a soft bending mode was off by 2e-7 for 9e-9.
std::vector<double> Reduction::congruence(Mat A, PetscInt n, bool symmetric) {
  std::vector<double> out(size_t(size()) * size_t(size()));
  const PetscInt panel = panel_of(n);
  BlockedProduct product(A, side_by_side);
  for (PetscInt begin = 0; begin < n; begin += panel) {
    const PetscInt end = std::min(begin + panel, n);
    const auto AT = moved(product, begin, end);
    multiply("T", "N", {symmetric ? end : n, end - begin, local_}, {T_.data(), local_}, {AT.data(), local_},
             out.data() + size_t(begin) * size_t(size()), size());
  }
  sum_over_ranks(out, comm_);
  if (symmetric) mirror(out, size_t(size()));
  return out;
}

std::vector<double> Reduction::expand(std::span<double const> reduced, PetscInt count) const {
  std::vector<double> full(size_t(local_) * size_t(count));
  multiply("N", "T", {count, local_, size()}, {reduced.data(), count}, {T_.data(), local_}, full.data(),
           count);
  return full;
}

std::vector<double> Reduction::project(std::span<double const> forces, PetscInt count) const {
  std::vector<double> reduced(size_t(size()) * size_t(count));
  multiply("N", "N", {count, size(), local_}, {forces.data(), count}, {T_.data(), local_}, reduced.data(),
           count);
  sum_over_ranks(reduced, comm_);
  return reduced;
}

}  // namespace fretwave::model
