"""One analysis of a run folder: its table, and what results.h5 keeps of its points."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..columns import PURE, table_order
from ..errors import InputError
from ..files.dimensions import names_of_data
from ..given import whole
from ..hb.states import State
from ..model.law_info import UNKNOWN, Role, kept_laws
from ..post.mode_curve import ModeCurve
from ..post.motion import motion
from ..solve.curve import PARTS, Curve
from ..solve.table import Table as Reading
from ..units import UnitSystem, units_of
from .file import has_results, open_results
from .slopes import curves_of, read_slopes

if TYPE_CHECKING:
    import h5py

Table = dict[str, Array]
#: Of a column's range, what straight lines between the rows of <name>_curve.csv are off at most.
CURVE = 1e-3
#: Dataset of the weights of the dofs in an amplitude that is of no dof.
ROW = "amplitude_row"


@dataclass
class Analysis:
    """One analysis of a finished or running run.

    Attributes
    ----------
    columns : numbers of its table, one array per column
    events : what was met at each point, "" for nothing
    words : further columns that are no numbers
    labels : of the harmonic coefficients, e.g. "1c", "1s"
    dofs : names of the degrees of freedom
    reported : points for which the contacts' motion is kept
    contacts : names of the contacts
    meaning : of the scalar unknowns, of an analysis that follows branches
    slopes : (n_points, 2, k), their derivatives by the share of the step that ends at each point, at its begin and end
    """

    name: str
    kind: str
    columns: Table
    events: list[str]
    attributes: dict[str, Any] = field(default_factory=dict)
    labels: list[str] = field(default_factory=list)
    dofs: list[str] = field(default_factory=list)
    reported: list[int] = field(default_factory=list)
    contacts: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    path: Path = Path()
    meaning: State | None = None
    slopes: Array | None = None
    words: dict[str, list[str]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __getitem__(self, column: str) -> Any:
        """A column of the table, "event" and others of words among them; a copy that may be changed."""
        words = {**self.words, "event": self.events}
        if column in words:
            return np.array(words[column])
        if column not in self.columns:
            raise KeyError(f"no column '{column}' in '{self.name}'; there are {', '.join(self.columns)}")
        return np.array(self.columns[column])

    def __repr__(self) -> str:
        status = self.attributes.get("status", "")
        return f"Analysis('{self.name}', {self.kind}, {len(self)} points, {status}: {', '.join(self.columns)})"

    def coefficients(self, points: Sequence[int] | None = None) -> Array:
        """Harmonic coefficients (len(points), n_dof, m) [length] of some points or all; axes as `dofs` and `labels`."""
        with open_results(self.path) as file:
            found = file[self.name]["coefficients"]
            if points is None:
                return np.asarray(found)
            numbers = [whole(point) for point in points] if isinstance(points, Iterable) else [None]
            rows = [found[number] for number in numbers if number is not None and -len(found) <= number < len(found)]
            if len(rows) < len(numbers) or not rows:
                expected, fix = f"a list of numbers below {len(found)}", "give for example [0]"
                raise InputError("these are no points of the analysis", self.name, repr(points), expected, fix)
            return np.stack(rows)

    def loop(self, contact: str, point: int) -> Table:
        """Motion of a contact over one period: u, v, f (n_samples, components, n_pairs).

        With them what is kept of its law's word on each pair and sample, status and gap (n_samples, n_pairs), and of
        the whole period, work (n_pairs) [energy] and shares of stick, slip and open (3, n_pairs).
        """
        row = self.reported.index(point)
        with open_results(self.path) as file:
            group = file[self.name]["contact_" + contact]
            return {key: np.asarray(group[key][row], dtype=float) for key in names_of_data(group)}

    def tells_status(self, contact: str) -> bool:
        """Whether the status of a contact's pairs is kept at all reported points."""
        with open_results(self.path) as file:
            kept = file[self.name]["contact_" + contact].get("status")
            return kept is not None and bool(np.all(kept[()] != UNKNOWN))

    def parameter(self, contact: str, role: Role) -> Array | None:
        """Value in the case of the parameter of a contact's law with a role; None where the results tell none."""
        law = kept_laws(self.attributes.get("laws", {})).get(contact)
        value = None if law is None else law.value(contact, role, self.attributes["case"])
        return None if value is None else np.asarray(value, dtype=float)

    def components(self, contact: str) -> int:
        """Relative displacements of a pair: 1, or 3 with the normal one first."""
        with open_results(self.path) as file:
            return int(file[self.name]["contact_" + contact]["u"].shape[2])

    def placed(self) -> list[str]:
        """Contacts whose pairs have known places."""
        with open_results(self.path) as file:
            group = file[self.name]
            kept = [key for key in group if key.startswith("pairs_")]
            return [key[len("pairs_") :] for key in kept if "position" in group[key]]

    def pairs(self, contact: str) -> Table:
        """Of each pair of a contact: face, friction coefficient, and where they are known its position and area.

        The position (n_pairs, 2) on its face [length], the area [length^2]; empty where neither is known.
        """
        with open_results(self.path) as file:
            group = file[self.name].get("pairs_" + contact, {})
            table = {key: group[key][()] for key in group}
        return {**table, "face": np.array(_texts(table["face"]))} if table else {}

    def worn_contacts(self) -> list[str]:
        """Contacts whose worn depth is kept."""
        with open_results(self.path) as file:
            return [key[len("depth_") :] for key in file[self.name] if key.startswith("depth_")]

    def field(self, name: str) -> Array:
        """An array that every point has, (n_points, ...)."""
        with open_results(self.path) as file:
            return np.asarray(file[self.name][name], dtype=float)

    def long_name(self, column: str) -> str:
        """What a column of the table is."""
        with open_results(self.path) as file:
            return str(_text(file[self.name]["points"][column].attrs["long_name"]))

    def met(self, event: str) -> list[int]:
        """Points at which an event happened."""
        return [i for i, text in enumerate(self.events) if event in text.split()]

    def observed(self) -> str:
        """Name of what the amplitude is of: a dof, a row of dofs, the coordinate of a linear mode."""
        name = self.attributes.get("normalise", self.attributes.get("observe"))
        return str(name) if name else (self.dofs or [""])[0]

    def normalised_dof(self) -> int:
        """Index of the dof that carries the modal amplitude (or is observed), or has the largest weight in it."""
        if self._weights is not None:
            return int(np.argmax(np.abs(self._weights)))
        return self.dofs.index(self.observed()) if self.observed() in self.dofs else 0

    def along(self, motion: Array) -> Array:
        """What the amplitude is of, (n,), in motions of all dofs (n, n_dof)."""
        return np.asarray(motion[:, self.normalised_dof()] if self._weights is None else motion @ self._weights)

    @cached_property
    def _weights(self) -> Array | None:
        """Of all dofs in the amplitude, where it is that of a row or a coordinate."""
        if self.observed() in self.dofs or not has_results(self.path.parent):
            return None
        with open_results(self.path) as file:
            return np.asarray(file[self.name][ROW]) if ROW in file[self.name] else None

    def method(self) -> str:
        return str(self.attributes.get("method", ""))

    def unit(self, column: str) -> str:
        """Unit of a column; "" for a pure number or an unknown one."""
        return "" if self.units.get(column) in PURE else self.units.get(column, "")

    def length_unit(self) -> str:
        """Of displacements; "" where the results tell no units."""
        return self.unit_system("length") if self.unit("amplitude") else ""

    @property
    def unit_system(self) -> UnitSystem:
        """The system that all its numbers are in."""
        return units_of(self.attributes)

    def asymptote(self, contact: str) -> float | None:
        """Linear angular frequency with the contact "stuck" or "free" [rad/s]."""
        value = self.attributes.get(f"{contact}_omega")
        return None if value is None else float(value)

    def backbones(self) -> list[str]:
        """Mode analyses to show with a forced one."""
        names = self.attributes.get("backbone", [])
        return [names] if isinstance(names, str) else list(names)

    def starts(self) -> list[tuple[int, float]]:
        """Numbers and amplitudes of the starts of an analysis in the time domain that have a cycle."""
        amplitudes = self.attributes.get("amplitude", [])
        return [(int(n), float(amplitudes[int(n)])) for n in np.unique(self.columns.get("start", np.empty(0)))]

    def history(self, start: int) -> Array:
        """Time, displacement and velocity (3, n) of a start; empty when it was not kept."""
        with open_results(self.path) as file:
            return np.asarray(file[self.name].get(f"motion_{start}", ()), dtype=float)

    def at(self, value: float | Sequence[float] | None = None, **where: float | Sequence[float]) -> Reading:
        """Every place where its branches pass a value, with the state there, as `fretwave.Branch.at` reads them.

        Of results without derivatives (of earlier versions), off straight lines between the points.

        Parameters
        ----------
        value : float or sequence
            Amplitude of a mode, omega of a response.
        where : one column of the state and its value, in place of `value`
            ``run["forced"].at(amplitude=0.01)``.

        Returns
        -------
        Table
            One row per crossing, branch by branch; `level` or `nodal_diameter` tell which.

        Raises
        ------
        InputError
            No such column, or it follows no branch.
        """
        return self._joined(lambda curve: curve.at(value, **where))

    def curve(self, n: int = PARTS) -> Reading:
        """Its branches for drawing, one under the other: all points, and n - 1 places of the cubic between two."""
        return self._joined(lambda curve: curve.drawn(n))

    def straight(self, error: float = CURVE) -> Reading:
        """Its branches for a reader that draws straight lines, which stay within a share of each column's range."""
        return self._joined(lambda curve: curve.straight(error))

    def _joined(self, read: Callable[[Curve], Reading]) -> Reading:
        if self.meaning is None or not len(self):
            what, fix = self.kind if self.meaning is None else "no points", "mode, forced, flutter, or a sweep of these"
            raise InputError("the analysis has no branch to read", self.name, what, None, fix)
        return Reading.joined([read(curve).moved("place", first) for first, curve in self._curves])

    @cached_property
    def _curves(self) -> list[tuple[int, Curve]]:
        assert self.meaning is not None
        return curves_of(self.columns, self.units, self.unit_system, self.events, self.meaning, self.slopes)

    def mode_curve(self) -> ModeCurve:
        """Modal values as functions of amplitude, as the tables of comparisons read them."""
        return ModeCurve.from_table(self.columns)


def own_curve(group: h5py.Group, folder: Path) -> ModeCurve:
    """Of the group of a mode in a run's results: as `Analysis.curve` draws it, of older results through its points."""
    mode = read_analysis(group, folder / "results.h5")
    if mode.slopes is None:
        return mode.mode_curve()
    drawn = mode.curve()
    return ModeCurve.from_table({name: drawn[name] for name in ("amplitude", "omega", "omega0", "zeta", "stick")})


def motion_of(analysis: Analysis, point: int) -> tuple[Array, Array]:
    """Displacement and velocity over one period of a point of a mode analysis, closed (first = last)."""
    columns = analysis.columns
    decaying = analysis.method() == "CNM"
    beta = columns["beta"][point] if decaying else 0.0
    omega = columns["omega" if decaying else "omega0"][point]
    return motion(analysis.labels, analysis.coefficients([point])[0], float(beta), float(omega))


def read_analysis(group: h5py.Group, path: Path) -> Analysis:
    """Of its group in results.h5, at this path."""
    points = group["points"] if "points" in group else {}
    columns = {key: np.asarray(points[key]) for key in table_order(points) if key != "event"}
    numbers = {key: value.astype(float) for key, value in columns.items() if value.dtype.kind in "fiub"}
    meaning, slopes = read_slopes(group)
    events = _texts(points["event"][()]) if "event" in points else [""] * len(next(iter(numbers.values()), []))
    return Analysis(
        name=group.name.strip("/"),
        kind=_text(group.attrs["type"]),
        columns=numbers,
        events=events,
        attributes={key: _attribute(value) for key, value in group.attrs.items()},
        labels=_texts(group["harmonic"][()]) if "harmonic" in group else [],
        dofs=_texts(group["dof"][()]) if "dof" in group else [],
        reported=[int(p) for p in group["reported"][()]] if "reported" in group else [],
        contacts=[key[len("contact_") :] for key in group if key.startswith("contact_")],
        units={key: _text(points[key].attrs.get("units", "")) for key in numbers},
        path=path,
        meaning=meaning,
        slopes=slopes,
        words={key: _texts(value) for key, value in columns.items() if key not in numbers},
    )


def _texts(values: Iterable[object]) -> list[str]:
    return [str(_text(value)) for value in values]


def _text(value: object) -> Any:
    return value.decode() if isinstance(value, bytes) else value


def _attribute(value: object) -> Any:
    """An attribute; lists are kept as JSON."""
    text = _text(value)
    return json.loads(text) if isinstance(text, str) and text[:1] in ("[", "{") else text
