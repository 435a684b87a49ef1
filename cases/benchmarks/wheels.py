"""What a whole wheel costs: time per point and memory over the number of sectors, against one sector, on ranks.

    OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/wheels.py growth
    OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/wheels.py one --sectors 150 --harmonics 15 --samples 128 \\
        --start 8e-6 --stop 1.05e-5
    OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/wheels.py ranks --sectors 36 --start 6e-5 --stop 1e-4

A blisk of hexahedra whose rim rubs on a ground ring in 3-D contact; a travelling wave of N / 6 nodal diameters by the
whole wheel (unfolded, Krylov) and by one sector. Sectors keep their size: the radius grows with their number. Times are
processor time of the slowest rank, the same as wall time on an idle machine.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import time
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

import fretwave as fw
from fretwave import balanced, fe

COMM = MPI.COMM_WORLD
SECTORS = (6, 12, 24, 36, 72)
WIDTH, HEIGHT, BLADE, DEPTH = 0.05, 0.03, 0.09, 0.02  #: of a sector at the rim, of disk, blade, along the axis [m]
STEEL = fe.Material(2.1e11, 0.3, 7800.0)
LAW = {"normal_stiffness": 4e7, "tangential_stiffness": 3e7, "friction_coefficient": 0.3, "normal_load": 50.0}
BORE = 1e9  #: springs that hold the bore [N/m]


def say(text: str) -> None:
    if COMM.rank == 0:
        print(text, flush=True)


def memory_gb() -> float:
    """Of all ranks at most. Collective."""
    return COMM.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)


def blisk(sectors: int, cells: int) -> tuple[fw.Sector, int]:
    """A sector with its faces tied, and its dof at the blade's tip."""
    rim, angle = sectors * WIDTH / (2 * np.pi), 2 * np.pi / sectors

    def mapping(inner: float, outer: float, low: float, high: float) -> Any:
        def place(cube: Any) -> Any:
            r, t = inner + (outer - inner) * cube[:, 0], angle * (low + (high - low) * cube[:, 1])
            return np.column_stack([r * np.cos(t), r * np.sin(t), DEPTH * cube[:, 2]])

        return place

    parts = [
        fe.Block(name, (n * cells, cells, cells), mapping(*radii, k / 3, (k + 1) / 3))
        for name, n, radii, thirds in (
            ("disk", 2, (rim - HEIGHT, rim), range(3)),
            ("blade", 3, (rim, rim + BLADE), [1]),
        )
        for k in thirds
    ]
    parts = [fe.Block(f"{p.name}_{k}", p.cells, p.mapping) for k, p in enumerate(parts)]
    mesh = fe.join(parts, order=1)
    M, K = fe.assemble(mesh, STEEL)
    radius, turn = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1]), np.arctan2(mesh.nodes[:, 1], mesh.nodes[:, 0]) / angle
    low, high = np.flatnonzero(np.abs(turn) < 1e-9), np.flatnonzero(np.abs(turn - 1) < 1e-9)
    low, high = fw.match_faces(mesh.nodes, low, high, sectors)
    bore = np.flatnonzero((radius < rim - HEIGHT + 1e-9) & (turn < 1 - 1e-9))
    K = K + sp.diags(np.bincount((3 * bore[:, None] + np.arange(3)).ravel(), minlength=mesh.n_dof) * BORE / len(bore))
    rubs = np.flatnonzero((np.abs(radius - rim) < 1e-9) & (mesh.nodes[:, 2] < 1e-9) & (turn > 1e-9) & (turn < 1 - 1e-9))
    frames = [
        np.array([[0, 0, -1.0], [np.cos(t), np.sin(t), 0], [-np.sin(t), np.cos(t), 0]]) for t in angle * turn[rubs]
    ]
    rows = sp.lil_matrix((3 * len(rubs), mesh.n_dof))
    for k, (node, frame) in enumerate(zip(rubs, frames)):
        rows[3 * k : 3 * k + 3, 3 * node : 3 * node + 3] = frame
    contact = fw.Contact("coulomb_3d", rows.tocsr(), LAW, "rim")
    dofs = [(3 * side[:, None] + np.arange(3)).ravel() for side in (low, high)]
    sector = fw.Sector.from_faces(M, K, *dofs, sectors, 1e-7 * K, [contact], axis="z")
    tip = 3 * mesh.nearest([rim + BLADE, 0.0, DEPTH]) + 2
    return sector, int(np.searchsorted(np.setdiff1d(np.arange(mesh.n_dof), dofs[1]), tip))


def follow(problem: Any, options: argparse.Namespace, y0: Any = None, way: float = 0.0) -> dict[str, Any]:
    """A branch of a few points through slip; cost per point, and the values at its end.

    `y0` : first guess, found within `way` seconds; without it the linear mode.
    """
    steps = fw.StepControl(initial=0.3, maximum=0.3)
    guess = problem.initial(options.start) if y0 is None else y0
    branch = fw.Continuation(problem, guess, (options.start, options.stop), steps)
    seconds, newton, linear, began, first = [], 0, 0, time.process_time() - way, None
    for point in branch:
        first = first or point.y
        seconds.append(COMM.allreduce(time.process_time() - began, MPI.MAX))
        newton, linear, state = newton + point.newton, linear + point.linear, problem.state(point.y)
        slip = problem.diagnostics(point.y)["slip"]
        if options.verbose:
            counts = f"newton {point.newton} GMRES {point.linear}"
            say(f"  a {state['amplitude']:.3e} slip {slip:.2f} {counts} {seconds[-1]:.2f} s")
        began = time.process_time()
    text = branch.reason
    branch.destroy()
    cost = {"seconds": sum(seconds) / len(seconds), "points": len(seconds), "newton": newton}
    cost["behind"] = sum(seconds[1:]) / max(1, len(seconds) - 1)  # the first has the way up to it from stick
    found = {"slip": slip, "state": state, "reason": text, "first": first, "way": seconds[0]}
    return {**cost, "gmres": linear / max(1, newton), **found}


def compared(sector: fw.Sector, tip: int, diameters: int, linear_mode: int, options: argparse.Namespace) -> float:
    """A wheel's branch and its sector's, in words; seconds a point of the wheel. Collective."""
    harmonics = fw.Harmonics(range(options.harmonics + 1), options.samples)
    with sector.model(diameters, COMM) as model:
        stuck = fw.linear_modes(model, linear_mode)[linear_mode - 1]
        problem = fw.NonlinearMode(model, harmonics, "CNM", tip, stuck, "sector_")
        rest = balanced(model, stuck)
        problem.preload(rest.displacement, rest.load)
        alone = follow(problem, options)
        whole = around(sector, tip, problem, rest, alone, diameters, options)
        problem.destroy()
    apart = [abs(whole["state"][key] / alone["state"][key] - 1) for key in ("omega", "beta")]
    unknowns = sector.sectors * sector.n_dof * harmonics.block_size
    say(
        f"{sector.sectors} sectors of {sector.n_dof} dofs, {unknowns} unknowns,"
        f" {COMM.size} ranks: {whole['points']} points to {100 * whole['slip']:.0f} % slip,"
        f" {whole['seconds']:.3f} s a point,"
        f" {whole['behind']:.3f} s behind the first ({whole['newton']} Newton steps, {whole['gmres']:.1f} GMRES each),"
        f" one sector {alone['seconds']:.4f} s,"
        f" ratio {whole['seconds'] / alone['seconds'] / sector.sectors:.2f} N, {memory_gb():.2f} GB;"
        f" apart from the sector: omega {apart[0]:.0e}, beta {apart[1]:.0e}; {whole['reason']}"
    )
    return float(whole["seconds"])


def around(
    sector: fw.Sector, tip: int, one: Any, rest: fw.Rest, alone: dict[str, Any], diameters: int, options: Any
) -> dict[str, Any]:
    """The wheel's branch, from where its sector's begins or (--own-way) from its own linear mode. Collective."""
    began = time.process_time()
    wheel = sector.wheel(COMM)
    say(f"wheel made in {time.process_time() - began:.0f} s, {memory_gb():.1f} GB")
    start = sector.around(one.start, diameters)
    PETSc.Options()["wheel_route"] = "krylov"
    avoided = start.shape - 1j * start.imaginary
    problem = fw.NonlinearMode(wheel, one.harmonics, "CNM", tip, start, "wheel_", avoided)
    problem.preload(np.tile(rest.displacement, sector.sectors), np.tile(rest.load, sector.sectors))
    if options.own_way:
        return follow(problem, options)
    return follow(problem, options, fw.around_wheel(problem, one, alone["first"], diameters), alone["way"])


def one(options: argparse.Namespace) -> None:
    """A wheel and its sector."""
    sector, tip = blisk(options.sectors, options.cells)
    seconds = compared(sector, tip, max(1, options.sectors // 6), 1, options)
    say(f"{options.sectors} {seconds} {memory_gb()}")


def growth(options: argparse.Namespace) -> None:
    """Over the number of sectors, one process each for its peak memory."""
    found = []
    for sectors in SECTORS:
        command = [sys.executable, __file__, "one", "--sectors", str(sectors), *sys.argv[2:]]
        text = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
        say(text.rstrip())
        found.append([float(word) for word in text.splitlines()[-1].split()])
    sectors, seconds, memory = np.log(np.array(found)).T
    say(f"time ~ N^{np.polyfit(sectors, seconds, 1)[0]:.2f}, memory ~ N^{np.polyfit(sectors, memory, 1)[0]:.2f}")


def ranks(options: argparse.Namespace) -> None:
    """The wheel on 1 and 2 ranks: processor time of the slowest rank, and the same answer."""
    seconds = []
    for count in (1, 2):
        command = ["mpirun", "-n", str(count), sys.executable, __file__, "one", *sys.argv[2:]]
        # the environment as it was before this process called MPI_Init, whose marks would mislead mpirun
        text = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=dict(os.environ)).stdout
        say(text.rstrip())
        seconds.append(float(text.splitlines()[-1].split()[1]))
    say(f"speed-up on 2 ranks: {seconds[0] / seconds[1]:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["growth", "one", "ranks"])
    parser.add_argument("--sectors", type=int, default=24)
    parser.add_argument("--cells", type=int, default=2, help="of a third of the sector, each way")
    parser.add_argument("--harmonics", type=int, default=5)
    parser.add_argument("--samples", type=int, default=144)
    parser.add_argument("--start", type=float, default=2e-5, help="[m]")
    parser.add_argument("--stop", type=float, default=2e-4, help="[m]")
    parser.add_argument("--own-way", action="store_true", help="the wheel goes up to its first point by itself")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    {"growth": growth, "one": one, "ranks": ranks}[options.what](options)


if __name__ == "__main__":
    main()
