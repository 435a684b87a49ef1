"""What a point of the blade root costs: both routes over the harmonics, contact pairs, ranks.

    OMP_NUM_THREADS=1 .venv/bin/python cases/blade_root/benchmark.py routes | pairs
    OMP_NUM_THREADS=1 mpirun -n 2 .venv/bin/python cases/blade_root/benchmark.py ranks

routes: direct and Krylov for H = 3, 5, 7, 11, 15: time per point, GMRES iterations, and their difference in omega and
beta at every point. pairs: 48, 192 and 768 contact pairs at H = 7. ranks: one branch, for 1 rank against 2.
Times are processor time (of the slowest rank), the same as wall time on an idle machine.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

import fretwave as fw
from fretwave import balanced, build_model, load_case, reduce_case

CASE = Path(__file__).with_name("case.toml")
AMPLITUDES = [7e-4, 9e-4, 1e-3, 1.1e-3, 1.2e-3, 1.25e-3]  #: [m], from the first slip to 30 % of the pair-samples
MESH = {"axial_cells": 24, "flank_cells": 16, "thickness_cells": 1, "radial_cells": (2, 1, 1, 2, 8)}
#: Pairs along the axis and up each flank; one mesh carries all of them.
PAIRS: dict[int, dict[str, Any]] = {
    48: {**MESH, "contact_grid": (6, 4)},
    192: {**MESH, "contact_grid": (12, 8)},
    768: {**MESH, "contact_grid": (24, 16)},
}
#: A mesh of its own, 123,093 dofs, coarse in the aerofoil; asked for by `--only 3072`.
LARGEST: dict[int, dict[str, Any]] = {
    3072: {**MESH, "axial_cells": 48, "flank_cells": 32, "radial_cells": (1, 1, 1, 1, 2), "contact_grid": (48, 32)}
}
COMM = MPI.COMM_WORLD


def say(text: str) -> None:
    if COMM.rank == 0:
        print(text, flush=True)


def reduced_model(options: dict[str, Any]) -> tuple[Any, Any, int]:
    """The case's model with other options of its builder; its rest state and the observed dof."""
    chosen = [f"model.options.{name}={list(v) if isinstance(v, tuple) else v}" for name, v in options.items()]
    case = reduce_case(load_case(CASE, chosen), COMM)
    model = build_model(case, (), COMM, case.tables.preload)
    return model, case, case.dof("tip")


def branch(model: Any, dof: int, route: str, highest: int, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Points of the first bending from stick to `options.stop` with the processor time of each."""
    PETSc.Options()["benchmark_route"], PETSc.Options()["benchmark_blocks"] = route, options.blocks
    first = fw.linear_modes(model, 1, "stuck")[0]
    rest = balanced(model, first)
    harmonics = fw.choose_harmonics(model, highest, options.samples)
    problem = fw.NonlinearMode(model, harmonics, "CNM", dof, first, "benchmark_")
    problem.preload(rest.displacement, rest.load)
    low = options.start
    steps = fw.StepControl(initial=0.1, maximum=0.2)
    followed = fw.Continuation(problem, problem.initial(low), (low, options.stop), steps, report_at=AMPLITUDES)
    rows, began = [], time.process_time()
    for point in followed:
        seconds = COMM.allreduce(time.process_time() - began, MPI.MAX)
        names = ("event", "newton", "linear", "residual")
        rows.append({**problem.state(point.y), **{name: getattr(point, name) for name in names}, "seconds": seconds})
        rows[-1]["slip"] = problem.diagnostics(point.y)["slip"]
        began = time.process_time()
    followed.destroy()
    problem.destroy()
    return rows


def cost(rows: list[dict[str, Any]]) -> tuple[float, float, float]:
    """Time [s] per point in slip, Newton steps per point, most GMRES iterations a step of any point."""
    slipping = [row for row in rows if row["slip"] > 0]
    newton = [row["newton"] for row in slipping]
    gmres = max(row["linear"] / max(1, row["newton"]) for row in slipping)
    return sum(row["seconds"] for row in slipping) / len(slipping), float(np.mean(newton)), gmres


def exponent(sizes: list[int], seconds: list[float]) -> float:
    """Of the growth of time with size, by least squares in logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def reported(rows: list[dict[str, Any]]) -> dict[float, dict[str, Any]]:
    return {round(row["amplitude"], 9): row for row in rows if row["event"] in ("report", "stop")}


def routes(options: argparse.Namespace) -> None:
    """Time per point of both routes, and their differences at every point."""
    model, _, dof = reduced_model({})
    say(f"{model.n_dof} dofs; processor time a point in slip, {options.start:g} to {options.stop:g} m")
    times: dict[str, list[float]] = {"direct": [], "krylov": []}
    for highest in options.harmonics:
        found = {}
        for route in times:
            rows = branch(model, dof, route, highest, options)
            seconds, newton, gmres = cost(rows)
            times[route].append(seconds)
            found[route] = rows
            slip = max(row["slip"] for row in rows)
            text = f"H {highest:2d} {route}: {seconds:7.3f} s a point, {newton:.1f} Newton steps"
            if route == "krylov":
                text += f", at most {gmres:.1f} GMRES iterations a step to {100 * slip:.0f} % slip"
            say(f"{text}, residual <= {max(row['residual'] for row in rows):.0e}")
        couples = [(a, b) for a, b in zip(*found.values()) if abs(a["amplitude"] / b["amplitude"] - 1) < 1e-9]
        apart = [max(abs(b[key] / a[key] - 1) for a, b in couples) for key in ("omega", "beta")]
        say(
            f"       apart at {len(couples)} of {len(found['direct'])} points:"
            f" omega {apart[0]:.1e}, beta {apart[1]:.1e}"
        )
    for route, seconds in times.items():
        say(f"{route}: time ~ H^{exponent(options.harmonics, seconds):.2f}")


def pairs(options: argparse.Namespace) -> None:
    """Time per point and memory over the number of contact pairs; one process each, for its peak memory."""
    if options.only:
        return one_grid(options)
    import subprocess

    found = []
    for count in PAIRS:
        arguments = ["pairs", "--only", str(count), *sys.argv[2:]]
        text = subprocess.run([sys.executable, __file__, *arguments], check=True, stdout=subprocess.PIPE, text=True)
        say(text.stdout.rstrip())
        found.append([float(word) for word in text.stdout.splitlines()[-1].split()])
    counts, seconds, memory = (list(column) for column in zip(*found))
    say(f"time ~ pairs^{exponent(counts, seconds):.2f}, memory ~ pairs^{exponent(counts, memory):.2f}")


def one_grid(options: argparse.Namespace) -> None:
    began = time.process_time()
    model, case, dof = reduced_model({**PAIRS, **LARGEST}[options.only])
    ready = time.process_time() - began
    rows = branch(model, dof, "krylov", 7, options)
    seconds, newton, gmres = cost(rows)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    slip = max(row["slip"] for row in rows)
    print(
        f"{options.only} pairs: {case.reduced.unreduced} dofs reduced to {model.n_dof} in {ready:.1f} s;"
        f" {len(rows)} points to {100 * slip:.0f} % slip, {seconds:.2f} s a point in slip, {newton:.1f} Newton steps,"
        f" at most {gmres:.1f} GMRES a step, peak memory {memory:.2f} GB"
    )
    print(options.only, seconds, memory)


def ranks(options: argparse.Namespace) -> None:
    """One branch on however many ranks: wall time, and the values to compare."""
    model, _, dof = reduced_model({})
    COMM.Barrier()
    began = time.perf_counter()
    rows = branch(model, dof, "krylov", 7, options)
    wall = COMM.allreduce(time.perf_counter() - began, MPI.MAX)
    say(f"{COMM.size} ranks: {len(rows)} points, {wall:.2f} s wall, {cost(rows)[0]:.3f} s processor time a point")
    for amplitude, row in reported(rows).items():
        say(f"  a {amplitude:.6g}  omega {row['omega']:.14g}  beta {row['beta']:.14g}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["routes", "pairs", "ranks"])
    parser.add_argument("--harmonics", type=int, nargs="+", default=[3, 5, 7, 11, 15])
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--start", type=float, default=6e-4, help="[m]")
    parser.add_argument("--stop", type=float, default=1.25e-3, help="[m]")
    parser.add_argument("--blocks", default="auto", help="preconditioner: auto, or dense blocks of all harmonics")
    parser.add_argument("--only", type=int, default=0, choices=[0, *PAIRS, *LARGEST], help="one grid of `pairs`")
    options = parser.parse_args()
    {"routes": routes, "pairs": pairs, "ranks": ranks}[options.what](options)


if __name__ == "__main__":
    main()
