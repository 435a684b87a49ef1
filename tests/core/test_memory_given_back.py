"""What is freed is the system's again, although a library of PETSc's would have the process keep it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import fretwave as fw

MEGABYTE = 2**20


def resident() -> float:
    """Of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / MEGABYTE


@pytest.mark.ranks(1)
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc, of glibc")
def test_a_freed_matrix_leaves_the_process() -> None:
    fw.Harmonics(range(2), 8)  # the core is loaded
    before = resident()
    block = np.ones(400 * MEGABYTE // 8)
    during = resident()
    del block
    assert during - before > 380
    assert resident() - before < 40
