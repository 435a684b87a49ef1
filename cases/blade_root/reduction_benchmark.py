"""Measure the Craig-Bampton reduction of a bar of 33,033 dofs: `python cases/blade_root/reduction_benchmark.py`.

A bar held at 2 x 24 nodes near its root, as by two flanks, and observed at one dof of the tip: 145 kept dofs.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from fretwave import Model, reduce

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from models.hexahedra import Bar, bar  # noqa: E402


def flank_dofs(model: Bar, per_flank: int) -> np.ndarray:
    """Dofs of nodes on the lower and the upper face, nearest to the root."""
    x, y = model.nodes[:, 0], model.nodes[:, 1]
    faces = [np.flatnonzero(np.isclose(y, side)) for side in (0.0, y.max())]
    nodes = np.concatenate([face[np.argsort(x[face], kind="stable")[:per_flank]] for face in faces])
    return (3 * nodes[:, None] + np.arange(3)).ravel()


def status_mb(field: str) -> float:
    """VmRSS (now) or VmHWM (peak) of this rank [MB]."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith(field)) / 1024


def event(name: str, field: str) -> float:
    return float(PETSc.Log.Event(name).getPerfInfo()[field])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, nargs=3, default=(90, 10, 10))
    parser.add_argument("--flank", type=int, default=24, help="kept nodes on each flank")
    parser.add_argument("--modes", type=int, default=10)
    parser.add_argument("--stiffness", type=float, default=1e8, help="stuck contact on each kept dof [N/m]")
    options = parser.parse_args()
    comm, size = MPI.COMM_WORLD, (0.27, 0.03, 0.03)
    PETSc.Log.begin()
    made = bar(tuple(options.cells), size)
    n = made.K.shape[0]
    contact = flank_dofs(made, options.flank)
    keep = np.append(contact, n - 2)
    K_contact = sp.diags(np.bincount(contact, minlength=n) * options.stiffness).tocsr()
    distributed = Model(made.M, made.K)
    M, K = distributed._matrices[1], distributed._matrices[0]
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # peak from here on (Linux)
    before, cpu = comm.allgather(status_mb("VmRSS")), time.process_time()
    reduction = reduce(M, K, keep=keep, modes=options.modes)
    peak, cpus = comm.allgather(status_mb("VmHWM")), comm.allgather(time.process_time() - cpu)
    factorisations, solves = event("MatCholFctrNum", "count"), event("MatSolve", "count")
    error = reduction.error(5, K_contact)
    if comm.rank == 0:
        print(f"{n} dofs, {len(keep)} kept, {options.modes} modes, {comm.size} ranks")
        print(f"{factorisations:.0f} factorisation, {solves:.0f} single solves")
        print("wall [s]:", {k: round(v, 2) for k, v in reduction.wall_s.items()}, f"error() {error.wall_s:.2f}")
        print("CPU of each rank [s]:", np.round(cpus, 2))
        print("memory before and peak during reduce [MB of each rank]:", np.round(before), np.round(peak))
        print("full [Hz]:", error.full_hz)
        print("relative error:", error.relative)


if __name__ == "__main__":
    main()
