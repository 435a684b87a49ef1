"""The blisk of `blisk_ring` with all its finite elements: 36 sectors of 20,646 dofs, against one sector in the wave.

    OMP_NUM_THREADS=1 mpirun -n 2 .venv/bin/python cases/benchmarks/unreduced_wheel.py
    OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/unreduced_wheel.py --quick --harmonics 1

A travelling wave of 4 nodal diameters, second bending, in 3-D contact with lift-off, through slip. Times are processor
time of the slowest rank, the same as wall time on an idle machine.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

import fretwave as fw

sys.path[:0] = [str(Path(__file__).parents[1] / "blisk_ring"), str(Path(__file__).parent)]
from wheels import compared  # noqa: E402

from model import build  # noqa: E402

DIAMETERS, LINEAR_MODE = 4, 5
#: The mesh of the case's `[quick]` form.
QUICK = {
    "axial_cells": (1, 1, 2, 1, 1, 1, 2, 1),
    "circumferential_cells": (2, 1, 2),
    "radial_cells": (2, 1, 1),
    "span_cells": 4,
    "ring_cells": 1,
}


def blisk(mesh: dict[str, tuple[int, ...]]) -> tuple[fw.Sector, int]:
    """The sector with its faces tied, and its dof at the blade's tip."""
    one = build(reduced=False, **mesh)
    contact = fw.Contact("coulomb_3d", one.pairs["groove"], name="groove")
    sector = fw.Sector.from_faces(one.M, one.K, one.low, one.high, one.sectors, contacts=[contact], axis=one.axis)
    return sector, int(np.searchsorted(np.setdiff1d(np.arange(one.n_dof), one.high), one.dofs["tip"]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the coarse mesh")
    parser.add_argument("--harmonics", type=int, default=3)
    parser.add_argument("--samples", type=int, default=360)
    parser.add_argument("--start", type=float, default=2e-5, help="[m]")
    parser.add_argument("--stop", type=float, default=4e-5, help="[m]")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    sector, tip = blisk(QUICK if options.quick else {})
    compared(sector, tip, DIAMETERS, LINEAR_MODE, options)


if __name__ == "__main__":
    main()
