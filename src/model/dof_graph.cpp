#include "model/dof_graph.h"

#include <limits>

#include "together.h"

namespace fretwave::model {

DofGraph::DofGraph(Mat A) {
  PetscLayout layout;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm_));
  check(MatGetOwnershipRange(A, &begin_, &end_));
  check(MatGetLayouts(A, &layout, nullptr));
  together(comm_, "reading which dofs are coupled", [&] { read(A); });
  check(PetscSFCreate(comm_, owners_.out()));
  check(PetscSFSetGraphLayout(owners_, layout, PetscInt(others_.size()), nullptr, PETSC_COPY_VALUES,
                              others_.data()));
}

void DofGraph::read(Mat A) {
  const auto is_own = [&](PetscInt dof) { return dof >= begin_ && dof < end_; };
  const auto with_each = [&](auto visit) {
    for_entries(A, [&](PetscInt row, PetscInt column, double a) {
      if (a != 0 && row != column) visit(row, column);
    });
  };
  with_each([&](PetscInt, PetscInt column) {
    if (!is_own(column)) others_.push_back(column);
  });
  std::ranges::sort(others_);
  others_.erase(std::unique(others_.begin(), others_.end()), others_.end());
  const auto place = [&](PetscInt dof) {
    return is_own(dof) ? dof - begin_ : size() + (std::ranges::lower_bound(others_, dof) - others_.begin());
  };
  first_.assign(all() + 1, 0);
  with_each([&](PetscInt, PetscInt column) { ++first_[place(column) + 1]; });
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  rows_.resize(size_t(first_.back()));
  std::vector<PetscInt64> next(first_.begin(), first_.end() - 1);
  with_each([&](PetscInt row, PetscInt column) { rows_[next[place(column)]++] = int(row - begin_); });
}

std::span<int const> DofGraph::coupled_to(PetscInt j) const {
  return std::span(rows_).subspan(size_t(first_[j]), size_t(first_[j + 1] - first_[j]));
}

void DofGraph::exchange(std::span<PetscInt> values) const {
  const auto others = values.subspan(size());
  check(PetscSFBcastBegin(owners_, MPIU_INT, values.data(), others.data(), MPI_REPLACE));
  check(PetscSFBcastEnd(owners_, MPIU_INT, values.data(), others.data(), MPI_REPLACE));
}

namespace {

constexpr PetscInt none = std::numeric_limits<PetscInt>::max();
constexpr PetscInt unreached = -1;

PetscInt smallest(PetscInt mine, MPI_Comm comm) {
  MPI_Allreduce(MPI_IN_PLACE, &mine, 1, MPIU_INT, MPI_MIN, comm);
  return mine;
}

}  // namespace

/// From one dof to all that are not reached yet and that it is connected with, level by level.
struct DofGraph::Walk {
  DofGraph const& graph;
  std::vector<PetscInt>& level;   ///< of all dofs
  std::vector<PetscInt> reached;  ///< in this order
  PetscInt last, farthest;        ///< level, and of its dofs the one of lowest number in the matrix
  int& steps;                     ///< that are left

  /// From a dof by its number in the matrix, on a level. Collective.
  Walk(DofGraph const& graph, std::vector<PetscInt>& level, PetscInt from, PetscInt first, int& steps)
      : graph(graph), level(level), last(first), farthest(from), steps(steps) {
    if (from >= graph.begin_ && from < graph.end_) reach(from - graph.begin_, first);
    for (size_t done = 0; steps-- > 0;) {
      graph.exchange(level);
      for (PetscInt j = graph.size(); j < graph.all(); ++j)
        if (level[j] == last) reached.push_back(j);
      const size_t now = reached.size();
      for (; done < now; ++done)
        for (int i : graph.coupled_to(reached[done]))
          if (level[i] == unreached) reach(i, last + 1);
      PetscInt next = none;
      for (size_t k = now; k < reached.size(); ++k) next = std::min(next, graph.begin_ + reached[k]);
      next = smallest(next, graph.comm_);
      if (next == none) return;
      ++last, farthest = next;
    }
  }
  void reach(PetscInt i, PetscInt at) { level[i] = at, reached.push_back(i); }
  void undo() {
    for (PetscInt i : reached) level[i] = unreached;
  }
};

/// The first dof of all ranks that is not reached, by its number in the matrix; `from`: no own one before it
/// is. Collective.
PetscInt DofGraph::first_unreached(std::span<PetscInt const> level, PetscInt& from) const {
  while (from < size() && level[from] != unreached) ++from;
  return smallest(from == size() ? none : begin_ + from, comm_);
}

/// Dofs that nothing is coupled to are all on the first level: each by itself would take a walk.
void DofGraph::reach_alone(std::span<PetscInt> level) const {
  std::vector<char> coupled(size(), 0);
  for (PetscInt j = 0; j < all(); ++j) {
    const auto rows = coupled_to(j);
    if (j < size() && !rows.empty()) coupled[j] = 1;
    for (int i : rows) coupled[i] = 1;
  }
  for (PetscInt i = 0; i < size(); ++i)
    if (!coupled[i]) level[i] = 0;
}

std::vector<PetscInt> DofGraph::levels(int steps) const {
  std::vector<PetscInt> level(all(), unreached);
  reach_alone(level);
  PetscInt next = 1, from = 0;
  for (PetscInt start = first_unreached(level, from); start != none && steps > 0;
       start = first_unreached(level, from)) {
    Walk walk(*this, level, start, next, steps);
    if (steps > 0) {  // the dof farthest from any is near an end
      walk.undo();
      next = Walk(*this, level, walk.farthest, next, steps).last + 1;
    } else {
      next = walk.last + 1;
    }
  }
  std::ranges::replace(level, unreached, next);
  level.resize(size());
  return level;
}

}  // namespace fretwave::model
