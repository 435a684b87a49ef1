"""OpenBLAS that takes this processor for one of 2004 is mended when the core is loaded, whoever loaded it first."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import pytest
from conftest import own_environment

from fretwave import _core


def can_choose() -> bool:
    """OpenBLAS was built for many processors, and this is one that it may take for too old a one."""
    cpu = Path("/proc/cpuinfo")
    try:
        config = ctypes.CDLL("libopenblas.so.0").openblas_get_config
    except (OSError, AttributeError):
        return False
    config.restype = ctypes.c_char_p
    return b"DYNAMIC_ARCH" in config() and cpu.exists() and "avx2" in cpu.read_text()


modern = pytest.mark.skipif(not can_choose(), reason="no OpenBLAS for many processors, or none with AVX2")
#: numpy loads OpenBLAS, which takes what the variable says; then the core comes, and the variable may be gone.
SCRIPT = """
import os
import numpy as np

a = np.random.default_rng(1).random((300, 300))
before = a @ a
{meanwhile}
from fretwave import _core

print(_core.blas_kernels(), abs(a @ a - before).max() / before.max())
"""


def kernels(launch, meanwhile: str) -> str:
    done = launch(1, "-c", SCRIPT.format(meanwhile=meanwhile), env=own_environment(OPENBLAS_CORETYPE="Prescott"))
    assert done.returncode == 0, done.stderr
    name, apart = done.stdout.split()
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
@pytest.mark.skipif("OPENBLAS_CORETYPE" in os.environ, reason="OPENBLAS_CORETYPE says what to take")
def test_this_process_has_those_of_its_processor() -> None:
    assert _core.blas_kernels() != "Prescott"
