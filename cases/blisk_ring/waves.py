"""Linear waves of the blisk over nodal diameters, and pictures of its mesh and of the second bending.

    .venv/bin/python cases/blisk_ring/waves.py [--quick] [--only linear,mesh] [--out runs/blisk_ring_waves]

``linear`` compares the reduced sector with the unreduced one.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import fretwave as fw

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
NODAL_DIAMETER = 4
Array = npt.NDArray[np.float64]


def sector(o: case.Options, r: dict[str, Any]) -> fw.Sector:
    """The reduced sector with its friction."""
    K, groove = case.groove_contact(o, r)
    law = "jenkins" if groove.components == 1 else "coulomb_3d"
    pairs = fw.Contact(law, groove.B, groove.parameters, name="groove")
    return fw.Sector.from_faces(r["M"], K, r["low"], r["high"], o.blades, contacts=[pairs])


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


def main() -> None:
    """Compare and draw."""
    import figures

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="coarse mesh")
    parser.add_argument("--only", default="linear,mesh")
    parser.add_argument("--compare", default="4", help="nodal diameters compared with the unreduced sector")
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


if __name__ == "__main__":
    main()
