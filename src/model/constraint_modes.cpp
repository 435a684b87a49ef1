/// Constraint modes of a reduction, and what stiffness they leave the kept dofs.
#include <algorithm>
#include <functional>
#include <utility>

#include "blocked_product.h"
#include "lapack.h"
#include "model/reduction.h"

namespace fretwave::model {

namespace {

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

/// The forces that a panel of unit displacements leaves to the inside: -K_ib.
class UnitForces {
 public:
  UnitForces(Mat K, std::vector<PetscInt> const& kept, std::vector<PetscInt> const& internal)
      : entries_(in_columns(K, kept)), internal_(internal) {}
  /// Of the columns begin .. end, panel after panel.
  void place(Mat B, PetscInt begin, PetscInt end) {
    check(MatZeroEntries(B));
    for (DenseArray forces(B); next_ < entries_.size() && entries_[next_].col < end; ++next_) {
      auto const& entry = entries_[next_];
      const auto place = std::lower_bound(internal_.begin(), internal_.end(), entry.row);
      if (place != internal_.end() && *place == entry.row)
        forces.column(entry.col - begin)[place - internal_.begin()] = -entry.value;
    }
  }

 private:
  std::vector<MatEntry> entries_;
  std::vector<PetscInt> const& internal_;
  size_t next_ = 0;
};

}  // namespace

/// Unit displacement of one kept dof, the others held, and the static response inside, Psi = -K_ii^-1 K_ib,
/// refined once; panel by panel. The stiffness they have is T^T K T: (K T)_b alone, the forces on the kept
/// dofs, has the errors of the solves to first order (a soft bending mode was off by 2e-7 for 9e-9). Terms of
/// K are 1e4 to 1e8 times what is left of them in a soft bending: with their rounding, and what solves that
/// are not refined leave, the first frequency of 31,275 dofs differed by 1.6e-10 between one rank and two.
std::vector<double> Reduction::place_constraint_modes(Mat K, FixedInterface const& component) {
  const PetscInt kept = PetscInt(kept_.size()), panel = panel_of(kept);
  T_.resize(size_t(local_) * kept_.size());
  for (PetscInt j = 0; j < kept; ++j)
    if (kept_[j] >= first_ && kept_[j] < first_ + local_) column(j)[kept_[j] - first_] = 1;
  UnitForces unit(K, kept_, internal_);
  BlockedProduct product(K, BlockedProduct::most);
  std::vector<double> stiffness(size_t(kept) * size_t(kept)), forces(stiffness.size());
  Columns low;
  MatHandle B, X;
  for (PetscInt begin = 0; begin < kept; begin += panel) {
    const PetscInt end = std::min(begin + panel, kept);
    if (begin == 0 || end - begin < panel)
      B = component.columns(end - begin), X = component.columns(end - begin);
    unit.place(B, begin, end);
    component.solve(B, X);
    add_inside(X, begin, end);
    auto KT = moved(product, begin, end, &low);
    take_forces(KT, low, begin, end, forces);
    place_left(KT, B, end - begin);
    component.solve(B, X);
    add_inside(X, begin, end);
    lapack::multiply("TN", {int(end), int(end - begin), int(local_)}, 1.0, {T_.data(), int(local_)},
                     {KT.data(), int(local_)}, 0.0, stiffness.data() + size_t(begin) * size_t(kept),
                     int(kept));
  }
  sum_over_ranks(stiffness, comm_);
  sum_over_ranks(forces, comm_);  // each from one rank
  std::ranges::transform(stiffness, forces, stiffness.begin(), std::plus());
  lapack::mirror("U", int(kept), stiffness.data());
  return stiffness;
}

void Reduction::add_inside(Mat X, PetscInt begin, PetscInt end) {
  const DenseArray solution(X);
  for (PetscInt j = begin; j < end; ++j)
    for (size_t i = 0; i < internal_.size(); ++i)
      column(j)[internal_[i] - first_] += solution.column(j - begin)[i];
}

/// K T is (f, r): forces on the kept dofs, and what the solves have left inside. T is refined by K_ii^-1 r,
/// whereby T^T K T becomes f + Psi^T r, Psi the refined one: f goes into the rows of the kept dofs, and what
/// f is short of takes its place in K T.
void Reduction::take_forces(Columns& KT, Columns const& low, PetscInt begin, PetscInt end,
                            std::vector<double>& of_kept) {
  for (size_t i = 0; i < kept_.size(); ++i) {
    const PetscInt row = kept_[i] - first_;
    for (PetscInt j = begin; j < end && row >= 0 && row < local_; ++j) {
      const size_t at = size_t(j - begin) * local_ + row;
      of_kept[size_t(j) * kept_.size() + i] = std::exchange(KT[at], low[at]);
    }
  }
}

/// B = -r
void Reduction::place_left(Columns const& KT, Mat B, PetscInt columns) {
  const DenseArray left(B);
  for (PetscInt j = 0; j < columns; ++j)
    for (size_t i = 0; i < internal_.size(); ++i)
      left.column(j)[i] = -KT[size_t(j) * local_ + (internal_[i] - first_)];
}

}  // namespace fretwave::model
