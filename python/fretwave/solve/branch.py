"""A branch as an object: its table, its events, and the cubic that runs through its points.

Neither PETSc nor MPI is needed to read one.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..columns import Column
from ..errors import FretwaveError, InputError
from ..hb.states import State
from ..mpi.destroyable import Destroyed
from .curve import PARTS, Curve
from .hermite import Cubic
from .table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpi4py import MPI
    from petsc4py import PETSc

    from ..hb.harmonic_problem import HarmonicProblem
    from .unknowns import Unknowns


class Event(NamedTuple):
    """What was met on a branch, and at which row: start, stop, report, fold, peak, zero_damping or peak_damping."""

    name: str
    row: int


class Branch(Table):
    """A branch of nonlinear modes or forced responses, as `fretwave.follow` returns it.

    Columns by name (``branch["zeta"]``), rows by number (``branch[3]``), the same as in the CSV of a run.

    Attributes
    ----------
    converged : bool
        It ended as asked.
    reason : str
        Why it ended.
    missed : list of str
        Reports and events that could not be had, each with its reason.
    started : str
        How the first point was found, where Newton did not find it from the first guess.
    meaning : State
        What its scalar unknowns mean.
    curves : Cubic
        The scalar unknowns along the branch.
    """

    def __init__(
        self,
        columns: Sequence[Column],
        values: Mapping[str, Any],
        meaning: State,
        curves: Cubic,
        converged: bool,
        reason: str,
        missed: Sequence[str] = (),
        started: str = "",
        unknowns: Unknowns | None = None,
        comm: MPI.Comm | None = None,
    ) -> None:
        super().__init__(columns, values)
        self.meaning, self.curves = meaning, curves
        self.converged, self.reason, self.missed, self.started = converged, reason, list(missed), started
        self._unknowns, self._comm = unknowns, comm

    @property
    def events(self) -> list[Event]:
        """What was met, in order."""
        return [Event(name, row) for row, text in enumerate(self["event"]) for name in text.split()]

    def met(self, event: str) -> list[int]:
        """Rows at which an event was met."""
        return [row for name, row in self.events if name == event]

    def at(self, value: float | Sequence[float] | None = None, **where: float | Sequence[float]) -> Table:
        """Every place where the branch passes a value, with the state there.

        Read off the cubic through the two points beside it and their tangents, on which the unknowns lie, so that the
        error falls with the fourth power of the step. Two crossings within an eighth of a step, about an extremum that
        is no event, may be missed. Columns that are no functions of the scalar unknowns (`slip`) run straight
        between the points.

        Parameters
        ----------
        value : float or sequence
            Of the continuation parameter: amplitude of a mode, omega of a response.
        where : one column of the state and its value, in place of `value`
            ``branch.at(zeta=0.02)``.

        Returns
        -------
        Table
            One row per crossing in the order of the branch, value by value: several where it folds, none where it does
            not pass. Column `place` is for `unknowns` and `coefficients`.

        Raises
        ------
        InputError
            No such column, or a branch without points.
        """
        if not len(self):
            raise InputError(
                "the branch has no points", None, self.reason, "one at least", "find a first point: other start or stop"
            )
        return self._curve.at(value, **where)

    def curve(self, n: int = PARTS) -> Table:
        """The branch for drawing: its columns at every point, and at n - 1 places of the cubic between two points."""
        return self._curve.drawn(n)

    @cached_property
    def _curve(self) -> Curve:
        return Curve(self, self.meaning, self.curves)

    @property
    def problem(self) -> HarmonicProblem:
        """What it is a branch of; where harmonics changed along it, with the most that were taken.

        Raises
        ------
        InputError
            As of `unknowns`.
        """
        return self._kept().problem

    def unknowns(self, place: float) -> PETSc.Vec:
        """Unknowns y at a place (`at`, or a row's number), a Vec of the caller's: where Newton may start. Collective.

        Raises
        ------
        InputError
            They were not kept, or the branch was loaded from a file.
        """
        return self._kept().vector(place)

    def coefficients(self, place: float) -> Array | None:
        """Harmonic coefficients (n_dof, m) [length] at a place, columns `harmonics.labels`, on rank 0. Collective."""
        kept = self._kept()
        y = kept.vector(place)
        found: Array | None = kept.problem.coefficients(y)
        y.destroy()
        return found

    def shape(self, place: float, order: int = 1) -> npt.NDArray[np.complex128]:
        """Complex amplitudes q_n (n_dof,) [length] of a harmonic at a place, on every rank. Collective.

        x = Re sum q_n e^{i n tau}.

        Raises
        ------
        InputError
            The harmonic is not retained, or as of `unknowns`.
        """
        kept = self._kept()
        labels, Q = kept.problem.harmonics.labels, self.coefficients(place)
        first = str(order) if order == 0 else f"{order}c"
        if first not in labels:
            raise InputError("this harmonic is not retained", None, order, ", ".join(labels), "take one that is")
        Q = kept.problem.model.comm.bcast(Q)
        column = labels.index(first)
        return np.asarray(Q[:, column] - (1j * Q[:, column + 1] if order else 0))

    def __getstate__(self) -> dict[str, Any]:
        """Unknowns stay where they are: a branch travels between ranks without them."""
        return {**self.__dict__, "_unknowns": None, "_comm": None}

    def __copy__(self) -> Branch:
        """On the same rank: with the unknowns."""
        other = type(self).__new__(type(self))
        other.__dict__.update({name: value for name, value in self.__dict__.items() if name != "_curve"})
        return other

    def __deepcopy__(self, memo: dict[int, Any]) -> Branch:
        """Unknowns, which nobody changes, and their problem are those of this one."""
        other = copy.copy(self)
        memo.update({id(self): other, id(self._unknowns): self._unknowns, id(self._comm): self._comm})
        other.__dict__.update(copy.deepcopy(other.__dict__, memo))
        return other

    def plot(self) -> Figure:
        """Frequency and damping over amplitude of a mode, amplitude and phase over frequency of a response.

        Drawn along the cubic, points and events on it. `figure.savefig` writes it.
        """
        from ..plots.branch import draw

        return draw(self)

    def save(self, path: str | Path) -> None:
        """Write it as HDF5 that netCDF readers (xarray) open as well; rank 0 writes. Collective.

        All but the unknowns is kept: table, events, and the curve.
        """
        from .branch_file import write

        self._once(lambda: write(self, Path(path)))

    @classmethod
    def load(cls, path: str | Path) -> Branch:
        """The branch of a file that `save` wrote."""
        from .branch_file import read

        return read(cls, Path(path))

    def to_csv(self, path: str | Path) -> None:
        """Write its table as that of a run is written; rank 0 writes. Collective."""
        self._once(lambda: super(Branch, self).to_csv(path))

    def to_xarray(self) -> Any:
        """Its table as `xarray.Dataset` over the dimension `point`; xarray must be installed."""
        import xarray  # type: ignore[import-not-found,unused-ignore]

        return xarray.Dataset(
            {c.name: ("point", self[c.name], c.attributes) for c in self.columns if c.name != "point"},
            coords={"point": self["point"]},
            attrs={"converged": int(self.converged), "reason": self.reason},
        )

    def __repr__(self) -> str:
        ended = "as asked" if self.converged else "before its end"
        lines = [f"Branch of {len(self)} points, ended {ended}: {self.reason}", self.text()]
        return "\n".join([*lines, *(f"missed: {text}" for text in self.missed)])

    def _kept(self) -> Unknowns:
        if self._unknowns is None:
            fix = "follow it with unknowns=True (the default) in this script"
            raise InputError("the branch has no unknowns", None, "its table and its curve alone", None, fix)
        if isinstance(self._unknowns.problem.core, Destroyed):
            raise InputError("the branch's problem has been destroyed", fix="read the branch before problem.destroy()")
        return self._unknowns

    def _once(self, write: Callable[[], None]) -> None:
        """On one rank; what it raises is raised on all."""
        error: FretwaveError | None = None
        if self._comm is None or self._comm.rank == 0:
            try:
                write()
            except FretwaveError as found:
                error = found
        if self._comm is not None:
            error = self._comm.bcast(error)
        if error is not None:
            raise error
