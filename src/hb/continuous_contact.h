#pragma once
#include "hb/continuous_force.h"
#include "hb/normal_contact.h"
#include "hb/play.h"

namespace fretwave::hb {

/// Contact whose force is linear in its motion but where a pair changes its state (contact::LinearPair): the
/// changes are found between samples, to the last digit, and the force's harmonics are integrals over the
/// pieces between them. So F(U) has no error of sampling and is as smooth as the law is.
class ContinuousContact : public DisplacementForce {
 public:
  ContinuousContact(Harmonics const&, contact::Law const&);

  void force(double const* U, double const* V, double* F) override;
  double mean_stiffness(int pair, int component) const override;
  std::uint64_t piece(bool finely) const override;
  void sample(int samples, double const* u, double const* v, double* f) const override;
  void measure(contact::Diagnosis&, double omega) const override;

 private:
  struct Tangent {
    Series u;  ///< about its mean
    double mean = 0;
    Play::Walls walls;
    Play play;
  };
  struct Pair {
    contact::LinearPair law;
    NormalContact normal;
    std::vector<Tangent> tangents;
  };
  /// Of the pairs of a tile, at the times of the grid: samples x components x pairs.
  struct Grid {
    std::vector<double> U, V, values, rates;
  };
  size_t block(int pair, int component) const {
    return (size_t(pair) * components_ + component) * harmonics_.block_size();
  }
  void evaluate(double const* U, int first, int pairs);
  void take(double const* U, int pair);
  void find_spans(Pair&, int place);
  void find_play(Pair&, int tangent, int place);
  void tangential_force(Pair const&, Tangent const&, double* F) const;
  void tangential_blocks(Pair const&, int tangent, double* D, double* by_gap) const;
  void linearise() override;

  Harmonics harmonics_, times_;
  contact::Law const& law_;
  int components_, normal_, tile_;
  FourierTransform transform_;
  Grid grid_;
  std::vector<double> wave_;  ///< one pair's samples of what is searched for roots
  std::vector<Pair> pairs_;
};

}  // namespace fretwave::hb
