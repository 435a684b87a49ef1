/// What the contacts of a residual are told (wear, gaps, the state at rest) and tell (status, samples,
/// wearing).
#include <algorithm>

#include "error.h"
#include "fault.h"
#include "hb/residual.h"
#include "log.h"
#include "scramble.h"
#include "together.h"

namespace fretwave::hb {

void Residual::expect_depths(PerContact const& depth) const {
  if (depth.size() != groups_.size())
    throw InputError("worn depths are given for another number of contacts", std::to_string(depth.size()),
                     std::to_string(groups_.size()), "give a list, may be empty, for each contact");
  for (size_t k = 0; k < groups_.size(); ++k) {
    contact::Law const& law = *groups_[k].contact->law;
    if (!depth[k].empty() && (!law.wears() || int(depth[k].size()) != law.pairs()))
      throw InputError(
          "a contact cannot take these worn depths",
          "contact '" + groups_[k].contact->name + "', " + std::to_string(depth[k].size()) + " depths",
          law.wears() ? std::to_string(law.pairs()) + " depths" : "a law with a normal direction",
          "wear contacts with law coulomb_3d");
  }
}

void Residual::wear(PerContact const& depth) {
  together(model_.comm(), "wearing contacts", [&] {
    fault::point("wear");
    expect_depths(depth);
  });
  for (size_t k = 0; k < groups_.size(); ++k) {
    contact::Law& law = *groups_[k].contact->law;
    // on a rank without pairs too: all must agree that linearisations are of other depths
    law.wear(depth[k].empty() ? nullptr : depth[k].data());
  }
}

void Residual::gap_product(PerContact const& dgap, Vec dR) {
  together(model_.comm(), "wearing contacts", [&] { expect_depths(dgap); });
  gaps_product(dgap, dR);
}

void Residual::gaps_product(PerContact const& dgap, Vec dR) {
  check(VecSet(dR, 0));
  for (size_t k = 0; k < groups_.size(); ++k) {
    Group& group = groups_[k];
    if (!group.contact->law->stands_off()) continue;
    VecHandle dF = like(group.F);
    std::vector<double> gaps = dgap[k];
    gaps.resize(size_t(group.contact->law->pairs()), 0.0);  // an empty list: this contact does not wear
    group.aft.gap_product(gaps.data(), WriteArray(dF).data());
    add_force(group, dF, dR);
  }
}

void Residual::stand_off(double distance) {
  for (Group const& group : groups_) group.contact->law->stand_off(distance);
}

void Residual::stand_off_product(Vec dR) {
  PerContact dgap(groups_.size());
  for (size_t k = 0; k < groups_.size(); ++k)
    if (groups_[k].contact->law->stands_off()) dgap[k].assign(groups_[k].contact->law->pairs(), 1.0);
  gaps_product(dgap, dR);
}

std::vector<Wearing> Residual::wearing(Vec Q, Exponents const& e) {
  std::vector<Wearing> out;
  const auto U = relative_motions(Q);
  together(model_.comm(), "what wears the contacts", [&] {
    fault::point("wearing");
    for (size_t k = 0; k < groups_.size(); ++k)
      out.push_back(groups_[k].aft.wearing(ReadArray(U[k]).data(), e));
  });
  return out;
}

ContactSummary Residual::summarise(Vec Q, Exponents const& e) {
  static const log::Event summary("FwSummary");
  const log::Span span(summary);
  double sums[8] = {}, largest[2] = {};
  const auto U = relative_motions(Q);
  together(model_.comm(), "reading contacts", [&] {
    fault::point("summary");
    for (size_t k = 0; k < groups_.size(); ++k) {
      const auto s = groups_[k].aft.summarise(ReadArray(U[k]).data(), e);
      const double parts[8] = {s.stick, s.slip, s.open, s.truncated, s.total, s.aliased, s.retained, s.work};
      for (int i = 0; i < 8; ++i) sums[i] += parts[i];
      largest[0] = std::max(largest[0], s.unclosed), largest[1] = std::max(largest[1], s.path);
    }
  });
  MPI_Allreduce(MPI_IN_PLACE, sums, 8, MPI_DOUBLE, MPI_SUM, model_.comm());
  MPI_Allreduce(MPI_IN_PLACE, largest, 2, MPI_DOUBLE, MPI_MAX, model_.comm());
  return {sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], largest[0], largest[1]};
}

std::uint64_t Residual::piece(bool finely) const {
  std::uint64_t sum = 0;
  for (size_t g = 0; g < groups_.size(); ++g) sum += scrambled(groups_[g].aft.piece(finely) + g);
  return of_all_ranks(sum);
}

std::uint64_t Residual::piece_of(Vec Q, Exponents const& e, bool finely) {
  static const log::Event forces("FwContactForce");
  std::uint64_t sum = 0;
  const auto U = relative_motions(Q);
  const log::Span span(forces);
  together(model_.comm(), "states of contacts", [&] {
    for (size_t g = 0; g < groups_.size(); ++g)
      sum += scrambled(groups_[g].aft.piece_of(ReadArray(U[g]).data(), e, finely) + g);
  });
  return of_all_ranks(sum);
}

std::uint64_t Residual::of_all_ranks(std::uint64_t piece) const {
  piece = scrambled(piece + std::uint64_t(comm_rank(model_.comm())));
  MPI_Allreduce(MPI_IN_PLACE, &piece, 1, MPI_UINT64_T, MPI_SUM, model_.comm());
  return piece;
}

unsigned Residual::contact_version() const {
  unsigned sum = 0;
  for (Group const& group : groups_) sum += group.contact->law->version();
  return sum;
}

void Residual::place(PerContact const& sliders, unsigned owner) {
  for (size_t k = 0; k < groups_.size(); ++k) groups_[k].contact->law->place(sliders[k], owner);
}

void Residual::settle(Vec Q, PerContact const& from) {
  const auto U = relative_motions(Q);
  together(model_.comm(), "settling contacts", [&] {
    fault::point("settle");
    for (size_t k = 0; k < groups_.size(); ++k) {
      contact::Law& law = *groups_[k].contact->law;
      const int d = law.components(), n = law.pairs();
      ReadArray blocks(U[k]);
      std::vector<double> u(size_t(d) * n);
      for (int i = 0; i < n; ++i)
        for (int c = 0; c < d; ++c) u[size_t(c) * n + i] = blocks[(i * d + c) * harmonics_.block_size()];
      law.rest(u.data(), from.empty() ? std::vector<double>{} : from[k]);
    }
  });
}

std::vector<ContactPeriod> Residual::periods(Vec Q, Exponents const& e) {
  std::vector<ContactPeriod> out;
  const auto U = relative_motions(Q);
  together(model_.comm(), "contact samples", [&] {
    fault::point("contact samples");
    for (size_t k = 0; k < groups_.size(); ++k)
      out.push_back(groups_[k].aft.period(ReadArray(U[k]).data(), e));
  });
  return out;
}

}  // namespace fretwave::hb
