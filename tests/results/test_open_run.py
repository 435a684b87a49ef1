"""A run folder read in a script: done, going on or killed, and without MPI and PETSc."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import fretwave as fw
from fretwave.columns import MODE
from fretwave.results.results import AnalysisWriter

pytestmark = pytest.mark.ranks(1)

AMPLITUDES = np.geomspace(0.1, 1.0, 5)


def write(folder, done):
    """A linear mode of 2 Hz, its shape (1, 0.5)."""
    writer = AnalysisWriter(folder, "mode", MODE, {"type": "mode"}, ["tip", "root"], ["1c", "1s"])
    for i, a in enumerate(AMPLITUDES):
        row = dict.fromkeys(MODE, 0.0) | {"point": i, "newton": 2, "linear": 2, "accepted": 1, "event": ""}
        row |= {"amplitude": a, "frequency_hz": 2.0, "event": "start" if i == 0 else ""}
        writer.append(row, a * np.array([[1.0, 0.0], [0.5, 0.0]]))
    if done:
        writer.close("done", "stop value reached")


@pytest.mark.parametrize("done", [True, False])
def test_values_of_a_run_that_is_done_and_of_one_that_was_killed(tmp_path, done):
    write(tmp_path, done)
    run = fw.open_run(tmp_path)
    mode = run["mode"]
    assert list(run) == ["mode"] and len(run) == 1 and "mode" in run
    np.testing.assert_array_equal(mode["amplitude"], AMPLITUDES)
    assert list(mode["event"]) == ["start", "", "", "", ""] and len(mode) == 5
    np.testing.assert_array_equal(mode.coefficients([1, 4])[:, 1, 0], 0.5 * AMPLITUDES[[1, 4]])
    np.testing.assert_array_equal(mode.coefficients()[:, 0, 0], AMPLITUDES)
    assert (mode.dofs, mode.labels) == (["tip", "root"], ["1c", "1s"])
    assert "5 points" in repr(run) and "zeta" in repr(mode)
    np.testing.assert_array_equal(run.table("mode")["amplitude"], AMPLITUDES)
    column = mode["amplitude"]
    column *= 1e3  # of the script alone
    np.testing.assert_array_equal(mode["amplitude"], AMPLITUDES)


def test_what_is_not_there_is_said(tmp_path):
    with pytest.raises(fw.InputError, match="no results here(?s:.*)give the folder of a run"):
        fw.open_run(tmp_path)
    write(tmp_path, True)
    with pytest.raises(KeyError, match="mode"):
        fw.open_run(tmp_path)["forced"]
    with pytest.raises(KeyError, match="zeta"):
        fw.open_run(tmp_path)["mode"]["damping"]


def test_reading_needs_neither_mpi_nor_petsc(tmp_path, launch):
    write(tmp_path, True)
    model = fw.Model([[1.0]], [[4.0]])
    branch = fw.follow(fw.NonlinearMode(model, fw.choose_harmonics(model, 1)), 0.1, 1.0)
    branch.save(tmp_path / "branch.h5")
    script = f"""
import sys
sys.modules.update(dict.fromkeys(["mpi4py", "petsc4py", "slepc4py", "fretwave._core"]))
import fretwave as fw
print(fw.open_run({str(tmp_path)!r})["mode"]["frequency_hz"][-1])
branch = fw.Branch.load({str(tmp_path / "branch.h5")!r})
print(f"{{branch.at(0.5)['omega'][0]:.6f}}")
branch.plot().savefig({str(tmp_path / "branch.png")!r})
"""
    done = launch(1, "-c", script)
    assert done.stdout.split() == ["2.0", "2.000000"], done.stderr
    assert (tmp_path / "branch.png").exists() and "mpi4py" in sys.modules
