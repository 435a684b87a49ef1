"""What lies between the points of a branch: the one reading of it, for scripts, results and pictures.

The state's columns are functions of the scalar unknowns, which lie on a cubic through the points and their tangents;
all other columns run straight from point to point. Neither PETSc nor MPI is needed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import InputError
from ..given import array_of, numbers, whole
from ..hb.states import State
from ..post.mode_curve import AT_THE_END, NO_DAMPING
from .hermite import Cubic
from .table import PLACE, Table

#: Columns that tell the branches of one table apart.
APART = ("level", "nodal_diameter")
#: Columns of the state that are looked at.
DRAWN = ("amplitude", "frequency_hz", "zeta", "phase")
#: Parts of a step in which a value is looked for on its cubic, and is drawn.
PARTS = 8
#: Of a column's change over a part of a step, what may be left at a crossing: a jump of the phase by 2 pi is none.
LEFT_OVER = 1e-6
#: What a line may be off at any rate, of a column's largest number: rounding bends it so far, on other ranks otherwise.
FLAT = 1e-9
#: Of columns that are shares or angles, as they are.
FLAT_AT_ALL = {"zeta": NO_DAMPING, "phase": FLAT}
#: Columns that tell of a point's solution, and nothing of what lies beside it.
OF_POINTS = ("point", "residual", "newton", "linear", "wall_s", "rounding", "accepted", "unclosed")


class Curve:
    """A branch between its points.

    Parameters
    ----------
    table : Table
        Its points.
    meaning : State
        What the scalars mean.
    cubic : Cubic or None
        The scalars along the branch; None where no tangents are known: every column then runs straight.
    """

    def __init__(self, table: Table, meaning: State, cubic: Cubic | None) -> None:
        self.table, self.meaning, self.cubic = table, meaning, cubic
        self.columns = [c for c in table.columns if c.kind != "s" and c.name not in OF_POINTS]

    def at(self, value: float | Sequence[float] | None = None, **where: float | Sequence[float]) -> Table:
        """Every place where the branch passes a value; see `fretwave.Branch.at`."""
        name, values = self._asked(value, where)
        return self.read([place for one in values for place in self._crossings(name, float(one))])

    def drawn(self, n: int = PARTS) -> Table:
        """All points, and n - 1 places of the cubic between two; between straight lines none is needed."""
        parts = whole(n) or 0
        if parts < 1:
            raise InputError("a step cannot be drawn in so many parts", "n", repr(n), "a whole number >= 1", "curve(8)")
        return self.read(np.arange(float(len(self.table))) if self.cubic is None else self.cubic.places(parts))

    def straight(self, error: float) -> Table:
        """All points, and so many places of the cubic between two that straight lines will do for a reader.

        Parameters
        ----------
        error : of the range that each column of the state has along the branch, that of the amplitude of a mode in
            decades; a step has at most 2 `PARTS` parts
        """
        fine = self.drawn(2 * PARTS)
        if self.cubic is None or not len(fine):
            return self._of_state(fine)
        shown = np.array([_scaled(fine, name, error) for name in DRAWN if name in self._names])
        steps = [shown[:, k : k + 2 * PARTS + 1] for k in range(0, shown.shape[1] - 1, 2 * PARTS)]
        shares = [np.arange(parts) / parts for parts in (_parts_of(step, error) for step in steps)]
        places = np.concatenate([*(k + share for k, share in enumerate(shares)), [len(self.table) - 1.0]])
        return self._of_state(self.read(places))

    def _of_state(self, table: Table) -> Table:
        """Without columns that are no functions of the unknowns, but for those that tell branches apart."""
        kept = {PLACE.name, *APART, *self._names}
        columns = [column for column in table.columns if column.name in kept]
        return Table(columns, {column.name: table[column.name] for column in columns})

    def read(self, places: Sequence[float] | Array) -> Table:
        """State and other columns at some places: 3.25 is a quarter of the step from row 3 to row 4."""
        x, rows = np.asarray(places, dtype=float), np.arange(len(self.table))
        values: dict[str, Any] = {PLACE.name: x}
        for column in self.columns:
            data = self.table[column.name]
            if column.kind == "i":  # of the last point
                values[column.name] = data[np.clip(x.astype(int), 0, None)] if len(data) else data
            else:
                values[column.name] = np.interp(x, rows, data) if len(data) else data
        if self.cubic is not None and len(x):
            states, points = self._states(x), np.flatnonzero(np.isin(x, rows))
            for name in self._names:
                values[name] = states[name]
                values[name][points] = self.table[name][x[points].astype(int)]  # to the last digit
        return Table([PLACE, *self.columns], values)

    @property
    def _names(self) -> list[str]:
        return [name for name in self.meaning.columns if name in self.table]

    def _states(self, places: Array) -> dict[str, Array]:
        """At some places, as far as the table has it; the phase, which the table may count on, next to its points'."""
        rows = np.arange(len(self.table))
        if self.cubic is None:
            return {name: np.interp(places, rows, self.table[name]) for name in self._names}
        states = self.meaning.table(self.cubic.at(places))
        if "phase" in states and "phase" in self.table:
            near = np.interp(places, rows, self.table["phase"])
            states["phase"] = states["phase"] + 2 * np.pi * np.round((near - states["phase"]) / (2 * np.pi))
        return states

    def _asked(
        self, value: float | Sequence[float] | None, where: Mapping[str, float | Sequence[float]]
    ) -> tuple[str, Array]:
        given = {**({} if value is None else {self.meaning.parameter: value}), **where}
        known = [name for name in self._names if name != "level"]
        if len(given) != 1 or not set(given) <= set(known):
            text = ", ".join(f"{name}={one}" for name, one in given.items()) or "nothing"
            raise InputError(
                "the branch cannot be read at this", None, text, "one of " + ", ".join(known), f"at({known[0]}=...)"
            )
        name = next(iter(given))
        return name, numbers(name, given[name], array_of(given[name]).shape).ravel()

    def _crossings(self, name: str, value: float) -> list[float]:
        """Places where a column of the state has this value."""
        from scipy.optimize import brentq

        def off(place: float) -> float:
            return float(self._states(np.array([place]))[name][0]) - value

        places, left = self._parts["place"], self._parts[name] - value
        for end in (0, -1):
            if abs(left[end]) <= AT_THE_END * abs(value):
                left[end] = 0.0
        found = [0.0] if left[0] == 0 else []
        for k in range(len(places) - 1):
            if left[k + 1] == 0:
                found.append(float(places[k + 1]))
            elif left[k] * left[k + 1] < 0:
                place = brentq(off, places[k], places[k + 1], xtol=1e-13)
                if abs(off(place)) <= LEFT_OVER * abs(left[k + 1] - left[k]):
                    found.append(float(place))
        return found

    @cached_property
    def _parts(self) -> Table:
        return self.drawn(PARTS)


def _scaled(table: Table, name: str, error: float) -> Array:
    """A column over its range, or over one of which an error is rounding."""
    values = np.asarray(table[name], dtype=float)
    flat = FLAT_AT_ALL.get(name, FLAT * float(np.abs(values).max(initial=0.0)))
    if name == "amplitude" and "zeta" in table and (values > 0).all():
        values, flat = np.log(values), FLAT
    return np.asarray(values / (max(float(np.ptp(values)), flat / error) or 1.0))


def _parts_of(step: Array, error: float) -> int:
    """Least number of straight lines, a power of two, that stay within an error of a step (k, 2 PARTS + 1)."""
    share = np.arange(step.shape[1])
    for width in (2 * PARTS >> k for k in range((2 * PARTS).bit_length() - 1)):
        ends = share[::width]
        if all(np.abs(np.interp(share, ends, row[ends]) - row).max() <= error for row in step):
            return 2 * PARTS // width
    return 2 * PARTS
