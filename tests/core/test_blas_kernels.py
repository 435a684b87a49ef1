"""OpenBLAS that takes this processor for one of 2004 is mended when the core is loaded, whoever loaded it first."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import own_environment

from fretwave import _core

CPU = Path("/proc/cpuinfo")
modern = pytest.mark.skipif(
    not _core.blas_kernels() or not CPU.exists() or "avx2" not in CPU.read_text(),
    reason="another BLAS than OpenBLAS, or a processor without AVX2",
)
#: numpy loads OpenBLAS, which takes what the variable says; then the core comes, and the variable may be gone.
SCRIPT = """
import os
import numpy as np

a = np.random.default_rng(1).random((300, 300))
before = a @ a
{meanwhile}
from fretwave import _core

print(_core.blas_kernels(), abs(a @ a - before).max() / before.max(), np.linalg.cond(np.linalg.solve(a, before)) > 0)
"""


def kernels(launch, meanwhile: str) -> str:
    done = launch(1, "-c", SCRIPT.format(meanwhile=meanwhile), env=own_environment(OPENBLAS_CORETYPE="Prescott"))
    assert done.returncode == 0, done.stderr
    name, apart, _ = done.stdout.split()
    assert float(apart) < 1e-14
    return name


@modern
@pytest.mark.ranks(1)
def test_kernels_of_an_old_processor_are_left(launch) -> None:
    """As OpenBLAS takes a processor it does not know, for all its vectors, for a Prescott."""
    assert kernels(launch, "del os.environ['OPENBLAS_CORETYPE']") != "Prescott"


@modern
@pytest.mark.ranks(1)
def test_what_the_user_asks_for_stays(launch) -> None:
    assert kernels(launch, "") == "Prescott"


@modern
def test_this_process_has_those_of_its_processor() -> None:
    assert _core.blas_kernels() != "Prescott"
