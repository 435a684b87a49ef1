"""Estimated errors of few component modes against the unreduced model: chains at random that rub on the ground.

    OMP_NUM_THREADS=1 .venv/bin/python cases/accuracy/component_modes.py

from the top folder prints the table of README.md. Complex nonlinear modes from stick to full slip, by the same
harmonics with and without the reduction, so that what the modes leave out is all that lies between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

import fretwave as fw

CHAINS, MODES, HARMONICS, SAMPLES, PLACES = 40, range(1, 6), range(1, 7, 2), 128, 12
#: Relative difference of lambda below which a place is not judged.
JUDGED = 1e-8


@dataclass(frozen=True)
class Chain:
    """Masses on springs, the first held, with Jenkins pads between some of them and the ground."""

    M: sp.csr_matrix
    K: sp.csr_matrix
    C: sp.csr_matrix
    pads: np.ndarray  #: places of the pads
    observed: int
    stiffness: float  #: of a pad, whose friction limit is 1

    @classmethod
    def at_random(cls, seed: int) -> Chain:
        rng = np.random.default_rng(seed)
        n = int(rng.integers(12, 50))
        springs = rng.uniform(0.5, 1.5, n + 1) * n**2
        springs[-1] *= rng.integers(2)  # held at its other end, or free
        K = sp.diags([springs[:-1] + springs[1:], -springs[1:-1], -springs[1:-1]], [0, 1, -1]).tocsr()
        C = 10 ** rng.uniform(-6, -3) * K
        pads = rng.choice(n, int(rng.integers(1, 4)), replace=False)
        stiffness = n * 10 ** rng.uniform(-1, 1.5)
        return cls(sp.diags(rng.uniform(0.5, 1.5, n)).tocsr(), K, C, pads, int(rng.integers(n)), stiffness)

    @property
    def kept(self) -> np.ndarray:
        return np.union1d(self.pads, [self.observed])

    def amplitudes(self) -> np.ndarray:
        """From where pads stick to where they slide nearly all the time."""
        return np.geomspace(0.3, 300.0, PLACES) / self.stiffness


def branch(chain: Chain, modes: int | None, prefix: str) -> dict[float, tuple[complex, float]]:
    """lambda and its estimated error at the amplitudes that are reached; `modes` None: unreduced."""
    n, places = len(chain.pads), chain.amplitudes()
    B = np.zeros((n, chain.M.shape[0]))
    B[np.arange(n), chain.pads] = 1.0
    M, K, C, dof, omitted = chain.M, chain.K, chain.C, chain.observed, None
    if modes is not None:
        with fw.reduce(M, K, C, keep=chain.kept, modes=modes, comm=MPI.COMM_WORLD) as r:
            M, K, C, omitted = r.M, r.K, r.C, r.omitted
            B, dof = r.rows(B), int(np.searchsorted(chain.kept, chain.observed))
    pads = fw.Contact("jenkins", B, {"tangential_stiffness": chain.stiffness, "friction_limit": 1.0}, "pads")
    model = fw.Model(M, K, C, [pads], MPI.COMM_WORLD, omitted=omitted)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(HARMONICS, SAMPLES), "CNM", dof, start, prefix)
    steps = fw.Continuation(problem, problem.initial(places[0]), (places[0], places[-1]), report_at=list(places[1:-1]))
    found: dict[float, tuple[complex, float]] = {}
    for point in steps:
        if point.event in ("start", "report", "stop"):
            value = problem.meaning.eigenvalue(problem.scalars(point.y))
            error = problem.errors(point.y, point.tangent)["lambda_error_reduction"] if omitted else 0.0
            found.setdefault(round(np.log(point.parameter), 9), (value, error))
    return found


def ratios(chain: Chain, modes: int, true: dict[float, tuple[complex, float]], prefix: str) -> list[float]:
    """Estimated over true error of lambda, at the places judged."""
    found = branch(chain, modes, prefix)
    both = [(true[place][0], *found[place]) for place in found if place in true]
    return [error / abs(z - value) for z, value, error in both if abs(z - value) > JUDGED * abs(z)]


def main() -> None:
    told: dict[int, list[float]] = {modes: [] for modes in MODES}
    for seed in range(CHAINS):
        chain = Chain.at_random(seed)
        true = branch(chain, None, f"chain{seed}_")
        for modes in MODES:
            told[modes] += ratios(chain, modes, true, f"chain{seed}_{modes}_")
    print("| component modes | places | within 3 | within 10 | more than 3 times too small | median |")
    print("|---:" * 6 + "|")
    for modes, all_of_them in told.items():
        r = np.array(all_of_them)
        shares = [((1 / k <= r) & (r <= k)).mean() for k in (3, 10)] + [(r < 1 / 3).mean()]
        print(f"| {modes} | {len(r)} | " + " | ".join(f"{100 * s:.0f} %" for s in shares) + f" | {np.median(r):.2f} |")


if __name__ == "__main__":
    main()
