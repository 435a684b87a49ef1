"""What ``fretwave view`` shows of a run: the analysis, the points of its branch and the phases of the period."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, Indices
from ..case.harmonic import nodal_diameter
from ..case.kept import belongs
from ..case.load import Case
from ..errors import InputError
from ..files.dimensions import names_of_data
from ..model.law_info import kept_laws
from ..post.contact_history import ContactHistory
from ..post.motion import waves
from ..results.file import unit_of_amplitudes
from ..results.parts import PARTS
from ..results.stamp import changed_since, stamp_of
from ..texts import display, nearest
from ..units import SI, UnitSystem, units_of
from .options import ViewOptions
from .places import linear_last
from .points import kept_points, points_asked

if TYPE_CHECKING:
    import h5py

#: Columns of the branch that go with a picture.
SHOWN = (
    *("point", "amplitude", "largest_amplitude", "cycles", "frequency_hz", "zeta", "level", "nodal_diameter"),
    *("stick", "slip", "open"),
)


@dataclass(frozen=True)
class Choice:
    """Points of one analysis with all that is kept of them.

    Attributes
    ----------
    points : numbers on the branch
    asked : what the command line said of each, "" for nothing
    states : columns of the branch at these points, by name
    coefficients : (n_points, n_coordinates, m) [length], as solved
    labels : of the m columns
    rest : (n_coordinates,) displacement at rest [length]
    loaded : it moves about a state at rest, in which static loads act; linear modes do not
    samples : (n_phases,)
        Numbers of the contacts' samples at which the motion is shown.
    phases : (n_phases,) [rad]
    contacts : histories per point, by the contact's name; none unless every point keeps them
    without : points that do not keep the motion of their contacts
    highest_component_hz : of the run's reduction, 0 without component modes
    component_modes : how many it has taken, where that is known
    diameters : nodal diameters of the wave on one sector, per point; 0 for a structure
    wheel : the coordinates are those of all sectors of a wheel, one after the other
    sample_count : of a period
    unit : of the amplitude
    units : of all numbers
    """

    name: str
    points: list[int]
    asked: list[str]
    states: dict[str, Array]
    coefficients: Array
    labels: list[str]
    rest: Array
    samples: Indices
    phases: Array
    contacts: dict[str, list[ContactHistory]]
    without: list[int]
    loaded: bool = False
    highest_component_hz: float = 0.0
    component_modes: int | None = None
    diameters: Sequence[int] = ()
    wheel: bool = False
    sample_count: int = 1
    unit: str = ""
    units: UnitSystem = SI

    @property
    def times(self) -> Array:
        """Of all steps, in periods."""
        return np.concatenate([number + self.phases / (2 * np.pi) for number in range(len(self.points))])

    @property
    def point_of_step(self) -> Indices:
        """(n_steps,) place in `points`."""
        return np.repeat(np.arange(len(self.points)), len(self.phases))

    def basis(self) -> Array:
        """Value (n_phases, m) of each column's function of time: x = sum Qc_n cos n tau + Qs_n sin n tau."""
        return waves(self.labels, self.phases)

    @property
    def orders(self) -> list[int]:
        """Harmonics, ascending."""
        return sorted({int(text.rstrip("cs")) for text in self.labels})

    def delay(self, angle: float) -> Array:
        """D (m, m): coefficients @ D are those of the motion x(tau - angle).

        Of each harmonic (Qc - i Qs) e^{-i n angle}.
        """
        columns = {text: k for k, text in enumerate(self.labels)}
        D = np.eye(len(self.labels))
        for n in filter(None, self.orders):
            both, c, s = [columns[f"{n}c"], columns[f"{n}s"]], np.cos(n * angle), np.sin(n * angle)
            D[np.ix_(both, both)] = [[c, s], [-s, c]]
        return D

    def whole_delays(self, sectors: int) -> bool:
        """In a wave every sector is whole samples behind the last one."""
        return self.wheel or all(self.sample_count * n % sectors == 0 for n in self.diameters)

    def histories(self, name: str, sector: int, sectors: int) -> list[ContactHistory]:
        """Of a contact in one sector, per point."""
        if self.wheel:
            n = self.contacts[name][0].n_pairs // sectors
            return [history.of_pairs(slice(sector * n, (sector + 1) * n)) for history in self.contacts[name]]
        shifts = [self.sample_count * n * sector // sectors for n in self.diameters]
        return [history.delayed(shift) if shift else history for history, shift in zip(self.contacts[name], shifts)]

    def lines(self, with_contacts: bool = True) -> Iterator[str]:
        """Which points are shown, each in a line, and those whose contacts would be, but are not."""
        for row, (point, asked) in enumerate(zip(self.points, self.asked)):
            amplitude, frequency = self.states["amplitude"][row], self.states["frequency_hz"][row]
            values = f"amplitude {amplitude:.6g} {self.unit}"
            if "largest_amplitude" in self.states:
                values += f" (largest of all sectors {self.states['largest_amplitude'][row]:.6g})"
            parts = [part for part in PARTS if part in self.states]
            branch = "".join(f"{part.replace('_', ' ')} {self.states[part][row]:g}, " for part in parts)
            yield f"{self.name}: point {point}, {branch}{values}, {frequency:.6g} Hz{asked}"
        if self.without and with_contacts:
            numbers = ", ".join(str(point) for point in self.without)
            yield f"{self.name}: no contact pairs are shown: their motion is not kept at point {numbers}"


def read_choice(file: h5py.File, folder: Path, case: Case, options: ViewOptions) -> Choice:
    """Read what is asked for from an open results.h5.

    Raises
    ------
    InputError
        There is no such analysis, or it keeps no such point.
    """
    group = file[analysis_name(file, folder, case, options.analysis)]
    name = group.name.strip("/")
    held = kept_points(group)
    # A mode is shown where its contacts are kept; a response is sought at its peaks, where they are not.
    offered = held if case.analyses[name].shown_where_kept and len(held) else np.arange(len(group["coefficients"]))
    chosen = points_asked(group, offered, options, f"analysis '{name}' in {display(folder)}")
    count, loaded = int(group.attrs["samples"]), "rest_displacement" in group
    steps = min(options.phases, count)  # there are no more than samples
    samples = np.arange(steps) * count // steps
    rows = [row for row, _ in chosen]
    without = [row for row in rows if row not in held]
    reduction = json.loads(group.attrs.get("reduction", "{}"))
    return Choice(
        name=name,
        points=rows,
        asked=[asked for _, asked in chosen],
        states={key: group["points"][key][()][rows].astype(float) for key in SHOWN if key in group["points"]},
        coefficients=np.stack([group["coefficients"][row] for row in rows]),
        labels=[text.decode() for text in group["harmonic"][()]],
        rest=group["rest_displacement"][()] if loaded else np.zeros(len(group["dof"])),
        loaded=loaded,
        samples=samples,
        phases=2 * np.pi * samples / count,
        contacts={} if without else _contacts(group, case, rows),
        without=without,
        highest_component_hz=reduction.get("highest_component_hz", 0.0),
        component_modes=reduction.get("component_modes"),
        diameters=_diameters(group, case, name, rows),
        wheel=case.neighbours is not None and case.analyses[name].whole_wheel()[0],
        sample_count=count,
        unit=unit_of_amplitudes(group),
        units=units_of(group.attrs),
    )


def at_point(choice: Choice, group: h5py.Group, case: Case, point: int) -> Choice:
    """The same of another point alone, without its contacts."""
    states = {key: group["points"][key][()][[point]].astype(float) for key in choice.states}
    return replace(
        choice,
        points=[point],
        asked=[""],
        states=states,
        coefficients=group["coefficients"][point][None],
        contacts={},
        without=[],
        diameters=_diameters(group, case, choice.name, [point]),
    )


def _diameters(group: h5py.Group, case: Case, name: str, rows: Sequence[int]) -> list[int]:
    """Nodal diameters of the points: of their rows, where an analysis has several, or of that whose wave it takes."""
    if case.neighbours is None:
        return [0] * len(rows)
    if "nodal_diameter" in group["points"]:
        return [int(group["points/nodal_diameter"][row]) for row in rows]
    return [nodal_diameter(case.analyses[name].settings(case))] * len(rows)


def analysis_name(file: h5py.File, folder: Path, case: Case, asked: str | None) -> str:
    """Name of the analysis asked for, or of the first that has a motion: in the order of the case, linear ones last."""
    found = analyses_that_move(file, case)
    if found and asked in (None, *found):
        return asked or found[0]
    if asked in file and "coefficients" in file[asked] and asked in case.analyses:
        changed = changed_since(stamp_of(file[asked].attrs), case.resolved)
        fix = f"`fretwave run {display(case.path)} --only {asked}`, with what else the run was given"
        what = f"the results of '{asked}' are of the case before it changed"
        raise InputError(what, display(folder), changed, fix=fix)
    listed = ", ".join(found) or "none"
    raise InputError(
        "there is no motion to show" if asked is None else f"'{asked}' has no motion to show",
        display(folder),
        f"analyses with harmonic coefficients: {listed}",
        "a mode or forced response of this run",
        (nearest(asked, found) if asked else None) or (f"--analysis {found[0]}" if found else "run such an analysis"),
    )


def analyses_that_move(file: h5py.File, case: Case) -> list[str]:
    """Names of those that keep harmonic coefficients, in the order of the case, linear ones last."""
    found = [name for name in case.analyses if name in file and "coefficients" in file[name]]
    return linear_last(file, [name for name in found if belongs(file[name], case, name)])


def _contacts(group: h5py.Group, case: Case, rows: Sequence[int]) -> dict[str, list[ContactHistory]]:
    """Histories of all contacts at some points."""
    reported, laws = group["reported"][()].tolist(), kept_laws(json.loads(group.attrs.get("laws", "{}")))
    found = {}
    for contact in case.contacts:
        place = f"contact_{contact.name}"
        if place in group:
            data = {key: group[place][key] for key in names_of_data(group[place])}
            kept = [{key: values[reported.index(row)] for key, values in data.items()} for row in rows]
            law = laws.get(contact.name) or contact.info  # results of an earlier version do not tell it
            found[contact.name] = [ContactHistory.of(motion, law.normal) for motion in kept]
    return found
