"""Solve time of the nonlinear mode (H = 21, N_t = 1024) over the whole branch a = 0.03 to 10 m, and where it goes.

Run it on one core from the top folder:  OMP_NUM_THREADS=1 .venv/bin/python cases/two_dof/benchmark.py
Only the branch is timed: linear modes, diagnostics and output of a `fretwave run` are not part of it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import fretwave as fw
from fretwave import build_model, load_case

CASE = Path(__file__).with_name("case.toml")
FIRST, LAST = 0.03, 10.0
#: PETSc's own timers of a Newton iteration; the first contains the others
EVENTS = {
    "Newton, all (SNESSolve)": "SNESSolve",
    "residuals": "SNESFunctionEval",
    "Jacobians": "SNESJacobianEval",
    "factorisations": "MatLUFactor",
    "triangular solves": "MatSolve",
}


@contextmanager
def mode_problem(method: str, harmonics: int, samples: int) -> Iterator[Any]:
    """The case's mode, at chosen harmonics and samples."""
    case = load_case(CASE)
    analysis = case.analyses["mode"]
    assert analysis.type == "mode"
    with build_model(case, [], MPI.COMM_WORLD) as model:
        start = fw.linear_modes(model, count=1, contact="stuck")[0]
        chosen = fw.choose_harmonics(model, harmonics, samples, "auto")
        dof = case.dof(analysis.normalise)
        problem = fw.NonlinearMode(model, chosen, method=method, dof=dof, start=start, prefix="benchmark_")
        yield problem
        problem.destroy()


def whole_branch(problem: Any) -> tuple[float, float, int, int]:
    """Wall time [s], processor time [s], points and Newton iterations of one branch."""
    began, busy = time.perf_counter(), time.process_time()
    branch = fw.Continuation(problem, problem.initial(FIRST), stop=(FIRST, LAST))
    newton = [point.newton for point in branch]
    wall, busy = time.perf_counter() - began, time.process_time() - busy
    assert branch.converged, branch.reason
    branch.destroy()
    return wall, busy, len(newton), sum(newton)


def seconds_in(event: str) -> tuple[float, int]:
    """PETSc's timer: seconds and calls since the start of logging."""
    info = PETSc.Log.Event(event).getPerfInfo()
    return info["time"], info["count"]


def report_shares(problem: Any) -> None:
    """Print what one branch spends in PETSc's events."""
    PETSc.Log.begin()
    before = {name: seconds_in(event) for name, event in EVENTS.items()}
    wall, *_ = whole_branch(problem)
    print(f"where {1e3 * wall:.1f} ms go (a branch with PETSc's timers on):")
    for name, event in EVENTS.items():
        seconds, calls = (after - start for after, start in zip(seconds_in(event), before[name]))
        each = 1e6 * seconds / max(calls, 1)
        print(f"  {name:24s} {1e3 * seconds:7.1f} ms  {100 * seconds / wall:4.0f} %  {calls:5d} calls of {each:.1f} us")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", default="CNM", choices=["CNM", "EPMC"])
    parser.add_argument("--harmonics", type=int, default=21)
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    with mode_problem(options.method, options.harmonics, options.samples) as problem:
        whole_branch(problem)  # the first one also plans the Fourier transforms and fills caches
        runs = [whole_branch(problem) for _ in range(options.repeats)]
        walls, (_, _, points, newton) = sorted(run[0] for run in runs), runs[0]
        wall, busy = median(walls), median(run[1] for run in runs)
        print(f"{options.method}, H = {options.harmonics}, N_t = {options.samples}, a = {FIRST:g} to {LAST:g} m")
        print(
            f"median of {len(runs)}: {1e3 * wall:.1f} ms (fastest {1e3 * walls[0]:.1f}, slowest {1e3 * walls[-1]:.1f})"
        )
        print(f"processor time, median: {1e3 * busy:.1f} ms (the same as wall time on an idle machine)")
        print(f"{points} points, {newton} Newton iterations, {1e6 * busy / newton:.0f} us per Newton iteration")
        report_shares(problem)


if __name__ == "__main__":
    main()
