#pragma once
#include <span>
#include <vector>

#include "petsc.h"

namespace fretwave::wheel {

/// What each of p ranks has for each other, in at most 2 sqrt(p) messages of a rank. Ranks stand in rows of
/// about sqrt(p). A rank sends within its row what goes to any rank of a column to the member in that column,
/// who then sends within the column what came for each of its ranks, so that every number travels twice. Of
/// few ranks each sends to each.
class TwoStageExchange {
 public:
  explicit TwoStageExchange(MPI_Comm);
  /// out: what goes to rank 0, 1, ..., `sent[r]` numbers each, one after the other; in: what those have for
  /// this rank, in the same order. What a rank sends or receives, with two numbers a rank more, fits in an
  /// int: the caller sees to it. Collective.
  void operator()(std::span<double const> out, std::span<int const> sent, std::span<double> in) const;

 private:
  using Buffer = std::vector<double>;
  /// The rank that takes what `rank` sends to a column: that of its row, or of the row before where the last
  /// is shorter.
  int through(int rank, int column) const {
    const int at = rank / columns_ * columns_ + column;
    return at < size_ ? at : at - columns_;
  }
  std::vector<Buffer> pass(std::vector<Buffer> out, std::vector<int> const& to, std::vector<int> const& from,
                           int tag) const;

  void exchange_directly(std::span<double const> out, std::span<int const> sent, std::span<double> in) const;

  MPI_Comm comm_;
  int rank_, size_;
  bool directly_;
  int columns_;
  std::vector<int> members_;  ///< those that this rank sends to first, by column
  std::vector<int> senders_;  ///< those that send to this one first
  std::vector<int> column_;   ///< this rank's column, from the first row
};

}  // namespace fretwave::wheel
