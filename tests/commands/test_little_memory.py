"""Where there is no memory to begin with: one message, at once, whatever library would have met it first."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

from fretwave.files.memory import machine_memory, ranks_started

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


def test_memory_is_that_of_all_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    """12 ranks, four of them here: three machines."""
    for name in ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"):
        monkeypatch.delenv(name, raising=False)
    alone = machine_memory()
    assert ranks_started() == (1, 1)
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "12")
    monkeypatch.setenv("OMPI_COMM_WORLD_LOCAL_SIZE", "4")
    assert ranks_started() == (12, 4) and machine_memory() == 3 * alone
