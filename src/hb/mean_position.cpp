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
constexpr double far = 1e4;     // motions: nothing that moves so little shifts its mean there
constexpr double unsure = 10;  // times the least that K does not know: 3 are seen (a printed matrix, reduced)

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

/// A mean that is far from rest beside the motion, or moves so along the branch (dy), though neither K,
/// beyond its rounding, nor contact bears it: the net force of the friction is not balanced, and there is no
/// periodic motion.
std::string HarmonicProblem::adrift(Vec y, Vec dy) {
  const PetscInt m = harmonics().block_size();
  if (harmonics().orders()[0] != 0 || m == 1) return {};
  VecHandle shift = make_vector(comm(), model().local_dofs()), force = like(q_);
  linearise(y);
  double largest[2] = {};  // of the mean, of the motion
  {
    const ReadArray all(y), in(dy);
    const WriteArray mean(shift), block(dQ_);
    for (PetscInt i = 0; i < local_block_; ++i) {
      const bool moves = i % m != 0;
      largest[moves] = std::max(largest[moves], std::abs(moves ? all[i] : in[i]));
      block[i] = moves ? 0 : in[i];
      if (!moves) mean[i / m] = in[i];
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, largest, 2, MPI_DOUBLE, MPI_MAX, comm());
  if (!(largest[0] > far * largest[1])) return {};
  double energy, uncertain = 0;
  residual_.product(dQ_, nullptr, force);
  check(VecDot(dQ_, force, &energy));
  for (auto const& term : model().terms())
    if (term.order == 0) uncertain += model::uncertainty(term.A, shift);
  return std::abs(energy) <= unsure * uncertain ? free_mean : "";
}

}  // namespace fretwave::hb
