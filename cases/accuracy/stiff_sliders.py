"""Branches of the two-dof oscillator with Jenkins elements of any stiffness: points, Newton steps and what ends them.

    OMP_NUM_THREADS=1 .venv/bin/python cases/accuracy/stiff_sliders.py

from the top folder prints the table of README.md: complex nonlinear mode from 0.02 to 3 m, odd harmonics.
"""

from __future__ import annotations

import time

from mpi4py import MPI
from study import LIMIT, B, K, M

import fretwave as fw


def row(stiffness: float, H: int, samples: int) -> str:
    damper = fw.Contact("jenkins", [B], {"tangential_stiffness": stiffness, "friction_limit": LIMIT}, "damper")
    model = fw.Model(M, K, contacts=[damper], comm=MPI.COMM_WORLD)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(range(1, H + 1, 2), samples), "CNM", 0, start)
    branch = fw.Continuation(problem, problem.initial(0.02), (0.02, 3.0))
    began = time.process_time()
    points = list(branch)
    seconds = time.process_time() - began
    peak = max(problem.state(point.y)["zeta"] for point in points)
    end = "3 m" if branch.converged else f"{points[-1].parameter:.3g} m: {branch.reason.split(';')[0].rstrip(': ')}"
    newton = sum(point.newton for point in points)
    return f"| {stiffness:.0e} | {H} | {samples} | {len(points)} | {newton} | {peak:.5f} | {end} | {seconds:.1f} |"


def main() -> None:
    print("| kt [N/m] | H | N_t | points | Newton steps | largest zeta | ends at | time [s] |")
    print("|---" + "|---:" * 5 + "|---|---:|")
    for H, samples in ((7, 16), (7, 1024), (21, 44), (21, 1024)):
        for stiffness in (1e4, 1e6, 1e8, 1e10, 1e12):
            print(row(stiffness, H, samples), flush=True)


if __name__ == "__main__":
    main()
