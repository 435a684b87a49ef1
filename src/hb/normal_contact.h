#pragma once
#include "contact/law.h"
#include "hb/trigonometric.h"

namespace fretwave::hb {

/// The normal direction of a pair over the period: N = kn x approach where that is positive.
struct NormalContact {
  double stiffness = 0;
  Series approach;
  bool closed = true;       ///< all the period
  std::vector<Span> spans;  ///< closed in these otherwise

  bool touches() const { return closed || spans.size(); }
  /// Its motion, by the coefficients of u_n.
  void take(Harmonics const&, contact::LinearPair const&, double const* u);
  /// When it is closed: between the roots of its approach, known at 2 pi t / count.
  void find_spans(double const* approach_at, int count);
  /// Number of its sequence of states, whenever it begins.
  std::uint64_t sequence() const { return closed ? 1 : 2 + spans.size(); }
  /// How long of the period it is closed.
  double length() const;
  double mean_stiffness() const { return stiffness * length() / period; }
  /// F += coefficients of N.
  void add_force(Harmonics const&, double* F) const;
  /// D += dN/du_n, rows of length ld; by_gap -= dN.
  void add_blocks(Harmonics const&, double* D, size_t ld, double* by_gap) const;
};

}  // namespace fretwave::hb
