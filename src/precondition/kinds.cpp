/// Which preconditioner suits a harmonic problem.
#include "precondition/kinds.h"

#include <algorithm>
#include <cmath>

#include "precondition/basis_pc.h"
#include "precondition/condensed_pc.h"
#include "precondition/harmonic_pc.h"
#include "solve/memory.h"
#include "tuned.h"

namespace fretwave::precondition {

namespace {

/// Dense blocks are for reduced models. They are inverted in single precision, which the element stiffness of
/// a fine mesh, 1e8 times that of its first mode, outdoes; and 3000 dofs take 144 MB a harmonic.
const Tuned always("blocks_always", 200, "dofs up to which blocks are dense");
const Tuned largest("blocks_largest", 3000, "dofs up to which blocks of dense models are dense");
const Tuned share("blocks_share", 0.25, "share of nonzero entries from which a model is dense");
// Of 9,228 dofs the eigenproblem takes 170 s on one core, once; each solve with a full factor is left out.
const Tuned whole("basis_largest", 12000, "dofs up to which dense models have a basis of all modes");

bool is_dense(HarmonicProblem const& problem, double most) {
  const double n = double(problem.model().dofs());
  return n <= most && problem.model().largest_term() > share * n * n;
}

bool suits_dense(HarmonicProblem const& problem) {
  return double(problem.model().dofs()) <= always || is_dense(problem, largest);
}

std::string unfolded(HarmonicProblem const& problem) {
  return problem.unfolding().vectors().empty() ? "" : "a wheel whose double mode is unfolded";
}

/// A pair that reaches into another sector couples harmonics with phases, which the condensed form leaves
/// out.
std::string not_condensed(HarmonicProblem const& problem) {
  const bool phased = std::ranges::any_of(problem.model().contacts(),
                                          [](auto const& contact) { return !contact.ahead.empty(); });
  return phased ? "a contact that reaches the next sector" : unfolded(problem);
}

/// Every rank has all terms and the fundamental with its border, each block one.
std::string without_blocks(HarmonicProblem const& problem) {
  if (const auto why = unfolded(problem); !why.empty()) return why;
  const double entries = std::pow(double(problem.model().dofs()), 2),
               terms = double(problem.model().terms().size());
  const double bytes =
      entries * (8 * problem.harmonics().count() + comm_size(problem.comm()) * (8 * terms + 32));
  return solve::beyond_memory("a model whose dense blocks", bytes, problem.comm());
}

double contact_rows(HarmonicProblem const& problem) {
  double rows = 0;
  for (auto const& contact : problem.model().contacts())
    rows += contact.law->components() * contact.law->pairs();
  MPI_Allreduce(MPI_IN_PLACE, &rows, 1, MPI_DOUBLE, MPI_SUM, problem.comm());
  return rows;
}

/// K, M, the work of their eigenproblem and what slipping pairs move are whole on every rank.
std::string without_basis(HarmonicProblem const& problem) {
  if (const auto why = unfolded(problem); !why.empty()) return why;
  const double n = double(problem.model().dofs()), rows = contact_rows(problem),
               bytes = 8 * comm_size(problem.comm()) * (5 * n * n + 5 * rows * rows);
  if (const auto why = solve::beyond_memory("a model whose basis of all modes", bytes, problem.comm());
      !why.empty())
    return why;
  return problem.model().stuck_basis() ? "" : "a model without a basis of stuck pairs";
}

/// The contact's static compliance, its inverse for slipping pairs (whole on every rank), and the basis.
double static_bytes(HarmonicProblem const& problem) {
  const double rows = contact_rows(problem);
  const auto [whole, spread] = model::StuckBasis::size_with_factor(double(problem.model().dofs()), rows);
  return sizeof(double) * (comm_size(problem.comm()) * (whole + 5 * rows * rows) + spread);
}

std::string without_static(HarmonicProblem const& problem) {
  if (const auto why = unfolded(problem); !why.empty()) return why;
  const auto why =
      solve::beyond_memory("contact whose static compliance", static_bytes(problem), problem.comm());
  if (!why.empty()) return why;
  return problem.model().static_basis() ? "" : "a model without a basis of stuck pairs";
}

double condensed_bytes(solve::Problem& problem) {
  auto const& harmonic = dynamic_cast<HarmonicProblem const&>(problem);
  if (harmonic.model().unit()) return 0;
  const double size = contact_rows(harmonic) * harmonic.harmonics().block_size() + harmonic.scalar_count();
  return sizeof(double) * size * size;
}

}  // namespace

void register_kinds() {
  const auto always = [](HarmonicProblem const&) { return true; };
  const auto has_basis = [](HarmonicProblem const& problem) { return without_basis(problem).empty(); };
  const auto large = [has_basis](HarmonicProblem const& problem) {
    return !suits_dense(problem) && !(is_dense(problem, whole) && has_basis(problem));
  };
  auto statics = harmonic_kind<StaticPreconditioner>("fwstatic", "", large, without_static);
  statics.one_factor = true;
  solve::register_kind(std::move(statics));
  auto condensed = harmonic_kind<CondensedPreconditioner>("fwcondensed", "sparse", large, not_condensed);
  condensed.fallback_bytes = condensed_bytes;
  solve::register_kind(std::move(condensed));
  solve::register_kind(harmonic_kind<BasisPreconditioner>("fwbasis", "", has_basis, without_basis));
  solve::register_kind(harmonic_kind<HarmonicPreconditioner>("fwblocks", "dense", always, without_blocks));
}

}  // namespace fretwave::precondition
