/// Where a body stands that friction alone holds: what slips all through a period holds no mean.
#include <algorithm>
#include <cmath>

#include "hb/harmonic_problem.h"
#include "model/mode_orientation.h"
#include "solve/vectors.h"

namespace fretwave::hb {

using solve::dot, solve::zero_like;

namespace {

constexpr char const* free_mean =
    "the mean position is free: every pair that held it slips or opens within a period";
constexpr double mostly = 0.9;   // of a step's square: it is one in the mean
constexpr double far = 1e4;      // motions: nothing that moves so little shifts its mean there
constexpr double unsure = 10;    // uncertainties of K: 3 are seen (of a printed matrix, reduced)
constexpr double clearly = 1e6;  // of these, dof by dof: no motion that K leaves free

/// The mean of the motion of all dofs, each in the first of the entries of its block.
VecHandle mean_of(model::Model const& model, int block, Vec blocks) {
  VecHandle out = make_vector(model.comm(), model.local_dofs());
  const ReadArray in(blocks);
  const WriteArray mean(out);
  for (PetscInt i = 0; i < model.local_dofs(); ++i) mean[i] = in[i * block];
  return out;
}

/// A motion that is its mean alone.
void put_mean(Vec mean, int block, Vec blocks) {
  check(VecSet(blocks, 0));
  const ReadArray in(mean);
  const WriteArray out(blocks);
  for (PetscInt i = 0; i < local_size(mean); ++i) out[i * block] = in[i];
}

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
/// periodic motion. The two are asked one by one: what friction pushes by and a spring holds cancels.
std::string HarmonicProblem::adrift(Vec y, Vec dy) {
  const PetscInt m = harmonics().block_size();
  if (harmonics().orders()[0] != 0 || m == 1) return {};
  double largest[2] = {};  // of the mean, of the motion
  {
    const ReadArray all(y), in(dy);
    for (PetscInt i = 0; i < local_block_; ++i) {
      const bool moves = i % m != 0;
      largest[moves] = std::max(largest[moves], std::abs(moves ? all[i] : in[i]));
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, largest, 2, MPI_DOUBLE, MPI_MAX, comm());
  if (!(largest[0] > far * largest[1])) return {};
  const VecHandle shift = mean_of(model(), m, dy), by_K = zero_like(shift), force = like(shift);
  double uncertain = 0;
  for (auto const& term : model().terms()) {
    if (term.order != 0) continue;
    check(MatMult(term.A, shift, force));
    check(VecAXPY(by_K, 1, force));
    uncertain += model::uncertainty(term.A, shift);
  }
  linearise(y);
  put_mean(shift, m, dQ_);
  residual_.product(dQ_, nullptr, dR_);
  const double of_K = dot(shift, by_K), of_contact = dot(shift, mean_of(model(), m, dR_)) - of_K;
  double each;
  check(VecPointwiseMult(force, shift, by_K));
  check(VecNorm(force, NORM_1, &each));
  const bool held = std::max(std::abs(of_K), std::abs(of_contact)) >= unsure * uncertain;
  return held || each >= clearly * uncertain ? "" : free_mean;
}

}  // namespace fretwave::hb
