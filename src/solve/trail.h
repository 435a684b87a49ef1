#pragma once
#include <array>
#include <optional>
#include <vector>

#include "petsc.h"

namespace fretwave::solve {

/// Where a branch has been, remembered by a few fixed random projections of each point: enough to recognise a
/// place it comes back to, at no memory worth mention. The same on any number of ranks.
class Trail {
 public:
  static constexpr int count = 8;
  using Projection = std::array<double, count>;
  /// A remembered point near which the branch seems to pass again.
  struct Meeting {
    Projection place;
    int functional;  ///< that tells places along the branch apart best
    bool forwards;   ///< passed in the same direction
  };

  /// Adds a point with its unit tangent. Collective.
  void add(Vec y, Vec tangent) { steps_.push_back({project(y), project(tangent)}); }
  /// Drops the last one.
  void forget() { steps_.pop_back(); }
  /// A meeting with an earlier part of the branch, at a point with its unit tangent; with the last steps only
  /// where it passes them backwards. Collective.
  std::optional<Meeting> meeting(Vec y, Vec tangent) const;
  /// Whether the last point is one of those shortly before it, far nearer than the steps since are long, or
  /// the last steps together are far longer than they lead from it.
  bool circles() const;
  /// Whether y is the remembered place. Collective.
  static bool same(Vec y, Projection const& place);
  static Projection project(Vec v);
  /// The functional itself, as a row.
  static void fill(Vec row, int functional);

 private:
  struct Step {
    Projection y, t;
  };
  std::vector<Step> steps_;
};

}  // namespace fretwave::solve
