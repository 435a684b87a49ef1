"""Where there is no memory to begin with: one message, at once, whatever library would have met it first."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

from fretwave.errors import PetscError
from fretwave.files.memory import machine_memory, ranks_started
from fretwave.mpi.guard import describe

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"


@pytest.mark.parametrize("limit", [120, 200, 250, 300, 400])
@pytest.mark.parametrize("command", [["run"], ["study", "--harmonics", "1"]])
def test_too_little_memory_is_named(limit: int, command: list[str], tmp_path: Path) -> None:
    """Address space of so many MB; MPI waited for ever (260) or crashed (280), PETSc blamed a library (300 to 480)."""
    ended = subprocess.run(
        [sys.executable, "-m", "fretwave", *command, str(CASE), "--quick", "--out", str(tmp_path / "run")],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit << 20, limit << 20)),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 1
    assert ended.stderr.count("error:") == 1 and "not enough memory to begin with" in ended.stderr


LATER = """
import resource
from fretwave.files.memory import check_room
check_room()
import numpy as np
pages = int(open("/proc/self/statm").read().split()[0])
resource.setrlimit(resource.RLIMIT_AS, ((pages * resource.getpagesize()) + (64 << 20),) * 2)
print(np.linalg.eigvalsh(np.eye(200))[-1])
"""


def test_openblas_has_its_buffer_before_memory_is_short() -> None:
    """It waits for ever for one of 134 MB that it cannot have; a small product took none where there is AVX-512."""
    ended = subprocess.run([sys.executable, "-c", LATER], capture_output=True, text=True, timeout=20)
    assert ended.stdout.strip() == "1.0", ended.stderr


MUMPS = "PETSc error 76: Error reported by MUMPS in numerical factorization phase: INFOG(1)=%d, INFO(2)=8193268"


@pytest.mark.parametrize(
    "error",
    [
        RuntimeError("can't start new thread"),
        PetscError(MUMPS % -13),
        PetscError("the stiffness could not be factorised: MUMPS INFOG(1) = -13"),
        PetscError("PETSc error 55: Out of memory. Allocated: 0"),
    ],
    ids=["thread", "MUMPS within PETSc", "MUMPS", "PETSc"],
)
def test_memory_is_named_whoever_lacks_it(error: Exception) -> None:
    said = describe(error)
    assert said.startswith("error: there is not enough memory") and "fix:" in said


def test_another_failure_of_mumps_is_not_for_memory() -> None:
    assert "not enough memory" not in describe(PetscError(MUMPS % -10))


def test_memory_is_that_of_all_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    """12 ranks, four of them here: three machines."""
    for name in ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"):
        monkeypatch.delenv(name, raising=False)
    alone = machine_memory()
    assert ranks_started() == (1, 1)
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "12")
    monkeypatch.setenv("OMPI_COMM_WORLD_LOCAL_SIZE", "4")
    assert ranks_started() == (12, 4) and machine_memory() == 3 * alone
