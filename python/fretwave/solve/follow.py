"""Follow a problem's branch to its end and keep what was found."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..columns import FORCED, MODE, columns_named, over, with_discretisation
from ..errors import InputError
from ..given import array_of, numbers, real
from ..hb.harmonic_problem import HarmonicProblem
from ..hb.observed import Observed, unit_of
from ..hb.observer import Observer
from ..kinds import of_their_kinds
from ..mpi.same import expect_same
from .branch import Branch
from .continuation import reports_of
from .point import Point, points_of
from .refining import keeping
from .steps import StepControl
from .table import Table
from .trace import Knot, Trace, cubic_of
from .unknowns import Unknowns

#: Relative: a start so near to an end of its range lies on it.
AT_AN_END = 1e-9


@of_their_kinds
def follow(
    problem: HarmonicProblem,
    start: float | PETSc.Vec,
    stop: float | tuple[float, float],
    *,
    steps: StepControl | None = None,
    report_at: Sequence[float] = (),
    unknowns: bool = True,
    errors: bool = True,
    accuracy: float | None = None,
    observe: Mapping[str, Observed | str] | None = None,
    tell: Callable[[dict[str, Any]], None] | None = None,
) -> Branch:
    """Follow a nonlinear mode over its amplitude, or a forced response over its frequency. Collective.

    The table of the branch is on every rank, the unknowns stay where they are. Nothing is left to be destroyed.

    Parameters
    ----------
    start : float or Vec
        Amplitude [length] or omega [rad/s] of the first point, or unknowns from which Newton finds it.
    stop : float or (low, high)
        Where the branch shall end: beyond the start in its direction, or the range that it shall not leave.
    steps : StepControl, optional
        Lengths of its steps.
    report_at : sequence of float
        Amplitudes or omegas at which points are located; `Branch.missed` tells those outside the range.
    unknowns : bool
        Keep the unknowns of all points (2 x 8 bytes for each of every point's), for `Branch.unknowns` and
        `Branch.coefficients`.
    errors : bool
        Estimate the errors of every point (`HarmonicProblem.errors`); their columns are nan without.
    accuracy : float, optional
        Relative, of zeta and omega of a mode (zeta below 1e-4: of that), of the complex amplitude of a response: the
        branch takes as many harmonics and samples as that needs, no less than the problem's, and other ones along its
        way (columns `harmonics` and `samples`). It is converged if no more than 5 % of its points miss it by their
        estimated error: by the distance from the true branch, in these and the parameter. Where the branch is steep
        the error at the same parameter is larger.
    observe : dict, optional
        Further columns by name: the fundamental's amplitude of a dof, of a row (n_dof,) or of a linear mode's
        coordinate, or "energy", the mechanical energy of the vibration, mean over a period [energy].
    tell : callable, optional
        Given every row when it is found, on every rank: a dict by column, with the other `diagnostics`.

    Returns
    -------
    Branch
        Also where the branch breaks off, or has no first point: `converged` and `reason` say so.

    Raises
    ------
    InputError
        The range is empty, the start is not in it, or the problem is none of these; a contact has changed since its
        model was made; the ranks are given different ends, reports or steps.

    Examples
    --------
    A mass on a spring of 4 N/m and one of 5 N/m that slips at 1 N:

    >>> import fretwave as fw
    >>> slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 5.0, "friction_limit": 1.0})
    >>> model = fw.Model([[1.0]], [[4.0]], contacts=[slider])
    >>> mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 1))
    >>> branch = fw.follow(mode, 0.1, 4.0)
    >>> branch.reason
    'stop value reached'
    >>> [f"{omega:.2f}" for omega in branch.at([0.15, 2.0])["omega"]]  # stuck: sqrt(4 + 5)
    ['3.00', '2.07']
    >>> branch.events[-1]
    Event(name='stop', row=...)
    """
    if not isinstance(problem, HarmonicProblem) or problem.meaning is None:
        given, fix = type(problem).__name__, "give one of these; fw.Continuation follows others"
        raise InputError("the problem has no branch with a table", None, given, "NonlinearMode or ForcedResponse", fix)
    accuracy = None if accuracy is None else _accuracy(accuracy)
    problem.model.check_unchanged()
    own = isinstance(start, PETSc.Vec)
    first = problem.parameter(start) if own else float(numbers("start", start))
    y0: PETSc.Vec = start if own else problem.initial(first)
    low, high, upwards = _range(first, stop)
    reports = reports_of(report_at)
    expect_same(problem.model.comm, "accuracy, errors and unknowns of a branch", [accuracy or 0.0, errors, unknowns])
    settings: dict[str, Any] = {"stop": (low, high), "steps": steps, "report_at": reports, "upwards": upwards}
    kind, asked = keeping(accuracy)
    continuation = kind(problem, y0, **settings, **asked)
    kept = Unknowns(problem, unknowns)
    trace = Trace(problem, kept)
    observer = Observer(problem, observe or {})
    rows: list[dict[str, Any]] = []
    knots: list[Knot] = []
    for point in points_of(continuation):
        now = continuation.problem
        knots.append(trace.add(point.y, point.tangent, now))
        # each rank has measured its own wall time
        seen = observer(point.y, now) if observe else {}
        rows.append(problem.model.comm.bcast({**row_of(now, point, len(rows), errors), **seen}))
        if tell is not None:
            tell(rows[-1])
    missed = [*continuation.missed, *_outside(reports, low, high, [row[problem.meaning.parameter] for row in rows])]
    ended = continuation.converged, continuation.reason, missed, continuation.started
    trace.close(continuation.largest)
    continuation.destroy()
    if not own:
        y0.destroy()
    names = MODE if problem.meaning.kind == "mode" else FORCED
    known = columns_named(names if accuracy is None else with_discretisation(names))
    columns = columns_named([*over(known, unit_of(problem.dof)), *observer.columns], problem.model.units)
    table = Table.of_rows(columns, rows)
    values = {name: table[name] for name in table.names}
    curves = cubic_of(knots)
    return Branch(columns, values, problem.meaning, curves, *ended, kept if unknowns else None, problem.model.comm)


def row_of(problem: HarmonicProblem, point: Point, number: int, errors: bool = True) -> dict[str, Any]:
    """What the table of a branch says of a point; `errors` are estimated, or nan. Collective."""
    return {
        **problem.state(point.y),
        **(point.errors or problem.errors(point.y, point.tangent if errors else None)),
        **problem.diagnostics(point.y),
        "point": number,
        "residual": point.residual,
        "newton": point.newton,
        "linear": point.linear,
        "wall_s": point.wall_s,
        "rounding": point.rounding,
        "accepted": point.accepted,
        "harmonics": problem.harmonics.orders[-1],
        "samples": problem.harmonics.samples,
        "event": point.event,
    }


def _accuracy(given: object) -> float:
    """A share."""
    found = real(given)
    if found is None or not 0 < found < 1:
        fix = "give for example accuracy=1e-3"
        raise InputError("accuracy is a share of what is computed", None, repr(given), "above 0, below 1", fix)
    return found


def _range(first: float, stop: float | tuple[float, float]) -> tuple[float, float, bool | None]:
    """Ends of the range, and whether the parameter grows at first (None: away from the nearer end)."""
    ends = array_of(stop)
    if ends.shape not in ((), (2,)) or ends.dtype.kind not in "biuf" or not (ends >= 0).all():
        expected, fix = "a number >= 0, or two: (low, high)", "say where the branch shall end"
        raise InputError("a branch cannot end there", "stop", repr(stop), expected, fix)
    if not ends.shape:
        return min(first, float(ends)), max(first, float(ends)), float(ends) > first
    low, high = ends.astype(float).tolist()
    if low < high and not low * (1 - AT_AN_END) <= first <= high * (1 + AT_AN_END):
        fix = "start within it, or give the end alone: stop=high"
        raise InputError("the branch begins outside its range", None, first, f"{low:g} to {high:g}", fix)
    return low, high, None


def _outside(reports: Sequence[float], low: float, high: float, met: Sequence[float]) -> list[str]:
    """What is said of reports outside the range; a branch that folds back over its first end may have met one."""
    far = [value for value in reports if not low * (1 - AT_AN_END) <= value <= high * (1 + AT_AN_END)]
    unmet = [value for value in far if not np.isclose(met, value, rtol=AT_AN_END, atol=0.0).any()]
    return [f"report at {value:.6g}: outside the range, {low:.6g} to {high:.6g}" for value in unmet]
