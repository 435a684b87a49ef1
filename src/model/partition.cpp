#include "model/partition.h"

#include "together.h"

namespace fretwave::model {

namespace {

constexpr double near = 0.05;  // of a part: how far a cut may lie from that of equal parts

/// Rows and columns of all ranks, on the first one. Collective.
MatHandle on_first_rank(Mat A, MPI_Comm comm) {
  IsHandle all;
  PetscInt size;
  Mat* made;
  check(MatGetSize(A, &size, nullptr));
  check(ISCreateStride(PETSC_COMM_SELF, comm_rank(comm) == 0 ? size : 0, 0, 1, all.out()));
  const IS rows = all;
  check(MatCreateSubMatrices(A, 1, &rows, &rows, MAT_INITIAL_MATRIX, &made));
  auto out = MatHandle::share(made[0]);
  check(MatDestroySubMatrices(1, &made));
  return out;
}

/// Dofs by levels of their graph, from one end of it to the other (Cuthill & McKee 1969).
std::vector<PetscInt> from_end_to_end(Mat A) {
  IsHandle rows, columns;
  PetscInt const* numbers;
  PetscInt size;
  check(MatGetOrdering(A, MATORDERINGRCM, rows.out(), columns.out()));
  check(ISGetLocalSize(rows, &size));
  check(ISGetIndices(rows, &numbers));
  std::vector<PetscInt> list(numbers, numbers + size);
  check(ISRestoreIndices(rows, &numbers));
  return list;
}

/// How many dofs of a list, cut before each place of it, have a neighbour behind the cut.
std::vector<PetscInt> across(Mat A, std::vector<PetscInt> const& list) {
  std::vector<PetscInt> place(list.size()), last(list.size()), out(list.size() + 1);
  for (size_t i = 0; i < list.size(); ++i) place[list[i]] = last[i] = PetscInt(i);
  for_entries(A, [&](PetscInt row, PetscInt column, double a) {
    if (a != 0) last[place[row]] = std::max(last[place[row]], place[column]);
  });
  for (size_t i = 0; i < list.size(); ++i) ++out[i], --out[last[i]];  // cuts behind i, up to the last one
  std::partial_sum(out.begin(), out.end(), out.begin());
  out.insert(out.begin(), 0);
  return out;
}

/// A list of dofs, where it is cut, and how many dofs have neighbours behind a cut.
struct Cuts {
  std::vector<PetscInt> list, first;
  PetscInt between;
};

/// Into as many parts as ranks, each cut at the narrowest place near to that of equal parts.
Cuts cut(Mat A, std::vector<PetscInt> list, int parts) {
  const auto width = across(A, list);
  const PetscInt size = PetscInt(list.size()), away = PetscInt(near * double(size) / parts);
  Cuts out{std::move(list), {0}, 0};
  for (int part = 1; part < parts; ++part) {
    const auto middle = width.begin() + PetscInt64(size) * part / parts;
    const auto narrowest = std::min_element(middle - away, middle + away + 1);
    out.first.push_back(PetscInt(narrowest - width.begin()));
    out.between += *narrowest;
  }
  out.first.push_back(size);
  return out;
}

/// Of the dofs as they are numbered and from end to end, both ways, what is cut across fewest.
Cuts narrowest(Mat A, int parts) {
  PetscInt size;
  check(MatGetSize(A, &size, nullptr));
  std::vector<PetscInt> numbered(size);
  std::iota(numbered.begin(), numbered.end(), PetscInt(0));
  std::vector<Cuts> found;
  for (auto list : {numbered, from_end_to_end(A)}) {
    found.push_back(cut(A, list, parts));
    std::ranges::reverse(list);
    found.push_back(cut(A, std::move(list), parts));
  }
  return std::move(*std::ranges::min_element(found, {}, &Cuts::between));
}

/// One dof's coefficients, as MPI moves them.
class Coefficients {
 public:
  explicit Coefficients(int count) {
    MPI_Type_contiguous(count, MPI_DOUBLE, &type_);
    MPI_Type_commit(&type_);
  }
  ~Coefficients() { MPI_Type_free(&type_); }
  Coefficients(Coefficients const&) = delete;
  operator MPI_Datatype() const { return type_; }

 private:
  MPI_Datatype type_;
};

}  // namespace

Partition::Partition(Mat A) {
  MPI_Comm comm;
  PetscLayout layout;
  IsHandle part;
  Cuts cuts;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatGetLayouts(A, &layout, nullptr));
  const MatHandle whole = on_first_rank(A, comm);
  together(comm, "dividing the dofs", [&] {
    if (comm_rank(comm) == 0) cuts = narrowest(whole, comm_size(comm));
  });
  broadcast(cuts.list, 0, comm), broadcast(cuts.first, 0, comm);
  PetscInt const* begin = cuts.list.data() + cuts.first[comm_rank(comm)];
  const PetscInt count = cuts.first[comm_rank(comm) + 1] - cuts.first[comm_rank(comm)];
  check(ISCreateGeneral(comm, count, begin, PETSC_COPY_VALUES, part.out()));
  check(MatCreateSubMatrix(A, part, part, MAT_INITIAL_MATRIX, matrix_.out()));
  check(PetscSFCreate(comm, given_.out()));
  check(PetscSFSetGraphLayout(given_, layout, count, nullptr, PETSC_COPY_VALUES, begin));
}

void Partition::take(double const* x, int coefficients, double* part) const {
  const Coefficients unit(coefficients);
  check(PetscSFBcastBegin(given_, unit, x, part, MPI_REPLACE));
  check(PetscSFBcastEnd(given_, unit, x, part, MPI_REPLACE));
}

void Partition::give(double const* part, int coefficients, double* x) const {
  const Coefficients unit(coefficients);
  check(PetscSFReduceBegin(given_, unit, part, x, MPI_REPLACE));
  check(PetscSFReduceEnd(given_, unit, part, x, MPI_REPLACE));
}

}  // namespace fretwave::model
