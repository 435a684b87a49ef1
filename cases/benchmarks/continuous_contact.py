"""What contact costs that is integrated in continuous time: force and linearised force of a pair, by H.

Run it on one core from the top folder:
  OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/continuous_contact.py [laws] [--samples 128 1024]
Times are processor time of this process. N_t changes nothing here; builds that sampled a law take it as they did.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

import fretwave as fw

sys.path.insert(0, str(Path(__file__).parent))

from kernels import fastest  # noqa: E402

PAIRS, HIGHEST = 256, (3, 7, 15, 31)
PAD = {"normal_stiffness": 8.0, "tangential_stiffness": 5.0, "friction_coefficient": 0.4, "normal_load": 3.0}
LAWS: dict[str, dict[str, float]] = {
    "jenkins": {"tangential_stiffness": 5.0, "friction_limit": 1.0},
    "coulomb_2d": PAD,
    "coulomb_3d, slip": {**PAD, "tangential_stiffness": 50.0, "normal_load": 30.0},
    "coulomb_3d, lift-off": {**PAD, "tangential_stiffness": 50.0},
    "coulomb_3d, stick": {**PAD, "normal_load": 1e3},
    "unilateral_spring": {"normal_stiffness": 8.0},
    "regularised_coulomb, wide": {"friction_limit": 1.0, "regularisation_velocity": 3.0},
    "regularised_coulomb": {"friction_limit": 1.0, "regularisation_velocity": 0.1},
    "regularised_coulomb, thin": {"friction_limit": 1.0, "regularisation_velocity": 1e-6},
}


def pairs_alone(name: str, H: int, samples: int, roughness: float) -> tuple[Any, PETSc.Vec, PETSc.Vec]:
    """Pairs on a mass each, and a motion whose coefficients fall as n^-roughness; 2.0 of the fundamental slips."""
    law = name.split(",")[0]
    d, m = fw.laws()[law].components, 2 * H + 1
    n = d * PAIRS
    rng = np.random.default_rng(0)
    q = 0.3 * rng.standard_normal((n, m)) / np.repeat(np.arange(H + 1), 2)[1:].clip(1) ** roughness
    q[:, 1:3] += rng.choice([-2.0, 2.0], (n, 2))
    B = sp.identity(n, format="csr")
    model = fw.Model(B, B, None, [fw.Contact(law, B, LAWS[name])], MPI.COMM_SELF)
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics(range(H + 1), samples), "EPMC", 0, start, "bench_")
    y = problem.core.unknowns()
    y.setArray(np.concatenate([q.ravel(), [0.0, 1.0, 0.0]]))
    return problem, y, y.copy()


def measured(law: str, H: int, samples: int, roughness: float) -> tuple[tuple[float, ...], str]:
    """Microseconds a pair: force, the first product after it (with what is made once), any other; what pairs do."""
    problem, y, dy = pairs_alone(law, H, samples, roughness)
    out, beside = y.duplicate(), y.copy()
    beside.scale(1 + 1e-12)
    points = itertools.cycle((y, beside))  # a point that is known already costs nothing
    force = fastest(lambda: problem.core.residual(next(points), out), 3)
    once = fastest(lambda: problem.core.product(next(points), dy, out), 3) - force
    product = fastest(lambda: problem.core.product(y, dy, out), 3)
    found = problem.diagnostics(y)
    shares = "/".join(f"{found[name]:.2f}" for name in ("stick", "slip", "open"))
    return tuple(1e6 * t / PAIRS for t in (force, once, product)), shares


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("laws", nargs="*", metavar="laws", help=f"of {'; '.join(LAWS)} (default: all)")
    parser.add_argument("--samples", type=int, nargs="+", default=[128], metavar="N_t")
    options = parser.parse_args()
    print("| law | motion | H | N_t | force | first product | product | shares |\n" + "|---" * 2 + "|---:" * 6 + "|")
    for law in options.laws or LAWS:
        for name, roughness in {"smooth, n^-3": 3.0, "rough, n^-1.5": 1.5}.items():
            for H in HIGHEST:
                for samples in options.samples:
                    times, shares = measured(law, H, samples, roughness)
                    cells = " | ".join(f"{t:.2f}" for t in times)
                    print(f"| {law} | {name} | {H} | {samples} | {cells} | {shares} |", flush=True)


if __name__ == "__main__":
    main()
