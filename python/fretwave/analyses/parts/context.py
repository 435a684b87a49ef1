"""What an analysis gets from the runner, and what it gives back."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Optional, TypeVar

import numpy as np

from ...arrays import Array
from ...case.analysis import AnalysisSection
from ...case.harmonic import nodal_diameter, with_flow_forces
from ...case.kept import has_analysis, serves
from ...case.load import Case
from ...columns import Column, Value, headings
from ...console import Console
from ...errors import InputError
from ...files.csv_table import write_columns
from ...model.structure import Structure
from ...mpi.guard import on_first_rank
from ...mpi.petsc_share import prefix_of
from ...post.mode_curve import ModeCurve
from ...registry import file_of
from ...results.analysis import own_curve
from ...results.reader import write_curve
from ...results.results import AnalysisWriter, Field, open_results
from ...texts import counted, display
from ...units import ATTRIBUTE, UnitSystem

if TYPE_CHECKING:
    import h5py
    from mpi4py import MPI

    from ...model.model import Model
    from ...model.modes import LinearMode

Section = TypeVar("Section", bound=AnalysisSection, covariant=True)
Other = TypeVar("Other", bound=AnalysisSection)
Found = TypeVar("Found")


@dataclass
class Outcome:
    """How an analysis ended.

    Attributes
    ----------
    points : int
        Rows of its table.
    reason : str
        Why it ended, in the solver's words.
    converged : bool
        False when it ended before its goal; what was found is kept.
    summary : list of str
        Lines to print.
    goal : str
        What it was to reach, for the message when it did not.
    advice : str
        What to do when it did not; empty for what usually helps.
    """

    points: int
    reason: str
    converged: bool
    summary: list[str] = field(default_factory=list)
    goal: str = ""
    advice: str = ""


def outcome_of(analysis: AnalysisSection, found: object) -> Outcome:
    """What an analysis has returned.

    Raises
    ------
    InputError
        It is no outcome.
    """
    if not isinstance(found, Outcome):
        what, where = f"`run` of the analysis '{analysis.name}' returned no outcome", file_of(type(analysis))
        fix = 'return for example fw.Outcome(writer.rows, "all points", True)'
        raise InputError(what, where, type(found).__name__, "a fretwave.Outcome", fix)
    return found


@dataclass
class AnalysisContext(Generic[Section]):
    """Everything an analysis needs; the same on every rank.

    Attributes
    ----------
    model : fretwave.Model
        With the analysis' dampers (for time integration without any: those of its mode analysis).
    case : Case
        Names, matrices and all analyses of the case.
    analysis : AnalysisSection
        This analysis, or one whose settings it uses.
    resuming : bool
        Go on from the last state, if there is one.
    before_first : callable
        Run on every rank before the first row is written.
    attributes : dict
        Put on the group of the results.
    left_out : list of str
        What this analysis does not compute, and why; filled by :meth:`leave_out`.
    arrays : dict
        Arrays [length] put into the group of the results.
    fields : dict
        Arrays that every row of the table brings.
    entry : dict
        What else run.json says of the analysis.
    writers : list of AnalysisWriter
        Its tables; the runner publishes them when all else that belongs to the analysis is written.
    afterwards : list of callable
        Done after that on the writing rank (to clean up).
    """

    model: Model
    case: Case
    analysis: Section
    comm: MPI.Comm
    folder: Path
    console: Console
    resuming: bool = False
    before_first: Callable[[], None] = lambda: None
    attributes: dict[str, Any] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    arrays: dict[str, Any] = field(default_factory=dict)
    fields: dict[str, Field] = field(default_factory=dict)
    entry: dict[str, Any] = field(default_factory=dict)
    writers: list[AnalysisWriter] = field(default_factory=list)
    afterwards: list[Callable[[], None]] = field(default_factory=list)

    def __repr__(self) -> str:
        ranks = counted(self.comm.size, "rank")
        return f"AnalysisContext('{self.name}' of {self.case.name}, on {ranks}, in {self.folder})"

    @property
    def name(self) -> str:
        return self.analysis.name

    @property
    def rows(self) -> int:
        """Rows of its table so far."""
        return max((writer.rows for writer in self.writers), default=0)

    @property
    def units(self) -> UnitSystem:
        """The system that all numbers are in; ``units("length")`` is its symbol of a length."""
        return self.case.units

    @property
    def wheel(self) -> Structure:
        """Of an analysis of a whole wheel."""
        assert self.case.wheel is not None
        return self.case.wheel

    @property
    def tuned(self) -> Case:
        """Of an analysis of a whole wheel: the case of the tuned sector."""
        assert self.case.sector is not None
        return self.case.sector

    @property
    def prefix(self) -> str:
        """Prefix of the PETSc options."""
        return prefix_of(self.analysis.name)

    def of(self, analysis: Other, **changes: Any) -> AnalysisContext[Other]:
        """The same for another analysis, with other changes."""
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        return AnalysisContext(**{**given, **changes, "analysis": analysis})

    def leave_out(self, reasons: Sequence[str]) -> None:
        """Say in one line what is left out and why."""
        self.left_out.extend(reasons)
        if self.left_out:
            self.console.detail(f"{self.name}: left out: {'; '.join(self.left_out)}")

    def writer(
        self,
        columns: Sequence[str | Column],
        labels: Sequence[str] = (),
        **attributes: Value | None,
    ) -> AnalysisWriter:
        """The table of this analysis; see :class:`fretwave.results.results.AnalysisWriter`.

        Parameters
        ----------
        columns : sequence of str or Column
            Known names or columns of its own.
        labels : sequence of str
            Harmonic labels, when coefficients are kept.
        attributes
            Further attributes of the group.

        Raises
        ------
        InputError
            The analysis has its table already.
        """
        if any(writer.name == self.name for writer in self.writers):
            what, fix = f"the analysis '{self.name}' asks for a second table", "write its further arrays by `dataset`"
            raise InputError(what, file_of(type(self.analysis)), "2 calls of `writer`", "1", fix)
        described = {key: value for key, value in attributes.items() if value is not None}
        writer = AnalysisWriter(
            self.folder,
            self.name,
            columns,
            {**self.attributes, ATTRIBUTE: self.units.name, "left_out": json.dumps(self.left_out), **described},
            dofs=self.case.dofs,
            labels=labels,
            active=self.comm.rank == 0,
            before_first=self.before_first,
            file_attributes={"title": self.case.title, ATTRIBUTE: self.units.name},
            arrays=self.arrays,
            fields=self.fields,
            publish_later=True,
        )
        self.writers.append(writer)
        return writer

    def write_curves(self) -> None:
        """The branches of its tables once more, for readers without the cubic. Collective."""

        def write() -> None:
            for writer in self.writers:
                if writer.rows:
                    write_curve(writer.group, self.folder)

        on_first_rank(self.comm, write)

    def publish(self, outcome: Outcome) -> None:
        """The analysis is done, with all its tables: its results take their place. Collective.

        A table that the analysis has not closed ends as the analysis did.
        """

        def finish() -> None:
            for writer in self.writers:
                if not writer.closed:
                    writer.close("done" if outcome.converged else "stopped", outcome.reason)
                writer.publish()
            for work in self.afterwards:
                work()

        on_first_rank(self.comm, finish)

    def forget(self) -> None:
        """Leave nothing of its tables to go on with. Collective."""

        def remove() -> None:
            for writer in self.writers:
                writer.forget()

        on_first_rank(self.comm, remove)

    def table(self, name: str) -> dict[str, Any]:
        """Columns of a finished analysis (``event`` included) on every rank. Collective.

        Raises
        ------
        InputError
            It has no results in the run folder.
        """
        return on_first_rank(self.comm, lambda: self._read(name, _columns))

    def coefficients(self, name: str, points: Optional[Sequence[int]] = None) -> tuple[list[str], Array]:
        """Harmonic labels and coefficients (points, n_dof, m) of a finished analysis. Collective."""

        def read(group: h5py.Group) -> tuple[list[str], Array]:
            labels = [text.decode() for text in group["harmonic"][()]]
            data = group["coefficients"]
            return labels, data[()] if points is None else np.stack([data[point] for point in points])

        return on_first_rank(self.comm, lambda: self._read(name, read))

    def curve(self, name: str) -> ModeCurve:
        """The curve of a finished mode, through places of its branch's own cubic between its points. Collective."""
        return on_first_rank(self.comm, lambda: self._read(name, lambda group: own_curve(group, self.folder)))

    def has_results(self, name: str) -> bool:
        """Whether an analysis has finished results in the run folder that belong to this very case. Collective."""
        return on_first_rank(self.comm, lambda: has_analysis(self.folder, self.case, name))

    def write_table(self, suffix: str, columns: Mapping[str, Any], lengths: str = "length") -> None:
        """A further table ``<name>_<suffix>.csv``, written as a whole by rank 0.

        Parameters
        ----------
        lengths : unit of its amplitudes, as a quantity
        """
        if self.comm.rank == 0:
            arrays = {name: np.asarray(values) for name, values in columns.items()}
            known = headings(columns, self.units, lengths)
            write_columns(self.folder / f"{self.name}_{suffix}.csv", arrays, known)

    def _read(self, name: str, what: Callable[[h5py.Group], Found]) -> Found:
        with open_results(self.folder / "results.h5") as file:
            if not serves(file, self.case, name):
                raise InputError(
                    f"'{self.name}' needs the results of '{name}'",
                    where=display(self.folder),
                    measured=f"no finished results of '{name}' for this case",
                    fix=f"--only {name},{self.name}",
                )
            return what(file[name])

    def linear_mode(self, contact: str, count: int = 1, near: float | None = None) -> list[LinearMode]:
        """Linear modes, the contact ``stuck`` or ``free``, without forces of the flow. Collective.

        With stuck contact the structure has to be stable.

        Parameters
        ----------
        near : frequency [rad/s] that they are nearest to, in place of the lowest
        """
        from ...model.modes import linear_modes

        stable = contact == "stuck"
        if not with_flow_forces(self.analysis):
            return linear_modes(self.model, count, contact, near, stable)
        from ...case.build import build_model

        preload, diameters = self.case.preload_of(self.analysis), nodal_diameter(self.analysis)
        with build_model(self.case, (), self.comm, preload, diameters) as structure:
            if self.model.at_rest is not None:
                structure.settle(self.model.at_rest)
            return linear_modes(structure, count, contact, near, stable)

    def numbered(self, modes: list[LinearMode], number: int) -> LinearMode:
        """The one of this number, from 1, of linear modes."""
        if len(modes) >= number:
            return modes[number - 1]
        raise InputError(
            f"there is no linear mode {number}",
            where=f"analysis '{self.name}'",
            measured=f"{len(modes)} that the contact leaves",
            expected=f"at least {number}",
            fix=f"linear_mode = {len(modes)} or less",
        )


def _columns(group: h5py.Group) -> dict[str, Any]:
    table = {name: data[()] for name, data in group["points"].items()}
    if "event" in table:
        table["event"] = np.array([text.decode() for text in table["event"]])
    return table
