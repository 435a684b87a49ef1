#include "model/stiff_contact.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "model/phases.h"
#include "tuned.h"

namespace fretwave::model {

namespace {

const Tuned far_stiffer(
    "modes_far_stiffer", 1e3,
    "times the structure's own stiffness, from which linear modes take contact by its forces");

MatHandle rows_of(Mat B, std::vector<PetscInt> const& rows) {
  IsHandle rows_set, cols_set;
  MatHandle out;
  MPI_Comm comm;
  PetscInt begin, end;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(B), &comm));
  check(MatGetOwnershipRangeColumn(B, &begin, &end));
  check(ISCreateGeneral(comm, PetscInt(rows.size()), rows.data(), PETSC_COPY_VALUES, rows_set.out()));
  check(ISCreateStride(comm, end - begin, begin, 1, cols_set.out()));
  check(MatCreateSubMatrix(B, rows_set, cols_set, MAT_INITIAL_MATRIX, out.out()));
  return out;
}

/// The structure's own stiffness [force/length] at this rank's rows: k adds k b_j^2 to its K_jj. Collective.
std::vector<double> stiffness_at(Mat B, Mat K) {
  VecHandle diagonal;
  MatHandle weighted;
  check(MatCreateVecs(K, diagonal.out(), nullptr));
  check(MatGetDiagonal(K, diagonal));
  check(VecAbs(diagonal));
  check(MatDuplicate(B, MAT_COPY_VALUES, weighted.out()));
  check(MatDiagonalScale(weighted, nullptr, diagonal));
  std::vector<double> bK;
  for_entries(weighted, [&](PetscInt, PetscInt, double value) { bK.push_back(value); });
  PetscInt rows, first;
  check(MatGetLocalSize(B, &rows, nullptr));
  check(MatGetOwnershipRange(B, &first, nullptr));
  std::vector<double> own(static_cast<size_t>(rows)), size(own.size());
  auto next = bK.begin();
  for_entries(B, [&](PetscInt row, PetscInt, double b) {
    own[size_t(row - first)] += b * *next++, size[size_t(row - first)] += b * b;
  });
  for (size_t row = 0; row < own.size(); ++row)  // one that touches no dof is none
    own[row] = size[row] > 0 ? own[row] / (size[row] * size[row]) : INFINITY;
  return own;
}

/// A row of B by its columns.
using SparseRow = std::map<PetscInt, double>;

double largest(SparseRow const& row) {
  double most = 0;
  for (auto const& [col, value] : row) most = std::max(most, std::abs(value));
  return most;
}

/// Rows that say no more than those before them, as two dampers on one dof do: rigid both, they would make
/// the saddle singular. By elimination, a pivot's row without the columns of those before.
class Independent {
 public:
  /// Whether it is one more.
  bool takes(SparseRow row) {
    const double size = largest(row);
    for (auto at = next_pivot(row); at != row.end(); at = next_pivot(row)) {
      const double times = at->second;
      for (auto const& [col, value] : pivots_[order_.at(at->first)]) row[col] -= times * value;
      row.erase(at);
    }
    std::erase_if(row, [&](auto const& entry) { return !(std::abs(entry.second) > nothing * size); });
    if (row.empty()) return false;
    const auto pivot =
        std::ranges::max_element(row, {}, [](auto const& entry) { return std::abs(entry.second); });
    const auto [col, value] = *pivot;
    for (auto& entry : row) entry.second /= value;
    order_[col] = pivots_.size();
    pivots_.push_back(std::move(row));
    return true;
  }

 private:
  static constexpr double nothing = 1e-10;  // of a row's largest entry: rounding

  /// The entry in the column of the earliest pivot.
  SparseRow::iterator next_pivot(SparseRow& row) const {
    auto first = row.end();
    size_t least = pivots_.size();
    for (auto at = row.begin(); at != row.end(); ++at)
      if (const auto found = order_.find(at->first); found != order_.end() && found->second < least)
        least = found->second, first = at;
    return first;
  }

  std::vector<SparseRow> pivots_;
  std::map<PetscInt, size_t> order_;  ///< of the pivots, by column
};

/// Of rigid rows, those of this rank that are independent of all before them. Collective.
std::vector<PetscInt> independent(Mat B, std::vector<PetscInt> const& rigid, Independent& known) {
  MPI_Comm comm;
  PetscInt begin, end;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(B), &comm));
  check(MatGetOwnershipRange(B, &begin, &end));
  std::vector<MatEntry> mine;
  for_entries(B, [&](PetscInt row, PetscInt col, double value) {
    if (value != 0 && std::ranges::binary_search(rigid, row)) mine.push_back({row, col, value});
  });
  std::map<PetscInt, SparseRow> rows;
  for (MatEntry const& e : gathered(std::span<MatEntry const>(mine), comm)) rows[e.row][e.col] = e.value;
  std::vector<PetscInt> out;
  for (auto& [number, row] : rows)
    if (known.takes(std::move(row)) && number >= begin && number < end) out.push_back(number);
  return out;
}

}  // namespace

StiffContact::StiffContact(Model const& model, Mat K) {
  std::vector<MatHandle> parts;
  const PetscInt copies = model.travelling() ? 2 : 1;
  Independent known;
  for (auto const& contact : model.contacts()) {
    const MatHandle B = real_form(maps_of(contact), model.theta(), model.travelling());
    const auto own = stiffness_at(B, K);
    PetscInt begin;
    check(MatGetOwnershipRange(B, &begin, nullptr));
    std::vector<PetscInt> stiff, rigid, rows;
    auto& taken = taken_[&contact];
    const int d = contact.law->components();
    const auto stiffness = [&](PetscInt row) {
      return contact.law->stuck_stiffness(int(row % d), int(row / d));
    };
    for (int row = 0; row < d * contact.law->pairs(); ++row) {
      const double k = stiffness(row);
      taken.push_back(k > far_stiffer * own[size_t(row * copies)]);
      for (PetscInt copy = 0; taken.back() && copy < copies; ++copy)
        (std::isinf(k) ? rigid : stiff).push_back(begin + row * copies + copy);
    }
    rigid = independent(B, rigid, known);
    std::ranges::merge(stiff, rigid, std::back_inserter(rows));
    for (PetscInt row : rows) compliance_.push_back(1 / stiffness((row - begin) / copies));
    PetscInt counts[2] = {PetscInt(rows.size()), PetscInt(rigid.size())};
    MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPIU_INT, MPI_SUM, model.comm());
    if (counts[0] > 0) parts.push_back(rows_of(B, rows));
    rows_ += counts[0], rigid_ += counts[1];
  }
  if (parts.size() == 1) B_ = std::move(parts[0]);
  if (parts.size() <= 1) return;
  std::vector<Mat> raw(parts.begin(), parts.end());
  MatHandle nest;
  check(MatCreateNest(model.comm(), PetscInt(raw.size()), nullptr, 1, nullptr, raw.data(), nest.out()));
  check(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, B_.out()));
}

bool StiffContact::takes(Contact const& contact, int component, int pair) const {
  return taken_.at(&contact)[size_t(pair) * contact.law->components() + component];
}

void StiffContact::scale(Vec dofs) {
  VecHandle largest;
  check(MatDiagonalScale(B_, nullptr, dofs));
  check(MatCreateVecs(B_, nullptr, largest.out()));
  check(MatGetRowMaxAbs(B_, largest, nullptr));
  check(VecReciprocal(largest));
  check(MatDiagonalScale(B_, largest, nullptr));
  const ReadArray s(largest);
  for (size_t i = 0; i < compliance_.size(); ++i) compliance_[i] *= s[i] * s[i];
}

MatHandle StiffContact::beside(Mat K) const { return saddle(K, 1); }
MatHandle StiffContact::beside_mass(Mat M) const { return saddle(M, 0); }

/// [A, s B^H; s B, -s / k]
MatHandle StiffContact::saddle(Mat A, double scale) const {
  MatHandle scaled, transposed, nest, whole, corner;
  MPI_Comm comm;
  const PetscInt rows = PetscInt(compliance_.size());
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatDuplicate(B_, MAT_COPY_VALUES, scaled.out()));
  check(MatScale(scaled, scale));
  check(MatTranspose(scaled, MAT_INITIAL_MATRIX, transposed.out()));
  check(
      MatCreateAIJ(comm, rows, rows, PETSC_DETERMINE, PETSC_DETERMINE, 1, nullptr, 0, nullptr, corner.out()));
  PetscInt first;
  check(MatGetOwnershipRange(corner, &first, nullptr));
  for (PetscInt i = 0; i < rows; ++i)
    if (compliance_[i] > 0)
      check(MatSetValue(corner, first + i, first + i, -scale * compliance_[i], INSERT_VALUES));
  check(MatAssemblyBegin(corner, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(corner, MAT_FINAL_ASSEMBLY));
  Mat blocks[4] = {A, transposed, scaled, corner};
  check(MatCreateNest(comm, 2, nullptr, 2, nullptr, blocks, nest.out()));
  check(MatConvert(nest, MATAIJ, MAT_INITIAL_MATRIX, whole.out()));
  return whole;
}

}  // namespace fretwave::model
