#include "solve/trail.h"

#include <algorithm>
#include <cmath>

#include "scramble.h"
#include "tuned.h"

namespace fretwave::solve {

namespace {

constexpr size_t recent = 3;         // steps just made go the same way by nature
constexpr double parallel = 0.98;    // cosine between directions of the same piece of a branch
constexpr double nearness = 0.1;     // of a step's length: the chord's distance from a bent branch
constexpr size_t round_trip = 16;    // steps at most of one round
constexpr size_t rounds = 128;       // steps that lead nowhere ...
constexpr double wound = 32;         // ... whose length is this many times how far they have been from here
constexpr double same_place = 1e-9;  // relative

const Tuned again("branch_again", 1e-3, "of the shortest step of a round: the same point of it");

/// Uniform in (-1, 1) by the entry's global number and the functional's.
double weight(PetscInt entry, int functional) {
  const auto x = scrambled(std::uint64_t(entry) * Trail::count + std::uint64_t(functional));
  return double(std::int64_t(x)) / 9223372036854775808.0;
}

double inner(Trail::Projection const& a, Trail::Projection const& b) {
  double sum = 0;
  for (int k = 0; k < Trail::count; ++k) sum += a[k] * b[k];
  return sum;
}

Trail::Projection minus(Trail::Projection a, Trail::Projection const& b) {
  for (int k = 0; k < Trail::count; ++k) a[k] -= b[k];
  return a;
}

double length(Trail::Projection const& a) { return std::sqrt(inner(a, a)); }

}  // namespace

Trail::Projection Trail::project(Vec v) {
  PetscInt begin;
  MPI_Comm comm;
  check(VecGetOwnershipRange(v, &begin, nullptr));
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(v), &comm));
  const PetscInt n = local_size(v);
  const ReadArray in(v);
  Projection out{};
  for (PetscInt i = 0; i < n; ++i)
    for (int k = 0; k < count; ++k) out[k] += weight(begin + i, k) * in[i];
  MPI_Allreduce(MPI_IN_PLACE, out.data(), count, MPI_DOUBLE, MPI_SUM, comm);
  return out;
}

void Trail::fill(Vec row, int functional) {
  PetscInt begin;
  check(VecGetOwnershipRange(row, &begin, nullptr));
  const PetscInt n = local_size(row);
  WriteArray out(row);
  for (PetscInt i = 0; i < n; ++i) out[i] = weight(begin + i, functional);
}

bool Trail::same(Vec y, Projection const& place) {
  return length(minus(project(y), place)) <= same_place * (1 + length(place));
}

bool Trail::circles() const {
  double shortest = INFINITY, path = 0, farthest = 0;
  for (size_t back = 1; back <= rounds && back < steps_.size(); ++back) {
    auto const* then = &steps_[steps_.size() - 1 - back];
    const double step = length(minus(then[1].y, then[0].y)), away = length(minus(steps_.back().y, then->y));
    shortest = std::min(shortest, step), path += step, farthest = std::max(farthest, away);
    if (back > 1 && back <= round_trip && away < again * shortest) return true;
  }
  return steps_.size() > rounds && path > wound * farthest;
}

std::optional<Trail::Meeting> Trail::meeting(Vec y, Vec tangent) const {
  const Step now{project(y), project(tangent)};
  for (size_t i = 0; i + 1 < steps_.size(); ++i) {
    Projection const &a = steps_[i].y, chord = minus(steps_[i + 1].y, a);
    const double square = inner(chord, chord);
    if (!(square > 0)) continue;
    const Projection offset = minus(now.y, a);
    const double along = inner(offset, chord) / square;
    if (along < 0 || along > 1) continue;
    double aside = 0;
    for (int k = 0; k < count; ++k) aside += std::pow(offset[k] - along * chord[k], 2);
    const double cosine = inner(now.t, chord) / (length(now.t) * std::sqrt(square));
    if (std::sqrt(aside) > nearness * std::sqrt(square) || std::abs(cosine) < parallel) continue;
    if (cosine > 0 && i + 1 + recent >= steps_.size()) continue;
    int best = 0;
    for (int k = 1; k < count; ++k)
      if (std::abs(now.t[k]) > std::abs(now.t[best])) best = k;
    return Meeting{a, best, cosine > 0};
  }
  return {};
}

}  // namespace fretwave::solve
