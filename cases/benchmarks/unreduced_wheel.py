"""The blisk of `blisk_ring` with all its finite elements: 36 sectors of 20,646 dofs, against one sector in the wave.

    OMP_NUM_THREADS=1 mpirun -n 2 .venv/bin/python cases/benchmarks/unreduced_wheel.py
    OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/unreduced_wheel.py --quick --harmonics 1

A travelling wave of 4 nodal diameters, second bending, in 3-D contact with lift-off, through slip. Times are processor
time of the slowest rank, the same as wall time on an idle machine.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from petsc4py import PETSc

import fretwave as fw

sys.path[:0] = [str(Path(__file__).parents[1] / "blisk_ring"), str(Path(__file__).parent)]
from wheels import COMM, follow, memory_gb, say  # noqa: E402

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
    began = time.process_time()
    sector, tip = blisk(QUICK if options.quick else {})
    harmonics = fw.Harmonics(range(options.harmonics + 1), options.samples)
    with sector.model(DIAMETERS, COMM) as model:
        stuck = fw.linear_modes(model, LINEAR_MODE)[LINEAR_MODE - 1]
        problem = fw.NonlinearMode(model, harmonics, "CNM", tip, stuck, "sector_")
        rest = fw.balanced(model, stuck)
        problem.preload(rest.displacement, rest.load)
        alone = follow(problem, options)
        problem.destroy()
    say(f"one sector: {alone['seconds']:.2f} s a point; {time.process_time() - began:.0f} s so far")
    began = time.process_time()
    wheel = sector.wheel(COMM)
    say(f"wheel made: {time.process_time() - began:.0f} s, {memory_gb():.1f} GB")
    start = sector.around(stuck, DIAMETERS)
    PETSc.Options()["wheel_route"] = "krylov"
    problem = fw.NonlinearMode(wheel, harmonics, "CNM", tip, start, "wheel_", start.shape - 1j * start.imaginary)
    problem.preload(np.tile(rest.displacement, sector.sectors), np.tile(rest.load, sector.sectors))
    whole = follow(problem, options)
    apart = [abs(whole["state"][key] / alone["state"][key] - 1) for key in ("omega", "beta")]
    say(
        f"{sector.sectors} sectors of {sector.n_dof} dofs, {wheel.n_dof * harmonics.block_size} unknowns,"
        f" {COMM.size} ranks:"
        f" {whole['points']} points to {100 * whole['slip']:.0f} % slip, {whole['seconds']:.1f} s a point,"
        f" {whole['behind']:.1f} s behind the first ({whole['newton']} Newton steps, {whole['gmres']:.1f} GMRES each),"
        f" {memory_gb():.1f} GB; apart from the sector: omega {apart[0]:.0e}, beta {apart[1]:.0e}; {whole['reason']}"
    )


if __name__ == "__main__":
    main()
