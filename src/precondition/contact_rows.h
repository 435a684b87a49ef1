#pragma once
#include "hb/residual.h"

namespace fretwave::precondition {

using namespace hb;

/// The rows of B of all ranks' pairs, numbered through: rank by rank, contact by contact, pair by pair.
struct ContactRows {
  struct Entry {
    int row;
    PetscInt dof;
    double value;
  };
  struct Pair {
    int first_row, components;
  };
  int count = 0;
  std::vector<Pair> pairs;
  std::vector<Entry> entries;
  /// Collective.
  static ContactRows of(std::vector<PairTangents> const&, MPI_Comm);
};

}  // namespace fretwave::precondition
