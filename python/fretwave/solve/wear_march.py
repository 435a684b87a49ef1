"""A march over wear cycles as an object: its table, and the worn depths of all pairs at its points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..arrays import Array
from ..columns import MODAL, Column, columns_named
from ..errors import InputError
from ..given import positive
from ..hb.nonlinear_mode import NonlinearMode
from ..kinds import of_their_kinds
from ..mpi.same import expect_same
from .branch import Branch
from .continuation import reports_of
from .steps import WearControl
from .table import Table
from .wear import Wear, WearPoint
from .worn_mode import WornMode

#: What the table of a march says beside its points' own numbers.
STATE = (*MODAL, "stick", "slip", "open", "work", "energy_error")
SOLVER = ("step_error", "force_outside", "residual", "newton", "linear", "event")
COLUMNS = columns_named(["cycles", "vibrations", "step", "amplitude", *STATE, *SOLVER])


class WearMarch(Table):
    """A mode at fixed amplitude over wear cycles, as `fretwave.wear` returns it.

    Attributes
    ----------
    contacts : dict
        Contact name -> where its pairs stand in the arrays.
    depth, rate, load : (n_points, n_pairs) [length], [length], [force]
        Worn depth of the pairs of all wearing contacts, its growth in a vibration cycle, mean normal force.
    areas : (n_pairs,) [length^2]
    cycle_unit : float
        Vibration cycles in a normalised one.
    converged : bool
        It ended as asked.
    reason : str
        Why it ended.
    missed : list of str
        Reports that were asked for and not met, each with its reason.
    """

    def __init__(
        self,
        columns: Sequence[Column],
        values: Mapping[str, Any],
        *,
        contacts: dict[str, slice],
        depth: Array,
        rate: Array,
        load: Array,
        areas: Array,
        cycle_unit: float,
        converged: bool,
        reason: str,
        missed: Sequence[str] = (),
    ) -> None:
        super().__init__(columns, values)
        self.contacts = contacts
        self.depth, self.rate, self.load = depth, rate, load
        self.areas = areas
        self.cycle_unit = cycle_unit
        self.converged, self.reason, self.missed = converged, reason, list(missed)

    @property
    def volume(self) -> Array:
        """Worn volume (n_points,) [length^3]."""
        return np.asarray(self.depth @ self.areas)

    def __repr__(self) -> str:
        ended = "as asked" if self.converged else "before its end"
        lines = [f"WearMarch of {len(self)} points, ended {ended}: {self.reason}", self.text()]
        return "\n".join([*lines, *(f"missed: {text}" for text in self.missed)])


@of_their_kinds
def wear(
    branch: Branch,
    amplitude: float,
    coefficient: float,
    areas: Mapping[str, Array],
    cycles: float,
    *,
    cycle_unit: float | None = None,
    control: WearControl | None = None,
    report_at: Sequence[float] = (),
    errors: bool | None = None,
    tell: Callable[[dict[str, Any]], None] | None = None,
) -> WearMarch:
    """March a mode over wear cycles at an amplitude of its unworn branch. Collective.

    The surfaces are new again afterwards.

    Parameters
    ----------
    branch : Branch
        Of a nonlinear mode, with its unknowns.
    amplitude : float [length]
        The first place of the branch there.
    coefficient : float [1/pressure]
        k_w.
    areas : dict
        Contact name -> nodal areas (n_pairs,) [length^2]; contacts without an entry do not wear.
    cycles, report_at : float, sequence of float
        Where to stop, and where points shall lie; in normalised cycles, as all cycles here.
    cycle_unit : float, optional
        Vibration cycles in a normalised one; by default those in which sliding four stick limits a cycle leaves 1/e of
        a normal load (`WornMode.normal_cycle`), with the loads of the branch's first point.
    control : WearControl, optional
    errors : bool, optional
        Estimate those of the mode (`HarmonicProblem.errors`) at every point, or at none; by default at the first, the
        reported and the last. They are at its depths: what these are off by is not in them. Else they are nan.
    tell : callable, optional
        Given every row when it is found, on every rank.

    Raises
    ------
    InputError
        The branch is of no mode or does not pass the amplitude, a contact cannot wear, a number is not above zero, the
        cycles are no number of vibrations, or the ranks are given different numbers.
    StageFailed
        Newton does not find the start.
    """
    problem = branch.problem
    if not isinstance(problem, NonlinearMode):
        what, fix = "the branch is not that of a mode", "follow a fw.NonlinearMode for it"
        raise InputError(what, "wear(branch=...)", repr(problem), "a NonlinearMode", fix)
    amplitude, reports = positive("amplitude", amplitude), reports_of(report_at)
    asked = [amplitude, coefficient, cycles, cycle_unit or 0.0, -1.0 if errors is None else errors, *reports]
    expect_same(problem.model.comm, "amplitude, coefficient, cycles and reports of wear", asked)
    places = branch.at(amplitude=amplitude)
    if not len(places):
        length = branch.units["amplitude"]
        span = f"{branch['amplitude'].min():g} to {branch['amplitude'].max():g} {length}"
        measured = f"{amplitude:g} {length}"
        raise InputError("the branch does not pass this amplitude", None, measured, span, "take one within")
    first, guess = branch.unknowns(0), branch.unknowns(float(places["place"][0]))
    rows, states = [], []
    with WornMode(problem, coefficient, areas) as mode:
        unworn = np.zeros(len(mode.areas))
        given = None if cycle_unit is None else positive("cycle_unit", cycle_unit)
        unit = mode.cycle_unit(mode.measure(first, unworn).load, cycles, given)
        new = mode.solve(unworn, guess)
        for vector in (first, guess):
            vector.destroy()
        outcome = (new.newton, new.linear, new.residual)
        march = Wear(mode, new.y, unit * cycles, control, [unit * value for value in reports], outcome=outcome)
        new.y.destroy()
        for point in march:
            rows.append(problem.model.comm.bcast(wear_row(mode, point, unit, errors)))
            states.append((point.state.depth, point.state.rate, point.state.load))
            if tell is not None:
                tell(rows[-1])
        march.state.y.destroy()
        names = [problem.model.contacts[k].name for k in mode.contacts]
        contacts, sizes = dict(zip(names, mode.slices)), mode.areas
    depth, rate, load = (np.array(part) for part in zip(*states))
    return WearMarch(
        columns_named(COLUMNS, branch.unit_system),
        {c.name: [row[c.name] for row in rows] for c in COLUMNS},
        contacts=contacts,
        depth=depth,
        rate=rate,
        load=load,
        areas=sizes,
        cycle_unit=unit,
        converged=march.converged,
        reason=march.reason,
        missed=march.missed(unit),
    )


def wear_row(mode: WornMode, point: WearPoint, unit: float, errors: bool | None = None) -> dict[str, Any]:
    """What the table of a march says of a point; `errors` as `wear` takes them. Collective."""
    y, problem = point.state.y, mode.problem
    energy = problem.energy(y)
    return {
        **problem.state(y),
        **mode.errors(point.state, bool(point.event) if errors is None else errors),
        **problem.diagnostics(y),
        "cycles": point.cycles / unit,
        "vibrations": point.cycles,
        "step": point.step / unit,
        "work": energy["contact"],
        "energy_error": energy["error"],
        "step_error": point.error,
        "residual": point.state.residual,
        "newton": point.newton,
        "linear": point.linear,
        "event": point.event,
    }
