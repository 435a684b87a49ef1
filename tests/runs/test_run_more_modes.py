"""Component modes chosen by a run: more of them where a branch finds that these limit its accuracy."""

from __future__ import annotations

import csv
import json
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import call
from mpi4py import MPI
from tolerances import REPEATED, SOLVED

from fretwave.case.component_modes import Choice
from fretwave.errors import EXIT_NOT_CONVERGED
from fretwave.mpi.guard import on_first_rank
from fretwave.results import results
from fretwave.run import more_modes
from fretwave.run.order import RunOptions
from fretwave.run.runner import run_case

N = 60
MODES = """
[[analysis]]
name = "b"
type = "mode"
normalise = "m20"
amplitude = [0.1, 0.2]
harmonics = 3

[[analysis]]
name = "a"
type = "mode"
normalise = "m20"
amplitude = [0.01, 0.5]
accuracy = 1e-2
"""


SLIDER = 'law = "jenkins"\npairs = ["m20"]\ntangential_stiffness = 50.0\nfriction_limit = 1.0\n'


def chain(folder: Path, reduction: str, contact: str = SLIDER, analyses: str = MODES) -> Path:
    """60 unit masses on a slider, of whose first mode the harmonics meet higher ones; and two analyses of it."""
    K = 100.0 * (2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
    model = f"[model]\ndofs = {[f'm{k}' for k in range(N)]}\nM = {np.eye(N).tolist()}\nK = {K.tolist()}\n"
    text = f"{model}mass_damping = 0.02\n{reduction}\n[[contact]]\n{contact}{analyses}".replace("'", '"')
    (folder / "case.toml").write_text(text)
    return folder / "case.toml"


def run(folder: Path, reduction: str, *words: str) -> int:
    return call("run", chain(folder, reduction), "--no-plots", "--out", folder / "run", *words)


def table(folder: Path, name: str) -> dict[str, np.ndarray]:
    with (folder / "run" / f"{name}.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in ("amplitude", "omega", "zeta")}


def record(folder: Path) -> dict:
    return json.loads((folder / "run" / "run.json").read_text())


def modes_of(folder: Path) -> list[int]:
    """Component modes that the results of each analysis say they are on."""
    with results.open_results(folder / "run" / "results.h5") as file:
        return [json.loads(file[name].attrs["reduction"])["component_modes"] for name in ("b", "a")]


@pytest.fixture(scope="module")
def grown(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("grown")
    assert run(folder, "[reduction]") == 0
    return folder


@pytest.mark.ranks(1)
def test_the_branch_keeps_its_accuracy_and_the_run_says_how(grown: Path) -> None:
    log = (grown / "run" / "run.log").read_text().splitlines()
    assert log[-2] == "reduction: 59 component modes: 40 limited the accuracy of 'a'"
    assert any("limited by the reduction" in line for line in log) and "accuracy 0.01 kept at" in "".join(log[-8:])


@pytest.mark.ranks(1)
def test_all_analyses_of_a_run_are_on_the_same_basis(grown: Path) -> None:
    assert modes_of(grown) == [59, 59] and record(grown)["reduction"]["component_modes"] == 59
    assert not list((grown / "run").glob(".*.rows"))


@pytest.mark.ranks(1)
def test_a_number_that_is_given_is_kept(tmp_path: Path) -> None:
    assert run(tmp_path, "[reduction]\nmodes = 40", "--only", "a") == EXIT_NOT_CONVERGED
    assert record(tmp_path)["reduction"]["component_modes"] == 40


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", ["b", "a"])
def test_a_run_that_broke_off_on_more_of_them_goes_on_with_these(
    grown: Path, tmp_path: Path, monkeypatch, name: str
) -> None:
    """Within an analysis that was whole on the fewer modes, and within the one that they limited."""
    append, begun = results.AnalysisWriter.append, []

    def broken(writer, *arguments):
        if writer.name == name and writer not in begun:
            begun.append(writer)
        if len(begun) == 2 and writer is begun[1] and writer.rows == 5:
            raise KeyboardInterrupt
        append(writer, *arguments)

    monkeypatch.setattr(results.AnalysisWriter, "append", broken)
    run(tmp_path, "[reduction]")
    monkeypatch.undo()
    assert record(tmp_path)["status"] == "running" and len(table(tmp_path, name)["zeta"]) == 5
    assert call("resume", tmp_path / "run", "--no-plots") == 0
    assert modes_of(tmp_path) == [59, 59]
    for analysis in ("a", "b"):
        for key, expected in table(grown, analysis).items():
            np.testing.assert_allclose(table(tmp_path, analysis)[key], expected, rtol=REPEATED, atol=SOLVED)


@pytest.mark.ranks(1)
@pytest.mark.parametrize(("few", "inner", "taken"), [(40, 1000, 80), (100, 1000, 160), (160, 1000, 0), (40, 40, 0)])
def test_twice_as_many_up_to_all_there_are(monkeypatch, few: int, inner: int, taken: int) -> None:
    monkeypatch.setattr(more_modes, "choice_of", lambda case: Choice(1e-6, 1))
    reason = "stop value reached; accuracy 0.01 kept at 3 of 40 points, 30 limited by the reduction, 7 limited by"
    case: Any = SimpleNamespace(reduced=SimpleNamespace(component_modes=few, inner=inner))
    assert more_modes.expect_enough(case, "a", f"{reason} the solver".replace("30", "6"), {}) == ""
    with pytest.raises(more_modes.TooFewModes) if taken else nullcontext() as found:
        assert more_modes.expect_enough(case, "a", f"{reason} harmonics", {}) == f"{few} are the most that are taken"
    assert not taken or found.value.entry == {"analysis": "a", "limited_by": few, "points": [30, 40], "taken": taken}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("ended", ["stop value reached", "the branch comes back to amplitude 0.01, where it began"])
@pytest.mark.parametrize(("limited", "points", "helped"), [(15, 20, False), (16, 20, False), (29, 39, True)])
def test_no_more_are_taken_where_twice_as_many_have_not_helped(
    monkeypatch, ended: str, limited: int, points: int, helped: bool
) -> None:
    """Of its own points: what another analysis has gained by them says nothing."""
    monkeypatch.setattr(more_modes, "choice_of", lambda case: Choice(1e-6, 1))
    case: Any = SimpleNamespace(reduced=SimpleNamespace(component_modes=40, inner=1000))
    reason = f"{ended}; accuracy 0.01 kept at 1 of {points} points, {limited} limited by the reduction (more)"
    given = [{"analysis": name, "limited_by": 20, "points": [n, 40], "taken": 40} for name, n in (("a", 30), ("b", 1))]
    with pytest.raises(more_modes.TooFewModes) if helped else nullcontext():
        why = more_modes.expect_enough(case, "a", reason, {more_modes.GREW: given})
        assert why == f"20 limited 30 of 40 points, 40 limit {limited} of {points}"


@pytest.mark.ranks(2)
def test_all_ranks_take_them(shared_tmp: Path, comm: MPI.Comm) -> None:
    path = on_first_rank(comm, lambda: chain(shared_tmp, "[reduction]"))
    assert run_case(path, RunOptions(shared_tmp / "run", plots=False), comm) == 0
    assert on_first_rank(comm, lambda: modes_of(shared_tmp)) == [59, 59]
