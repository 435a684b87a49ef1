"""What contact costs whose changes lie between samples: force and linearised force of a pair, for H and N_t.

Run it on one core from the top folder:  OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/continuous_contact.py
Times are processor time of this process. Laws that are sampled are measured with each N_t, the others once.
"""

from __future__ import annotations

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

PAIRS, HIGHEST, SAMPLES = 256, (3, 7, 15, 31), (128, 256, 1024)
PAD = {"normal_stiffness": 8.0, "tangential_stiffness": 5.0, "friction_coefficient": 0.4, "normal_load": 3.0}
LAWS: dict[str, dict[str, float]] = {
    "jenkins": {"tangential_stiffness": 5.0, "friction_limit": 1.0},
    "coulomb_2d": PAD,
    "coulomb_3d": PAD,
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


def measured(law: str, H: int, samples: int, roughness: float) -> tuple[float, float, float]:
    """Microseconds a pair: force, the first product after it (with what a linearisation costs once), any other."""
    problem, y, dy = pairs_alone(law, H, samples, roughness)
    out = y.duplicate()
    force = fastest(lambda: problem.core.residual(y, out), 3)
    product = fastest(lambda: problem.core.product(y, dy, out), 3)

    def both() -> None:
        problem.core.residual(y, out)
        problem.core.product(y, dy, out)

    once = fastest(both, 3) - force
    return tuple(1e6 * t / PAIRS for t in (force, once, product))  # type: ignore[return-value]


def main() -> None:
    print(
        "| law | motion | H | N_t | force [us] | first product [us] | product [us] |\n" + "|---" * 2 + "|---:" * 5 + "|"
    )
    for law in LAWS if len(sys.argv) < 2 else sys.argv[1:]:
        for name, roughness in {"smooth, n^-3": 3.0, "rough, n^-1.5": 1.5}.items():
            for H in HIGHEST:
                for samples in SAMPLES:
                    times = measured(law, H, samples, roughness)
                    print(
                        f"| {law} | {name} | {H} | {samples} | " + " | ".join(f"{t:.2f}" for t in times) + " |",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
