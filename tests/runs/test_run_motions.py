"""Summaries and tables of motions in time: the damped and undamped oscillator of cases/two_dof on few harmonics."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from command_line import call

pytestmark = pytest.mark.ranks(1)

CASE = """
[model]
dofs = ["m1", "m2"]
M = [[1.0, 0.0], [0.0, {m2}]]
K = [[640.0, -40.0], [-40.0, 40.0]]
[[contact]]
name = "damper"
law = "regularised_coulomb"
pairs = ["m2"]
friction_limit = 5.0
regularisation_velocity = {eps}
[[analysis]]
name = "mode"
type = "mode"
harmonics = 9
samples = 512
normalise = "m1"
amplitude = {reach}
dampers = [{{ dof = "m1", c = {c} }}]
[[analysis]]
name = "motion"
type = "{kind}"
mode = "mode"
amplitude = {starts}
periods = {periods}
"""


def run(folder: Path, capfd, kind: str, **values) -> tuple[list[str], list[dict[str, float]]]:
    """What is said of its motions, without the number, and the rows of their cycles."""
    values = {"m2": 0.02, "eps": 0.05, "reach": [0.02, 3.0], **values}
    path = folder / "case.toml"
    path.write_text(CASE.format(kind=kind, **values))
    assert call("run", path, "--no-plots", "--out", folder / "run") == 0
    said = capfd.readouterr().out
    assert "nan" not in said
    table = folder / "run" / "motion.csv"
    with open(table, newline="") if table.exists() else open("/dev/null") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    return [line.removeprefix("motion: ") for line in said.splitlines() if line.startswith("motion: ")], rows


def lowest(c: float, eps: float) -> complex:
    """Of the damped linear oscillator, s = -zeta omega0 + i omega: friction far below its regularisation velocity."""
    M, C, K = np.diag([1.0, 0.02]), np.diag([c, 5.0 / eps]), np.array([[640.0, -40.0], [-40.0, 40.0]])
    inverse = np.linalg.inv(M)
    s = np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ K, -inverse @ C]]))
    return complex(min(s[s.imag > 0], key=abs))


def test_a_decay_ends_where_noise_begins(tmp_path: Path, capfd) -> None:
    c, eps = 5.0, 1e4
    said, rows = run(tmp_path, capfd, "free_decay", reach=[0.02, 0.1], c=c, eps=eps, starts=[0.05], periods=60)
    s = lowest(c, eps)
    zeta = -s.real / abs(s)
    (end,) = [line for line in said if line.endswith(" m is the integration's noise")]
    floor = float(end.split()[-6])
    assert 0.05 * 1e-8 <= floor <= 0.1 * 1e-8, "m2 moves less than twice as far as m1"
    assert len(rows) == pytest.approx(np.log(0.05 / floor) / (2 * np.pi * zeta), abs=3)
    assert [row["zeta"] for row in rows] == pytest.approx([zeta] * len(rows), rel=0.02)
    assert [row["omega"] for row in rows] == pytest.approx([s.imag] * len(rows), rel=2e-3)


def test_a_decay_onto_a_damper_that_creeps_ends_where_it_no_longer_swings(tmp_path: Path, capfd) -> None:
    said, rows = run(tmp_path, capfd, "free_decay", reach=[0.02, 0.1], c=5.0, starts=[0.05], periods=60)
    assert len(rows) < 40 and f"start 0: ends after {len(rows)} cycles: it no longer swings about zero" in said


def test_a_decay_without_a_full_cycle_is_told_in_words(tmp_path: Path, capfd) -> None:
    said, rows = run(tmp_path, capfd, "free_decay", reach=[0.02, 0.1], c=5.0, starts=[0.05], periods=3)
    assert not rows and "start 0: fewer than four full cycles" in said
    assert any(line.startswith("0 full cycles, none that changes slowly") for line in said)
