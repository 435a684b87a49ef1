/// Which preconditioner suits a harmonic problem.
#include <algorithm>
#include <type_traits>

#include "error.h"
#include "hb/basis_pc.h"
#include "hb/checked_pc.h"
#include "hb/condensed_pc.h"
#include "hb/harmonic_pc.h"
#include "hb/wheel_pc.h"

namespace fretwave::hb {

namespace {

/// Dense blocks are for reduced models. They are inverted in single precision, which the element stiffness of
/// a fine mesh, 1e8 times that of its first mode, outdoes; and 3000 dofs take 144 MB a harmonic.
bool suits_dense(model::Model const& model) {
  constexpr double always = 200, largest = 3000, share = 0.25;  // dofs, dofs, of nonzero entries
  const double n = double(model.dofs());
  return n <= always || (n <= largest && model.largest_term() > share * n * n);
}

[[noreturn]] void refuse(std::string const& blocks, std::string const& problem) {
  throw InputError("option blocks: there are no " + blocks + " blocks for " + problem, blocks, "auto",
                   "leave out the option -<analysis>_blocks");
}

}  // namespace

/// A pair that reaches into another sector couples harmonics with phases, which the condensed form leaves
/// out.
bool HarmonicProblem::condensable() const {
  auto const& contacts = model().contacts();
  return !model().unit() && !unfoldings() &&
         std::all_of(contacts.begin(), contacts.end(),
                     [](auto const& contact) { return contact.ahead.empty(); });
}

/// `blocks` other than auto is taken or refused. A wheel is dealt with by its waves, unless the contact is
/// not the same in all sectors.
std::unique_ptr<solve::Preconditioner> HarmonicProblem::preconditioner(std::string const& blocks) {
  condensed_ = false;
  const bool waves = model().unit() && WheelPreconditioner::suits(*this), free = blocks == "auto";
  const auto make = [&]<class P>(std::type_identity<P>, std::string note = "") {
    return std::make_unique<CheckedPreconditioner>(std::make_unique<P>(*this), std::move(note));
  };
  if (harmonics().fundamental() < 0 || (unfoldings() && !waves)) {
    if (!free) refuse(blocks, unfoldings() ? "a wheel whose double mode is unfolded" : "a static problem");
    return nullptr;
  }
  if (waves && free) return make(std::type_identity<WheelPreconditioner>());
  if (unfoldings()) refuse(blocks, "a wheel whose double mode is unfolded");
  const bool phased = std::any_of(model().contacts().begin(), model().contacts().end(),
                                  [](auto const& contact) { return !contact.ahead.empty(); });
  if (phased && blocks == "sparse") refuse(blocks, "a contact that reaches the next sector");
  const std::string note = model().unit() && !waves ? " (contact not the same in all sectors: no waves)" : "";
  condensed_ = !phased && (blocks == "sparse" || (free && !suits_dense(model())));
  if (condensed_) return make(std::type_identity<CondensedPreconditioner>(), note);
  if (free && BasisPreconditioner::suits(model())) return make(std::type_identity<BasisPreconditioner>());
  return make(std::type_identity<HarmonicPreconditioner>(), note);
}

std::unique_ptr<solve::Preconditioner> HarmonicProblem::fallback(double& bytes) {
  if (condensed_ || !condensable() || harmonics().fundamental() < 0) return nullptr;
  double rows = 0;
  for (auto const& contact : model().contacts()) rows += contact.law->components() * contact.law->pairs();
  MPI_Allreduce(MPI_IN_PLACE, &rows, 1, MPI_DOUBLE, MPI_SUM, comm());
  const double size = rows * harmonics().block_size() + scalars_;
  bytes = 8 * size * size;
  return std::make_unique<CheckedPreconditioner>(std::make_unique<CondensedPreconditioner>(*this));
}

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
  if (sums[0] < 0.9 * sums[1]) return {};
  return "the mean position is free: every pair that held it slips or opens within a period";
}

double HarmonicProblem::jacobian_entries() const {
  const double m = harmonics().block_size();
  double entries = 0, contact = 0;
  for (auto const& term : model().terms()) {
    MatInfo info;
    check(MatGetInfo(term.A, MAT_GLOBAL_SUM, &info));
    entries += info.nz_used * 2 * m;
  }
  for (auto const& group : model().contacts()) {
    MatInfo info;
    PetscInt rows;
    check(MatGetSize(group.B, &rows, nullptr));
    check(MatGetInfo(group.B, MAT_GLOBAL_SUM, &info));
    if (!rows) continue;
    const double of_a_pair = info.nz_used / double(rows) * group.law->components();
    contact += double(rows) / group.law->components() * of_a_pair * of_a_pair * m * m;
  }
  return entries + contact;
}

}  // namespace fretwave::hb
