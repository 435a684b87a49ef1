"""``fretwave view`` of wear: worn depth, rate, pressure and slip of the contact pairs over wear cycles, as VTKHDF.

The steps are the points of one amplitude and ParaView's time is the normalised wear cycle. Pairs of a face are joined
by triangles where their places on the face are known, so that the maps are surfaces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np

from ..arrays import Array, Indices
from ..case.contacts import wear_areas
from ..case.load import Case
from ..errors import InputError
from ..model.pairs import Pairs
from ..results.results import open_results
from ..texts import display
from ..units import UnitSystem, units_of
from .contact_faces import face_numbers, surface
from .options import ViewOptions, natural_scale
from .vtkhdf import GridFile

#: Columns of the table that go with each step.
SHOWN = ("cycles", "vibrations", "amplitude", "frequency_hz", "zeta", "stick", "slip", "open", "work")
#: Arrays of the results and what they are called in the picture.
FIELDS = {
    "depth": "depth",
    "rate": "wear_rate",
    "load": "mean_normal_force",
    "slip": "slip_share",
    "open": "open_share",
}


def view_wear(folder: Path, case: Case, name: str, options: ViewOptions, say: Callable[[str], None]) -> list[Path]:
    """Write a file for each amplitude asked for, by default the largest; returns their paths. One rank only.

    Raises
    ------
    InputError
        The places of the pairs are not known, there is no wear at such an amplitude, or a picture is asked for.
    """
    options.refuse_pictures(name)
    placed = _placed(case, name)
    out = options.out or folder / f"{name}_wear.vtkhdf"
    written = []
    with open_results(folder / "results.h5") as file:
        lines = _chosen(file[name], options, f"analysis '{name}' in {display(folder)}")
        for number, rows in enumerate(lines, 1):
            path = out if len(lines) == 1 else out.with_name(f"{out.stem}_{number}{out.suffix}")
            scale = _write(path, file[name], rows, placed, options.scale, case.units)
            amplitude, cycles = (file[name]["points"][key][rows[-1]] for key in ("amplitude", "cycles"))
            shown = f"amplitude {amplitude:.6g} {case.units('length')}, {len(rows)} steps to {cycles:.6g} wear cycles"
            say(f"{display(path)}: {shown}")
            say(f"  {sum(contact.n_pairs for contact in placed.values())} contact pairs; warp draws depths x {scale:g}")
            whole = ", ".join(str(row) for row in file[name]["reported"][()] if row in rows)
            say(f"  `--point N` shows the motion at a point, with its pairs at the points {whole}")
            written.append(path)
    say(f"units: {case.units.described()}")
    say("ParaView (5.12 or later): time is the wear cycle")
    return written


def _placed(case: Case, name: str) -> dict[str, Pairs]:
    pairs = case.structure.pairs
    found = {key: pairs[key] for key in wear_areas(case.contacts) if pairs[key].points is not None}
    if not found:
        fix = "give Pairs their points; `fretwave plot` draws histories without them"
        raise InputError("the model has no places of its contact pairs", f"analysis '{name}'", None, "points", fix)
    return found


def _chosen(group: h5py.Group, options: ViewOptions, where: str) -> list[Indices]:
    """Rows of the lines whose amplitudes are asked for."""
    number, amplitude = group["points/line"][()], group["points/amplitude"][()]
    lines = [np.flatnonzero(number == k) for k in np.unique(number)]
    given = np.array([amplitude[rows[0]] for rows in lines])
    if not options.amplitudes:
        return [lines[int(np.argmax(given))]]
    for asked in options.amplitudes:
        if not given.min() * (1 - 1e-6) <= asked <= given.max() * (1 + 1e-6):
            known, unit = ", ".join(f"{a:g}" for a in given), units_of(group.attrs)("length")
            near = given[np.argmin(np.abs(given - asked))]
            raise InputError("no wear at this amplitude", where, f"{asked:g} {unit}", known, f"--amplitude {near:g}")
    return [lines[int(np.argmin(np.abs(given - asked)))] for asked in options.amplitudes]


def _write(
    path: Path,
    group: h5py.Group,
    rows: Indices,
    placed: Mapping[str, Pairs],
    scale: float | None,
    units: UnitSystem,
) -> float:
    """One line; returns the factor on the depths in the field warp."""
    steps, table = np.arange(len(rows)), group["points"]
    arrays = {key: _over_steps(group, key, rows, placed) for key in FIELDS}
    points = np.concatenate([np.asarray(contact.points) for contact in placed.values()])
    scale = _natural_scale(points, arrays["depth"]) if scale is None else scale
    with GridFile(path, table["cycles"][()][rows], units) as grid:
        for contact in placed.values():
            grid.part(np.asarray(contact.points), surface(contact))
        for key, name in FIELDS.items():
            grid.point_field(name, arrays[key], steps)
        areas = np.concatenate([np.asarray(contact.areas) for contact in placed.values()])
        grid.point_field("mean_pressure", arrays["load"] / areas, steps)
        if all(contact.frames is not None for contact in placed.values()):
            normals = np.concatenate([np.asarray(contact.frames)[:, 0] for contact in placed.values()])
            grid.point_field("normal", [normals])
            # what is worn away is gap: the surface recedes against the normal, which closes the contact
            grid.point_field("warp", (-scale * depth[:, None] * normals for depth in arrays["depth"]), steps, "f4")
        grid.point_field("face", [face_numbers(contact)[1].astype(float) for contact in placed.values()])
        grid.point_field("pair", [np.arange(float(contact.n_pairs)) for contact in placed.values()])
        for name in SHOWN:
            grid.field_data(name, table[name][()][rows])
    return scale


def _over_steps(group: h5py.Group, key: str, rows: Indices, placed: Mapping[str, Pairs]) -> Array:
    """(n_steps, n_pairs of all contacts)."""
    parts = [np.asarray(group[f"{key}_{name}"][rows[0] : rows[-1] + 1])[rows - rows[0]] for name in placed]
    return np.concatenate(parts, axis=1)


def _natural_scale(points: Array, depth: Array) -> float:
    """Draws the largest depth as a tenth of the extent of the pairs."""
    size, largest = float(np.linalg.norm(np.ptp(points, axis=0))), float(depth.max(initial=0.0))
    return natural_scale(size, largest)
