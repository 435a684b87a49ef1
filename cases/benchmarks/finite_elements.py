"""What a point of a model that is not reduced costs: kinds of preconditioners against each other, in one run.

    OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/finite_elements.py [--mesh coarse | default | fine | finest]
        [--harmonics 7] [--kinds fwstatic fwcondensed] [--start 7e-4 --stop 1.3e-3]

The blade root of ``cases/blade_root``, all its dofs and 48, (fine) 768 or (finest) 3,072 contact pairs, followed from
stick into slip.
Times are processor time of the slowest rank, events of the branch with the point behind them; it runs under mpirun.
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
from fretwave import balanced

sys.path.insert(0, str(Path(__file__).parents[1] / "blade_root"))
from benchmark import LARGEST, PAIRS  # noqa: E402

from model import build  # noqa: E402

COMM = MPI.COMM_WORLD
FRICTION, STIFFNESS_DAMPING = 0.5, 2e-6  #: as in the case
MESHES: dict[str, dict[str, Any]] = {
    "coarse": {"axial_cells": 6, "thickness_cells": 1, "radial_cells": (2, 1, 1, 2, 11)},
    "default": {},
    "fine": PAIRS[768],
    "finest": LARGEST[3072],
}


def say(text: str) -> None:
    if COMM.rank == 0:
        print(text, flush=True)


def seconds_since(began: float) -> float:
    return float(COMM.allreduce(time.process_time() - began, MPI.MAX))


def branch(problem: Any, start: float, stop: float) -> list[dict[str, Any]]:
    """Points from stick into slip, with the processor time of each. Collective."""
    began = time.process_time()
    steps = fw.StepControl(initial=0.1, maximum=0.2)
    followed = fw.Continuation(problem, problem.initial(start), (start, stop), steps, report_at=[stop], upwards=True)
    rows = []
    for point in followed:
        rows.append({**problem.state(point.y), "seconds": seconds_since(began)})
        row, slip = rows[-1], problem.diagnostics(point.y)["slip"]
        say(
            f"  {row['amplitude']:8.3e} m  omega {row['omega']:.9f} rad/s  zeta {row['zeta']:.10f}  slip {slip:5.3f}"
            f"  {point.newton:2d} Newton {point.linear:4d} GMRES {row['seconds']:7.2f} s"
        )
        began = time.process_time()
    say(f"  {followed.route}{'' if followed.converged else ': ' + followed.reason}")
    followed.destroy()
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mesh", choices=[*MESHES], default="default")
    parser.add_argument("--harmonics", type=int, default=7)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--kinds", nargs="+", default=["fwstatic", "fwcondensed"])
    parser.add_argument("--start", type=float, default=7e-4, help="amplitude of the tip [m]")
    parser.add_argument("--stop", type=float, default=1.3e-3)
    chosen = parser.parse_args()
    built = build(**MESHES[chosen.mesh])
    root = built.pairs["root"]
    contact = fw.Contact("coulomb_3d", root.B, {**root.parameters, "friction_coefficient": FRICTION}, "root")
    model = fw.Model(built.M, built.K, STIFFNESS_DAMPING * built.K, [contact])
    first = fw.linear_modes(model, 1, "stuck")[0]
    rest = balanced(model, first)
    harmonics = fw.Harmonics(range(chosen.harmonics + 1), chosen.samples)
    say(
        f"{model.n_dof} dofs, {root.B.shape[0] // 3} pairs, H = {chosen.harmonics}, {COMM.size} ranks;"
        f" peak memory of rank 0 {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024} MB"
    )
    results = []
    for kind in chosen.kinds:
        say(kind)
        PETSc.Options()[f"{kind}_pc_type"] = kind
        problem = fw.NonlinearMode(model, harmonics, "CNM", built.dofs["tip"], first, f"{kind}_")
        problem.preload(rest.displacement, rest.load)
        results.append(branch(problem, chosen.start, chosen.stop))
        say(f"  peak memory of rank 0 {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024} MB")
    for kind, other in zip(chosen.kinds[1:], results[1:]):
        share = np.mean([row["seconds"] for row in other]) / np.mean([row["seconds"] for row in results[0]])
        apart = [abs(other[-1][key] / results[0][-1][key] - 1) for key in ("omega", "zeta")]
        say(
            f"{kind} takes {share:.1f} times as long a point;"
            f" apart at the end omega {apart[0]:.1e}, zeta {apart[1]:.1e}"
        )


if __name__ == "__main__":
    main()
