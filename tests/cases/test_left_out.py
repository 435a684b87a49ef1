"""What fretwave leaves out changes nothing beyond rounding when forced on: cases/benchmarks/left_out.py, small."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from tolerances import LAST_DIGITS, TIGHT

sys.path.insert(0, str(Path(__file__).parents[2] / "cases" / "benchmarks"))
import left_out  # noqa: E402

#: Evaluated once in two forms; the others are solved to less than their tolerance.
EVALUATED = ("mean", "velocity", "sticking", "mass_off_diagonal")
SOLVED_SMALL = ("reduction", "wear")
RUNS = ("pictures", "time_integration")


def both(name: str, comm) -> list[left_out.Found]:
    row = left_out.ROWS[name]
    return [row.of(forced, row.small, comm) for forced in (True, False)]


def test_every_row_is_held_by_a_test():
    """Rows that are not below name another file, which there is."""
    tests = Path(__file__).parents[1]
    for name, row in left_out.ROWS.items():
        if name not in (*EVALUATED, *SOLVED_SMALL, *RUNS):
            assert list(tests.rglob(row.held_by.split(":")[0])), name


@pytest.mark.parametrize("name", EVALUATED)
def test_forced_on_gives_the_same_residual_and_product(name, comm):
    assert left_out.distance(*both(name, comm)) < LAST_DIGITS


@pytest.mark.parametrize("name", SOLVED_SMALL)
def test_forced_on_gives_the_same_mode(name, comm):
    forced, left = both(name, comm)
    assert left_out.distance(forced, left) < TIGHT
    assert np.ptp(left[1]) > 0.1 * np.abs(left[1]).max(), "friction damps by the amplitude"


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", RUNS)
def test_forced_on_leaves_the_table_of_a_run_to_the_last_digit(name, comm):
    assert left_out.distance(*both(name, comm)) == 0


@pytest.mark.ranks(1)
def test_what_a_run_leaves_out_it_does_not_load(launch, tmp_path):
    """No picture, reduction, wear, sweep or time integration, no file of another code, mesh or wheel: no module."""
    own = ["analyses.static", "analyses.linear", "analyses.flutter", "analyses.sweep", "analyses.wear"]
    own += ["solve.wear", "solve.steady", "solve.transient", "run.sweep", "run.sweep_analysis", "model.reduction"]
    own += ["importers", "fe", "cyclic.faces", "cyclic.reduction", "cyclic.sector"]
    modules = ["matplotlib", "scipy.io", "scipy.spatial", "skfem", *(f"fretwave.{name}" for name in own)]
    asked = f"'loaded', [name for name in {modules!r} if name in sys.modules]"
    assert ended(launch, tmp_path, "import sys", asked) == "loaded [] 0"


@pytest.mark.ranks(1)
def test_a_run_makes_its_results_of_the_journal_once(launch, tmp_path):
    """The curve for readers without the cubic is read from results.h5 before that takes its place."""
    before = "from fretwave.results import file; file._in_memory = None"
    assert ended(launch, tmp_path, before, "'made once'") == "made once 0"
    assert (tmp_path / "mode_curve.csv").exists()


def ended(launch, folder, before, asked):
    """The last line of a process that runs a mode of two dofs, what is printed of it and its exit code."""
    case = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
    arguments = ["run", str(case), "--quick", "--no-plots", "--only", "mode", "--out", str(folder)]
    program = f"{before}; from fretwave.commands.main import main; code = main({arguments!r}); print({asked}, code)"
    return launch(1, "-c", program).stdout.splitlines()[-1]


def test_a_difference_is_seen():
    """`distance` takes each array by its own size, zeros by 1."""
    a = [np.array([1e3, 2e3]), np.array([0.0])]
    assert left_out.distance([np.array([1e3, 2e3 + 1e-3]), np.array([0.0])], a) == pytest.approx(5e-7)
    assert left_out.distance([a[0], np.array([1e-3])], a) == 1e-3
