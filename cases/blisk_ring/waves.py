"""Linear waves of the blisk over nodal diameters, and its nonlinear wave for several friction coefficients.

    .venv/bin/python cases/blisk_ring/waves.py [--quick] [--only linear,sweep,mesh] [--out runs/blisk_ring]

``linear`` compares the reduced sector with the unreduced one; ``sweep`` follows the second bending from stick to slip.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import fretwave as fw
from fretwave.preload import balanced

sys.path.insert(0, str(Path(__file__).parent))
import model as case  # noqa: E402

#: The case's short form, as [quick] in case.toml.
QUICK: dict[str, Any] = dict(
    axial_cells=(1, 1, 2, 1, 1, 1, 2, 1),
    circumferential_cells=(2, 1, 2),
    radial_cells=(2, 1, 1),
    span_cells=4,
    ring_cells=1,
)
#: Friction coefficients of the sweep, over a factor 25.
FRICTION = (0.02, 0.05, 0.12, 0.25, 0.5)
NODAL_DIAMETER = 4
#: Time samples of a period: a multiple of the sectors, so that all see the kinks between the same samples.
SAMPLES = 360
Array = npt.NDArray[np.float64]
HELD = ("amplitude", "omega", "frequency_hz", "beta", "zeta", "stick", "slip", "open", "error_estimate")


def sector(o: case.Options, r: dict[str, Any]) -> fw.Sector:
    """The reduced sector with its friction."""
    K, groove = case.groove_contact(o, r)
    law = "jenkins" if groove.components == 1 else "coulomb_3d"
    pairs = fw.Contact(law, groove.B, groove.parameters, name="groove")
    return fw.Sector.from_faces(r["M"], K, r["low"], r["high"], o.blades, contacts=[pairs])


def tip(r: dict[str, Any]) -> int:
    """The observed dof after the high face is left out."""
    return int(r["tip"] - np.count_nonzero(r["high"] < r["tip"]))


def bending(o: case.Options, f: dict[str, Any], r: dict[str, Any], state: str) -> tuple[int, fw.LinearMode, float]:
    """Number, wave and share of the wave of 4 nodal diameters that is most like the blade's second bending."""
    constant = replace(o, normal="constant")  # whose free waves are closed and sliding
    one, (_, shape, dofs) = sector(constant, r), case.second_bending(o, f)
    with one.model(NODAL_DIAMETER) as linear:
        found = fw.linear_modes(linear, 9, state)
    moved = [r["expand"] @ one.expand(mode.shape + 1j * mode.imaginary, NODAL_DIAMETER) for mode in found]
    shares = [case.likeness(f, wave, shape, dofs) for wave in moved]
    best = int(np.argmax(shares))
    return best + 1, found[best], shares[best]


def families(o: case.Options, r: dict[str, Any], count: int = 7) -> Array:
    """Stuck frequencies (N/2 + 1, count) [Hz] of the reduced sector."""
    one, table = sector(o, r), []
    for diameters in range(o.blades // 2 + 1):
        with one.model(diameters) as linear:
            table.append([mode.frequency_hz for mode in fw.linear_modes(linear, count)])
    return np.array(table)


def branch(o: case.Options, r: dict[str, Any], stuck: fw.LinearMode, harmonics: int) -> list[dict[str, float]]:
    """Points from stick to slip; the amplitudes, of the tip [m], are multiples of mu."""
    with sector(o, r).model(NODAL_DIAMETER) as model:
        retain = "all" if o.normal == "variable" else "odd"
        chosen = fw.choose_harmonics(model, harmonics, SAMPLES, retain)
        mode = fw.NonlinearMode(model, chosen, "CNM", tip(r), stuck)
        if o.normal == "variable":
            rest = balanced(model, stuck)
            mode.preload(rest.displacement, rest.load)
        first, last = 4e-5 * o.friction, 3e-3 * o.friction
        points = fw.Continuation(mode, mode.initial(first), (first, last), fw.StepControl(maximum=0.2))
        table = []
        for point in points:
            row = {**mode.state(point.y), **mode.diagnostics(point.y)}
            table.append({"friction": o.friction, **{key: row[key] for key in HELD}})
    if not points.converged:
        raise fw.NotConverged(f"the branch of mu = {o.friction} stopped early", measured=points.reason)
    return table


def summary(table: list[dict[str, float]]) -> str:
    """Threshold, lowest frequency and largest damping of one branch."""
    peak, lowest = max(table, key=lambda row: row["zeta"]), min(table, key=lambda row: row["frequency_hz"])
    onset = next(row for row in table if row["slip"] > 0)
    return (
        f"mu {peak['friction']:.2f}: slip from a = {onset['amplitude']:.3e} m, "
        f"lowest {lowest['frequency_hz']:.2f} Hz at {lowest['amplitude']:.3e} m, "
        f"largest zeta {100 * peak['zeta']:.4f} % at {peak['amplitude']:.3e} m, "
        f"last {table[-1]['frequency_hz']:.2f} Hz, {100 * table[-1]['open']:.0f} % open"
    )


def coincide(tables: list[list[dict[str, float]]]) -> tuple[float, float]:
    """Largest distance of the branches over a / mu from the first: relative in omega, and in zeta over its maximum."""

    def curve(table: list[dict[str, float]], key: str) -> Array:
        grid = np.log(np.geomspace(5e-5, 2.9e-3, 400))
        return np.interp(grid, [np.log(row["amplitude"] / row["friction"]) for row in table], [r[key] for r in table])

    found = []
    for key, unit in (("omega", tables[0][0]["omega"]), ("zeta", max(row["zeta"] for row in tables[0]))):
        first, *others = (curve(table, key) for table in tables)
        found.append(max(float(abs(other - first).max()) for other in others) / unit)
    return found[0], found[1]


def main() -> None:
    """Compare, follow, draw."""
    import figures

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="coarse mesh")
    parser.add_argument("--only", default="linear,sweep,mesh")
    parser.add_argument("--compare", default="4", help="nodal diameters compared with the unreduced sector")
    parser.add_argument("--harmonics", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("runs/blisk_ring_waves"))
    arguments = parser.parse_args()
    parts, options = arguments.only.split(","), QUICK if arguments.quick else {}
    arguments.out.mkdir(parents=True, exist_ok=True)
    o, f, r = case.Options(**options), case.full(**options), case.reduced(**options)
    stuck, sliding = bending(o, f, r, "stuck"), bending(o, f, r, "free")
    print(f"{f['M'].shape[0]} dofs, {r['M'].shape[0]} reduced, {len(r['areas'])} pairs", flush=True)
    for name, (number, mode, share) in {"stuck": stuck, "sliding": sliding}.items():
        print(f"second bending, {name}: wave {number}, {mode.frequency_hz:.2f} Hz, likeness {share:.3f}", flush=True)
    if "linear" in parts:
        linear(o, f, r, [int(text) for text in arguments.compare.split(",")], arguments.out)
    if "mesh" in parts:
        one = sector(o, r)
        wave = r["expand"] @ one.expand(stuck[1].shape + 1j * stuck[1].imaginary, NODAL_DIAMETER)
        figures.mesh(f, arguments.out / "mesh.png")
        figures.shape(o, f, wave, stuck[1].frequency_hz, arguments.out / "shape.png")
    if "sweep" in parts:
        sweep(options, r, stuck[1], sliding[1].frequency_hz, arguments.harmonics, arguments.out)


def linear(o: case.Options, f: Any, r: Any, compared: list[int], folder: Path) -> None:
    """Families over nodal diameters, with the error of the reduction."""
    import figures

    table, exact = families(o, r), {}
    for diameters in compared:
        exact[diameters] = np.array([mode.frequency_hz for mode in case.waves(o, f, diameters, table.shape[1])])
        error = table[diameters] / exact[diameters] - 1
        print(f"ND {diameters}: unreduced {np.round(exact[diameters], 2)} Hz, reduced off by", end=" ")
        print(", ".join(f"{e:.1e}" for e in error), flush=True)
    figures.families(table, exact, folder / "families.png")


def sweep(options: Any, r: Any, stuck: fw.LinearMode, sliding_hz: float, harmonics: int, folder: Path) -> None:
    """The branch for every friction coefficient."""
    import figures

    tables = []
    for friction in FRICTION:
        start = time.process_time()
        tables.append(branch(case.Options(**options, friction=friction), r, stuck, harmonics))
        print(f"{summary(tables[-1])}; {time.process_time() - start:.1f} s processor time", flush=True)
    omega, zeta = coincide(tables)
    print(f"over a / mu the branches differ by {omega:.1e} in omega and {zeta:.1e} of the largest zeta")
    with (folder / "sweep.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(tables[0][0]))
        writer.writeheader()
        writer.writerows(row for table in tables for row in table)
    figures.sweep(tables, stuck.frequency_hz, sliding_hz, folder / "sweep.png")


if __name__ == "__main__":
    main()
