"""The message of an analysis that stopped before its goal."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..analyses.parts.context import Outcome
from ..errors import NotConverged
from ..hb.suspects import FREE, HIDES, LEADS_OVER, NO_NUMBER, NUMBER
from ..mpi.petsc_share import prefix_of

#: Of a branch that has come to its end.
REACHED = "stop value reached"
#: A loop may end within itself, and an internal resonance lead to another mode.
OVER = "steps that pass over loops (--petsc '-fw_branch_other 1e300')"

#: Of an analysis that follows no branch and says nothing itself.
PLAIN = "what its reason names; --petsc -snes_monitor shows Newton's steps, where it takes any"


def not_converged(name: str, outcome: Outcome, has_steps: bool = True) -> NotConverged:
    """What stopped an analysis, what is kept, and what to try: of one without keys of a branch, what it says itself."""
    kept = f"{outcome.points} points are kept" if outcome.points else "nothing was solved, no results written"
    place = f"after point {outcome.points - 1}" if outcome.points else "first point"
    return NotConverged(
        f"'{name}' stopped early; {kept}",
        where=f"analysis '{name}', {place}",
        measured=outcome.reason,
        expected=outcome.goal or None,
        fix=outcome.advice or _without_steps(advice(name, outcome.reason), has_steps),
    )


def _without_steps(told: str, has_steps: bool) -> str:
    return told if has_steps or ".step." not in told else PLAIN


def without(name: str, needed: str) -> Outcome:
    """Of an analysis whose start another one was to give, which stopped before its first point."""
    reason, goal = f"'{needed}', which it starts from, has no point", f"results of '{needed}'"
    return Outcome(0, reason, False, [f"{name}: {reason}"], goal, advice=f"what lets '{needed}' begin")


def advice(name: str, reason: str) -> str:
    """What most often helps against a reason to stop."""
    if limited_by(reason):
        return _of_accuracy(name, reason)
    if "number of points" in reason:
        return f"--set {name}.step.max_points=20000, or longer steps (step.maximum)"
    if "does not fit" in reason:
        return "more memory or ranks, fewer harmonics or component modes, or fewer contact pairs"
    if FREE in reason:
        return "hold the structure where contact alone cannot (a spring, an axial stop), or load its contact more"
    if "linear solve" in reason or "LINEAR_SOLVE" in reason:
        return f"another start, or shorter steps; --petsc '-ksp_monitor -{prefix_of(name)}snes_monitor' shows why"
    if "overdamped" in reason:
        return (
            f"amplitudes at which the mode is damped less (--set {name}.amplitude=...): regularised friction is viscous"
            " at small ones, and bounded at large ones"
        )
    if NO_NUMBER in reason:
        return NUMBER
    if "at the start" in reason or "far from the linear mode" in reason:
        return (
            "another start (amplitude or frequency) where the motion is nearly linear; --petsc -snes_monitor shows why"
        )
    if LEADS_OVER in reason:
        return (
            "some damping of the structure (--set damping.zeta=1e-2, or what passes its internal resonances), or longer"
            f" steps (--set {name}.step.maximum=0.5)"
        )
    if any(ending in reason for ending in ("a closed loop", "back onto itself", "turns in circles")):
        shorter = f"--set {name}.step.initial=0.01 --set {name}.step.maximum=0.03"
        return f"{_other_end(name, reason)}shorter steps ({shorter}): one may have led onto another curve"
    if HIDES in reason:
        return "softer links (1e6 times as stiff as what they join is rigid), or one dof in place of those they join"
    if "comes back to amplitude" in reason:
        return f"--set {name}.normalise=... to a dof that goes on growing with the motion, shorter steps, or {OVER}"
    return (
        f"{_other_end(name, reason)}shorter steps (--set {name}.step.minimum=1e-11), or {OVER};"
        " --petsc -snes_monitor shows Newton's steps"
    )


def _of_accuracy(name: str, reason: str) -> str:
    """Of a branch that is whole, but not as accurate as it was to be: against what limits it most often."""
    milder = f"a milder --set {name}.accuracy=..."
    helps = {
        "reduction": f"more component modes ([reduction] modes, in place of those chosen), or {milder}",
        "solver": f"a tighter tolerance (--petsc '-snes_rtol 1e-12'), or {milder}",
        "errors": f"harmonics and samples of your own in place of {name}.accuracy",
    }
    return helps.get(limited_by(reason), milder)


def limited_by(reason: str) -> str:
    """What limits most points of a branch that is whole, but not as accurate as it was to be; else nothing."""
    return most_limiting(reason) if f"{REACHED}; accuracy" in reason else ""


def most_limiting(reason: str) -> str:
    """What limits most points of a branch that is not as accurate as it was to be, however it ended; else nothing."""
    shares = [(int(found[1]), found[2]) for found in re.finditer(r"(\d+) limited by (?:the )?(\w+)", reason)]
    return max(shares, default=(0, ""))[1]


def limited_points(reason: str, source: str) -> tuple[int, int]:
    """At how many points of its branches a source of error limits the accuracy, and how many there are."""
    limited = re.findall(rf"(\d+) limited by (?:the )?{source}\b", reason)
    points = re.findall(r"kept at \d+ of (\d+) points", reason)
    return sum(map(int, limited)), sum(map(int, points))


def _other_end(name: str, reason: str) -> str:
    """Of a response that came round to where it has been: from the other end another motion may lead through."""
    if "rad/s" not in reason or not any(ending in reason for ending in ("a closed loop", "where it began")):
        return ""
    return f"the range from its other end (--set {name}.frequency=..., the last one first), or "


def joined(failures: Sequence[NotConverged]) -> NotConverged:
    """One message for several analyses."""
    first = failures[0]
    names = "; ".join(failure.what for failure in failures)
    reasons = "; ".join(f"{failure.where}: {failure.measured}" for failure in failures)
    return NotConverged(names, None, reasons, first.expected, first.fix)
