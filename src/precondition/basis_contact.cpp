/// Contact in the basis of stuck pairs: mean stiffness of pairs that slip or open, and what is left of it.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "fault.h"
#include "log.h"
#include "precondition/basis_pc.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

constexpr double stuck = 1e-7;  // of a pair's stiffness: what its tangents may differ from that

// Where they creep (100 for 1e-3 on the lap joint's 48 pairs), single precision leaves nothing to gain: more
// take more iterations outside, too.
const Tuned most("basis_pairs_most", 30, "iterations on the pairs' coupling in the basis, at the most");

}  // namespace

/// Of this rank's pairs: what the mean over the harmonics of the tangents differs from the stuck stiffness.
std::vector<double> BasisPreconditioner::mean_tangents(std::vector<PairTangents> const& contacts) const {
  std::vector<double> means;
  int pair = first_pair_;
  for (auto const& contact : contacts) {
    const int d = contact.components;
    const size_t ld = size_t(d) * m_;
    for (int p = 0; p < contact.pairs; ++p, ++pair)
      for (int row = 0; row < d; ++row)
        for (int col = 0; col < d; ++col) {
          double const* at = &contact.D[p * ld * ld + row * m_ * ld + col * m_];
          double sum = 0;
          for (int c = 0; c < m_; ++c) sum += at[c * ld + c];
          const double k =
              row == col ? basis_->stiffness()[pairs_[pair].first_row + row] / problem_.stiffness_scale() : 0;
          means.push_back(sum / m_ - k);
        }
  }
  return gathered(std::span<double const>(means), problem_.comm());
}

/// Whether a pair's mean stiffness is not the stuck one.
bool BasisPreconditioner::moves(int pair, std::vector<double> const& means, size_t at) const {
  const int d = pairs_[pair].components;
  double largest = 0, stiffness = 0;
  for (int i = 0; i < d * d; ++i) largest = std::max(largest, std::abs(means[at + i]));
  for (int i = 0; i < d; ++i)
    stiffness = std::max(stiffness, basis_->stiffness()[pairs_[pair].first_row + i]);
  return largest > stuck * stiffness / problem_.stiffness_scale();
}

/// Pairs that are taken for stuck and are not: each with the place of its mean.
std::vector<std::pair<int, size_t>> BasisPreconditioner::beginning(std::vector<double> const& means) const {
  std::vector<std::pair<int, size_t>> out;
  size_t at = 0;
  for (size_t p = 0; p < pairs_.size(); ++p) {
    if (place_[pairs_[p].first_row] < 0 && moves(int(p), means, at)) out.emplace_back(int(p), at);
    at += size_t(pairs_[p].components) * pairs_[p].components;
  }
  return out;
}

/// Pairs that slip or open come in with their mean.
void BasisPreconditioner::take_contact() {
  place_.assign(basis_->rows(), -1);
  auto [rows, T] = taken(beginning(means_), 0);
  blocks_->set_contact(rows, std::move(T));
}

/// These pairs behind those that came in before.
void BasisPreconditioner::add_contact(std::vector<std::pair<int, size_t>> const& pairs) {
  const auto [rows, T] = taken(pairs, blocks_->rows());
  blocks_->add_contact(rows, T);
}

/// Rows of pairs and what their mean stiffness lacks of the stuck one; they get their places from `first` on.
std::pair<std::vector<int>, std::vector<ModalBlocks::Entry>> BasisPreconditioner::taken(
    std::vector<std::pair<int, size_t>> const& pairs, int first) {
  std::vector<int> rows;
  std::vector<ModalBlocks::Entry> T;
  for (auto const& [pair, at] : pairs) {
    const int d = pairs_[pair].components, begin = int(rows.size());
    for (int row = 0; row < d; ++row) {
      place_[pairs_[pair].first_row + row] = first + begin + row;
      rows.push_back(pairs_[pair].first_row + row);
      for (int col = 0; col < d; ++col) T.push_back({begin + row, begin + col, means_[at + row * d + col]});
    }
  }
  return {std::move(rows), std::move(T)};
}

/// What is left of each pair's tangents, and how pairs feel each other.
void BasisPreconditioner::couple(std::vector<PairTangents> const& contacts) {
  Harmonics const& h = problem_.harmonics();
  corrections_.clear(), coupled_.reset(), busy_rows_.clear(), busy_pairs_.clear();
  std::vector<ModalBlocks::Group> groups;
  std::vector<size_t> first_block(pairs_.size());  // by harmonic, then as compliance() has them
  size_t of_a_harmonic = 0;
  for (size_t p = 0; p < pairs_.size(); ++p) {
    if (place_[pairs_[p].first_row] < 0) continue;
    groups.push_back({place_[pairs_[p].first_row], pairs_[p].components});
    first_block[p] = of_a_harmonic * h.count();
    of_a_harmonic += size_t(pairs_[p].components) * pairs_[p].components;
  }
  G_.assign(of_a_harmonic * h.count(), {});
  for (int i = first_; i < last_; ++i) {
    size_t at = 0;
    const auto own = blocks_->compliance(i, groups);
    auto next = own.begin();
    for (auto const& group : groups) {
      const size_t entries = size_t(group.rows) * group.rows;
      std::copy_n(next, entries, G_.begin() + at * h.count() + i * entries);
      next += entries, at += entries;
    }
  }
  static_assert(sizeof(Rotation) == 4 * sizeof(double));
  if (!G_.empty()) sum_over_ranks(std::span(&G_[0].cc, 4 * G_.size()), problem_.comm());
  std::vector<int> busy;
  together(problem_.comm(), "correcting contact pairs", [&] { busy = correct(contacts, first_block); });
  const auto all = gathered(std::span<int const>(busy), problem_.comm());
  for (size_t p = 0; p < pairs_.size(); ++p) {
    if (!all[p]) continue;
    busy_pairs_.push_back({pairs_[p].components, int(busy_rows_.size()), first_block[p]});
    for (int row = 0; row < pairs_[p].components; ++row)
      busy_rows_.push_back(place_[pairs_[p].first_row] + row);
  }
  if (busy_rows_.empty()) return;
  std::vector<PairCorrection const*> own;
  for (auto const& correction : corrections_)
    if (!correction.idle()) own.push_back(&correction);
  coupled_ = std::make_unique<CoupledPairs>(
      problem_.comm(), std::move(own), [this](double const* f, double* u) { add_coupling(f, u); },
      most.count());
}

/// Corrections of this rank's pairs that are not stuck; which of all its pairs couple harmonics.
std::vector<int> BasisPreconditioner::correct(std::vector<PairTangents> const& contacts,
                                              std::vector<size_t> const& first_block) {
  static const log::Event correcting("FwPairInverse");
  const log::Span span(correcting);
  Harmonics const& h = problem_.harmonics();
  std::vector<int> busy;
  size_t at = 0;
  for (int p = 0; p < first_pair_; ++p) at += size_t(pairs_[p].components) * pairs_[p].components;
  int pair = first_pair_;
  for (auto const& contact : contacts) {
    const int d = contact.components;
    const size_t ld = size_t(d) * m_;
    for (int p = 0; p < contact.pairs; ++p, ++pair, at += size_t(d) * d) {
      busy.push_back(0);
      const int row = pairs_[pair].first_row;
      if (place_[row] < 0) continue;
      std::vector<Rotation> taken;
      for (int i = 0; i < h.count(); ++i)
        for (int k = 0; k < d * d; ++k) {
          const double stiffness =
              k % (d + 1) ? 0 : basis_->stiffness()[row + k / d] / problem_.stiffness_scale();
          const double t = stiffness + means_[at + k];
          taken.push_back({.cc = t, .ss = h.orders()[i] ? t : 0});
        }
      double const* D = &contact.D[p * ld * ld];
      fault::point("pair correction");
      corrections_.emplace_back(h, d, std::vector<double>(D, D + ld * ld), taken.data(),
                                &G_[first_block[pair]]);
      busy.back() = !corrections_.back().idle();
    }
  }
  return busy;
}

/// u += what forces of busy pairs move of the others, at this rank's harmonics.
void BasisPreconditioner::add_coupling(double const* f, double* u) const {
  Harmonics const& h = problem_.harmonics();
  const int c = blocks_->coefficients(), lead = blocks_->lead(), begin = blocks_->begin();
  const auto moved = blocks_->compliance(own(f, busy_rows_, blocks_->rows()));
  for (size_t row = 0; row < busy_rows_.size(); ++row)
    for (int k = 0; k < c; ++k) u[row * m_ + begin + k] += moved[size_t(busy_rows_[row]) * lead + k];
  for (Busy const& pair : busy_pairs_)
    for (int i = first_; i < last_; ++i)
      for (int row = 0; row < pair.components; ++row)
        for (int col = 0; col < pair.components; ++col) {
          const int d = pair.components;
          Rotation const& g = G_[pair.first_block + (size_t(i) * d + row) * d + col];
          double const* from = f + size_t(pair.first_row + col) * m_ + h.offset(i);
          double* to = u + size_t(pair.first_row + row) * m_ + h.offset(i);
          to[0] -= g.cc * from[0];
          if (h.orders()[i] == 0) continue;
          to[0] -= g.cs * from[1], to[1] -= g.sc * from[0] + g.ss * from[1];
        }
}

}  // namespace fretwave::precondition
