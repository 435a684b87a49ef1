#include "precondition/contact_rows.h"

namespace fretwave::precondition {

ContactRows ContactRows::of(std::vector<PairTangents> const& contacts, MPI_Comm comm) {
  int mine = 0, first = 0;
  for (auto const& contact : contacts) mine += contact.pairs * contact.components;
  MPI_Exscan(&mine, &first, 1, MPI_INT, MPI_SUM, comm);
  if (comm_rank(comm) == 0) first = 0;
  std::vector<Pair> pairs;
  std::vector<Entry> entries;
  for (auto const& contact : contacts) {
    const int d = contact.components;
    for (int p = 0; p < contact.pairs; ++p) pairs.push_back({first + p * d, d});
    for (Weight const& w : contact.weights)
      entries.push_back({first + w.pair * d + w.component, w.dof, w.value});
    first += contact.pairs * d;
  }
  ContactRows out;
  out.pairs = gathered(std::span<Pair const>(pairs), comm);
  out.entries = gathered(std::span<Entry const>(entries), comm);
  for (Pair const& pair : out.pairs) out.count += pair.components;
  return out;
}

}  // namespace fretwave::precondition
