/// Kinds of preconditioners as PETSc's own types of PC. A PC of such a type belongs to a KSP whose matrix is
/// `LinearSolver`'s shell, and is set up, applied and viewed by it.
#include <petsc/private/pcimpl.h>

#include <algorithm>

#include "solve/linear_solver.h"
#include "solve/memory.h"

namespace fretwave::solve {

namespace {

std::deque<PreconditionerKind>& registered() {
  static std::deque<PreconditionerKind> all;
  return all;
}

/// Null where the matrix is not its shell.
PetscErrorCode solver_of(PC pc, LinearSolver** solver) {
  Mat matrix;
  PetscBool shell = PETSC_FALSE;
  *solver = nullptr;
  PetscErrorCode code = PCGetOperators(pc, nullptr, &matrix);
  if (!code && matrix) code = PetscObjectTypeCompare(reinterpret_cast<PetscObject>(matrix), MATSHELL, &shell);
  return code || !shell ? code : MatShellGetContext(matrix, solver);
}

PetscErrorCode set_up(PC pc) {
  LinearSolver* solver;
  const PetscErrorCode code = solver_of(pc, &solver);
  if (code) return code;
  return solver ? solver->set_up(pc) : PETSC_ERR_ARG_WRONGSTATE;
}

PetscErrorCode apply(PC pc, Vec x, Vec z) {
  LinearSolver* solver;
  const PetscErrorCode code = solver_of(pc, &solver);
  if (code) return code;
  return solver ? solver->apply(x, z) : PETSC_ERR_ARG_WRONGSTATE;
}

PetscErrorCode apply_transpose(PC pc, Vec, Vec) {
  LinearSolver* solver;
  const PetscErrorCode code = solver_of(pc, &solver);
  if (code) return code;
  return solver ? solver->refuse_transpose() : PETSC_ERR_ARG_WRONGSTATE;
}

PetscErrorCode view(PC pc, PetscViewer viewer) {
  LinearSolver* solver;
  PetscBool text;
  PetscErrorCode code =
      PetscObjectTypeCompare(reinterpret_cast<PetscObject>(viewer), PETSCVIEWERASCII, &text);
  if (!code) code = solver_of(pc, &solver);
  if (code || !text || !solver) return code;
  return PetscViewerASCIIPrintf(viewer, "  %s\n", solver->description().c_str());
}

PetscErrorCode create(PC pc) {
  pc->data = nullptr;
  pc->ops->setup = set_up;
  pc->ops->apply = apply;
  pc->ops->applytranspose = apply_transpose;
  pc->ops->view = view;
  return PetscErrorCode(0);
}

}  // namespace

void register_kind(PreconditionerKind kind) {
  check(PCRegister(kind.type.c_str(), create));
  registered().push_back(std::move(kind));
}

std::deque<PreconditionerKind> const& kinds() { return registered(); }

PreconditionerKind const* kind_of(std::string const& pc_type) {
  const auto found =
      std::ranges::find_if(kinds(), [&](PreconditionerKind const& kind) { return kind.type == pc_type; });
  return found == kinds().end() ? nullptr : &*found;
}

std::string refusal(PreconditionerKind const& kind, Problem& problem) {
  const std::string why = kind.refuses(problem);
  if (!why.empty() || !kind.fallback_bytes) return why;
  return beyond_memory("contact whose condensed system", kind.fallback_bytes(problem), problem.comm());
}

ChosenKind choose_kind(Problem& problem, std::string const& blocks) {
  ChosenKind chosen;
  for (auto const& kind : kinds()) {
    const bool asked = kind.blocks == blocks;
    if (!asked && (blocks != "auto" || !kind.suits(problem))) continue;
    const std::string why = refusal(kind, problem);
    if (why.empty()) {
      chosen.kind = &kind;
      return chosen;
    }
    if (asked)
      throw InputError("option blocks: there are no " + blocks + " blocks for " + why, blocks, "auto",
                       "leave out the option -<analysis>_blocks");
    chosen.note += " (" + why + ": no " + kind.type + ")";
  }
  return chosen;
}

}  // namespace fretwave::solve
