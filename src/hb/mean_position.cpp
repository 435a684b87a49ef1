/// Where a body stands that friction alone holds: what slips all through a period holds no mean.
#include <algorithm>
#include <cmath>

#include "hb/harmonic_problem.h"
#include "model/mode_orientation.h"

namespace fretwave::hb {

namespace {

constexpr char const* free_mean =
    "the mean position is free: every pair that held it slips or opens within a period";
constexpr double mostly = 0.9;  // of a step's square: it is one in the mean
constexpr double far = 100;     // times the motion: nothing that moves so little shifts its mean there

}  // namespace

/// A step in the mean alone: friction held it, and what held it slips now.
std::string HarmonicProblem::explain(Vec, Vec dy) {
  const PetscInt m = harmonics().block_size();
  double sums[2] = {};  // of the mean, of all
  {
    ReadArray in(dy);
    for (PetscInt i = 0; i < local_block_; ++i) {
      sums[1] += in[i] * in[i];
      if (i % m == 0 && harmonics().orders()[0] == 0) sums[0] += in[i] * in[i];
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, sums, 2, MPI_DOUBLE, MPI_SUM, comm());
  return sums[0] < mostly * sums[1] ? "" : free_mean;
}

/// A mean that has drifted far from rest, though no more than the rounding of K holds it there: the net force
/// of the friction is not balanced, and there is no periodic motion.
std::string HarmonicProblem::adrift(Vec y) {
  const PetscInt m = harmonics().block_size();
  if (harmonics().orders()[0] != 0 || m == 1) return {};
  VecHandle shift = make_vector(comm(), model().local_dofs());
  double largest[2] = {};  // of the mean, of the motion
  {
    const ReadArray in(y);
    const WriteArray mean(shift);
    for (PetscInt i = 0; i < local_block_; ++i) {
      double& most = largest[i % m != 0];
      most = std::max(most, std::abs(in[i]));
      if (i % m == 0) mean[i / m] = in[i];
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, largest, 2, MPI_DOUBLE, MPI_MAX, comm());
  if (!(largest[0] > far * largest[1])) return {};
  double energy = 0, uncertain = 0;
  VecHandle force = like(shift);
  for (auto const& term : model().terms()) {
    if (term.order != 0) continue;
    double share;
    check(MatMult(term.A, shift, force));
    check(VecDot(shift, force, &share));
    energy += share, uncertain += model::uncertainty(term.A, shift);
  }
  return std::abs(energy) <= uncertain ? free_mean : "";
}

}  // namespace fretwave::hb
