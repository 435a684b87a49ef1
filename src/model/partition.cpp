#include "model/partition.h"

#include <functional>

#include "model/dof_graph.h"

namespace fretwave::model {

namespace {

constexpr double near = 0.05;      // of a part: how far a cut may lie from that of equal parts
constexpr int most_steps = 10000;  // along the graph, each a message to neighbours and a sum over all ranks

/// Sums of all entries up to each. Collective.
void add_up(Vec v, MPI_Comm comm) {
  const WriteArray own(v);
  std::partial_sum(own.span().begin(), own.span().end(), own.data());
  const double mine = own.span().empty() ? 0 : own.span().back();
  double before = 0;
  MPI_Exscan(&mine, &before, 1, MPI_DOUBLE, MPI_SUM, comm);
  if (comm_rank(comm) > 0)
    for (double& one : own.span()) one += before;
}

/// For each dof of this rank its place among all of them.
using Places = std::vector<PetscInt>;

Places as_numbered(DofGraph const& graph, PetscInt begin) {
  Places out(graph.size());
  std::iota(out.begin(), out.end(), begin);
  return out;
}

/// By levels of the graph, on each as they are numbered. Collective.
Places from_end_to_end(DofGraph const& graph) {
  Places level = graph.levels(most_steps);
  PetscInt levels = level.empty() ? 0 : *std::ranges::max_element(level) + 1;
  MPI_Allreduce(MPI_IN_PLACE, &levels, 1, MPIU_INT, MPI_MAX, graph.comm());
  std::vector<PetscInt> count(levels), before(levels), all(levels), next(levels);
  for (PetscInt one : level) ++count[one];
  MPI_Exscan(count.data(), before.data(), int(levels), MPIU_INT, MPI_SUM, graph.comm());
  if (comm_rank(graph.comm()) == 0) std::ranges::fill(before, 0);
  MPI_Allreduce(count.data(), all.data(), int(levels), MPIU_INT, MPI_SUM, graph.comm());
  std::exclusive_scan(all.begin(), all.end(), next.begin(), PetscInt(0));
  std::ranges::transform(next, before, next.begin(), std::plus());
  for (PetscInt& one : level) one = next[one]++;
  return level;
}

/// How many dofs, cut before each place, stand on one side and have a neighbour on the other: before the cut
/// (`forwards`) or behind it. Collective.
VecHandle across(DofGraph const& graph, Places const& places, PetscInt size, bool forwards) {
  std::vector<PetscInt> place(places);
  place.resize(graph.all());
  graph.exchange(place);
  std::vector<PetscInt> farthest(places);
  for (PetscInt j = 0; j < graph.all(); ++j)
    for (int i : graph.coupled_to(j))
      farthest[i] = forwards ? std::max(farthest[i], place[j]) : std::min(farthest[i], place[j]);
  VecHandle width;
  check(VecCreateMPI(graph.comm(), PETSC_DECIDE, size + 1, width.out()));
  for (PetscInt i = 0; i < graph.size(); ++i) {
    const auto [from, to] = std::minmax(places[i], farthest[i]);
    if (from == to) continue;
    check(VecSetValue(width, from + 1, 1, ADD_VALUES));
    check(VecSetValue(width, to + 1, -1, ADD_VALUES));
  }
  check(VecAssemblyBegin(width));
  check(VecAssemblyEnd(width));
  add_up(width, graph.comm());
  return width;
}

/// Places of dofs, where they are cut, and how many have neighbours beyond a cut.
struct Cuts {
  Places places;
  std::vector<PetscInt> first;
  PetscInt between;
};

/// The last part first, and in it the last dof.
void turn(Cuts& cuts) {
  const PetscInt size = cuts.first.back();
  for (PetscInt& place : cuts.places) place = size - 1 - place;
  for (PetscInt& first : cuts.first) first = size - first;
  std::ranges::reverse(cuts.first);
}

/// Into as many parts as ranks, each cut at the narrowest place near to that of equal parts, and of those at
/// the nearest. Collective.
Cuts cut(DofGraph const& graph, Places places, PetscInt size, bool forwards) {
  const PetscInt parts = comm_size(graph.comm()), away = PetscInt(near * double(size) / double(parts));
  const VecHandle width = across(graph, places, size, forwards);
  PetscInt begin, end;
  check(VecGetOwnershipRange(width, &begin, &end));
  const ReadArray own(width);
  std::vector<PetscInt> narrowest(parts - 1, size),
      off(parts - 1, 2 * away + 1);  // twice the distance, 1 behind
  const auto middle = [&](PetscInt k) { return PetscInt(PetscInt64(size) * (k + 1) / parts); };
  const auto with_each = [&](auto visit) {
    for (PetscInt k = 0; k < parts - 1; ++k)
      for (PetscInt c = std::max(begin, middle(k) - away); c < std::min(end, middle(k) + away + 1); ++c)
        visit(k, c, PetscInt(own[c - begin]));
  };
  with_each([&](PetscInt k, PetscInt, PetscInt wide) { narrowest[k] = std::min(narrowest[k], wide); });
  MPI_Allreduce(MPI_IN_PLACE, narrowest.data(), int(parts - 1), MPIU_INT, MPI_MIN, graph.comm());
  with_each([&](PetscInt k, PetscInt c, PetscInt wide) {
    if (wide == narrowest[k]) off[k] = std::min(off[k], 2 * std::abs(c - middle(k)) + (c > middle(k)));
  });
  MPI_Allreduce(MPI_IN_PLACE, off.data(), int(parts - 1), MPIU_INT, MPI_MIN, graph.comm());
  Cuts out{std::move(places), {0}, std::accumulate(narrowest.begin(), narrowest.end(), PetscInt(0))};
  for (PetscInt k = 0; k < parts - 1; ++k)
    out.first.push_back(middle(k) + (off[k] % 2 ? off[k] / 2 : -(off[k] / 2)));
  out.first.push_back(size);
  if (!forwards) turn(out);
  return out;
}

/// Of the dofs as they are numbered and from end to end, both ways, what is cut across fewest. Collective.
Cuts narrowest(DofGraph const& graph, PetscInt begin, PetscInt size) {
  std::vector<Cuts> found;
  for (auto const& places : {as_numbered(graph, begin), from_end_to_end(graph)})
    for (bool forwards : {true, false}) found.push_back(cut(graph, places, size, forwards));
  return std::move(*std::ranges::min_element(found, {}, &Cuts::between));
}

/// The dofs of this rank's part, in order, by their numbers in the matrix. Collective.
std::vector<PetscInt> dofs_of_part(Cuts const& cuts, PetscInt begin, MPI_Comm comm) {
  const int rank = comm_rank(comm);
  const VecHandle dofs = make_vector(comm, cuts.first[rank + 1] - cuts.first[rank]);
  for (size_t i = 0; i < cuts.places.size(); ++i)
    check(VecSetValue(dofs, cuts.places[i], double(begin + PetscInt(i)), INSERT_VALUES));
  check(VecAssemblyBegin(dofs));
  check(VecAssemblyEnd(dofs));
  const ReadArray own(dofs);
  return {own.span().begin(), own.span().end()};
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
  PetscInt size, begin;
  IsHandle part;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatGetSize(A, &size, nullptr));
  check(MatGetOwnershipRange(A, &begin, nullptr));
  check(MatGetLayouts(A, &layout, nullptr));
  const auto dofs = dofs_of_part(narrowest(DofGraph(A), begin, size), begin, comm);
  const PetscInt count = PetscInt(dofs.size());
  check(ISCreateGeneral(comm, count, dofs.data(), PETSC_COPY_VALUES, part.out()));
  check(MatCreateSubMatrix(A, part, part, MAT_INITIAL_MATRIX, matrix_.out()));
  check(PetscSFCreate(comm, given_.out()));
  check(PetscSFSetGraphLayout(given_, layout, count, nullptr, PETSC_COPY_VALUES, dofs.data()));
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
