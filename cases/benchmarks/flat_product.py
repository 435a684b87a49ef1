"""Dense matrices times the coefficients of all dofs: the core's product against the BLAS that numpy calls.

    OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/flat_product.py

Both in turn on the same entries, least time of many; coefficients of a dof lie side by side in both.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from fretwave import _core

SIZES = (510, 2304)  #: dofs, or rows of contact
COEFFICIENTS = (7, 15, 31, 63)  #: H = 3, 7, 15, 31


def in_turn(B: Any, A: Any, transposed: bool, repeats: int = 21) -> tuple[float, float]:
    """Least time of the core's product and of numpy's [ms]."""
    calls: list[Callable[[], Any]] = [
        lambda: _core.flat_product(B, A, transposed),
        lambda: (B.T if transposed else B) @ A,
    ]
    least = [np.inf, np.inf]
    for _ in range(repeats):
        for k, call in enumerate(calls):
            began = time.perf_counter()
            call()
            least[k] = min(least[k], 1e3 * (time.perf_counter() - began))
    return least[0], least[1]


def main() -> None:
    print(f"BLAS: OpenBLAS with kernels for {_core.blas_kernels()}" if _core.blas_kernels() else "BLAS: another")
    print("| | entries | coefficients | core [ms] | BLAS [ms] | times | GFlop/s |\n|---|---|---|---|---|---|---|")
    rng = np.random.default_rng(1)
    for real in (np.float64, np.float32):
        for n in SIZES:
            B = rng.standard_normal((n, n)).astype(real)
            for m in COEFFICIENTS:
                A = rng.standard_normal((n, m)).astype(real)
                for transposed in (False, True):
                    core, blas = in_turn(B, A, transposed)
                    print(
                        f"| {real.__name__}{', transposed' if transposed else ''} | {n} x {n} | {m} | {core:.2f}"
                        f" | {blas:.2f} | {blas / core:.1f} | {2e-6 * n * n * m / core:.0f} |"
                    )


if __name__ == "__main__":
    main()
