"""Summaries and tables of motions in time: the damped and undamped oscillator of cases/two_dof on few harmonics."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from tolerances import REPEATED

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


def test_what_a_decay_is_off_by_is_that_of_its_table(tmp_path: Path, capfd) -> None:
    """Damping ratios of two percent: an absolute difference is a fiftieth of the relative one."""
    said, rows = run(tmp_path, capfd, "free_decay", reach=[0.005, 0.1], c=5.0, eps=1.0, starts=[0.05], periods=14)
    (told,) = [line for line in said if "where the damping changes slowly" in line]
    far = [max(abs(row["omega"] / row["omega_mode"] - 1) for row in rows[1:-1])]
    far += [max(abs(row["zeta"] - row["zeta_mode"]) for row in rows[1:-1])]
    assert far[1] > 0
    words = f"the mode's by up to {far[0]:.1e} (relative), the damping ratio by up to {far[1]:.1e} (absolute)"
    assert told.endswith(words)


def test_a_decay_without_a_full_cycle_is_told_in_words(tmp_path: Path, capfd) -> None:
    said, rows = run(tmp_path, capfd, "free_decay", reach=[0.02, 0.1], c=5.0, starts=[0.05], periods=3)
    assert not rows and "start 0: fewer than four full cycles" in said
    assert any(line.startswith("0 full cycles, none that changes slowly") for line in said)


#: A stop that presses with 1 N before the structure has given way; about its place of rest all is linear.
PRESSED = """
[model]
dofs = ["m1", "m2"]
M = [[1.0, 0.0], [0.0, 0.5]]
K = [[3.0, -1.0], [-1.0, 1.5]]
C = [[{c}, 0.0], [0.0, 0.01]]
[[contact]]
law = "unilateral_spring"
pairs = ["m2"]
normal_stiffness = 1.0
gap = -1.0
[[analysis]]
name = "mode"
type = "mode"
harmonics = 5
samples = 128
normalise = "m2"
amplitude = [0.005, 0.3]
[[analysis]]
name = "motion"
type = "{kind}"
mode = "mode"
amplitude = [0.03]
periods = 30
"""


@pytest.mark.parametrize("c", [0.03, -0.03])
def test_a_motion_about_a_pressed_stop_has_the_cycles_of_its_linear_mode(tmp_path: Path, capfd, c: float) -> None:
    """m2 swings by 0.03 m about -0.46 m and never passes zero: there was no cycle."""
    path = tmp_path / "case.toml"
    path.write_text(PRESSED.format(c=c, kind="free_decay"))
    assert call("run", path, "--no-plots", "--out", tmp_path / "run") == 0
    assert "nothing to compare" not in capfd.readouterr().out
    with open(tmp_path / "run" / "motion.csv", newline="") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    inverse = np.diag([1.0, 2.0])
    K, C = np.array([[3.0, -1.0], [-1.0, 2.5]]), np.diag([c, 0.01])
    values = np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ K, -inverse @ C]]))
    s = complex(min(values[values.imag > 0], key=abs))
    assert len(rows) >= 28
    assert [row["omega"] for row in rows] == pytest.approx([s.imag] * len(rows), rel=1e-5)
    assert [row["zeta"] for row in rows] == pytest.approx([-s.real / abs(s)] * len(rows), rel=1e-2)
    exact = [0.03 * np.exp(s.real * row["time"]) for row in rows]
    assert [row["amplitude"] for row in rows] == pytest.approx(exact, rel=1e-4)


# Towards limit cycles

FED = -1.0119288512538815  # -2 % of m1 alone
#: Of the oscillator fed so, by time integration: cases/two_dof/README.md.
CYCLE = 0.13671


def verdict(said: list[str]) -> str:
    (line,) = [line for line in said if line.startswith("from a = ")]
    return line.split(": ", 1)[1]


def test_slow_growth_is_no_limit_cycle(tmp_path: Path, capfd) -> None:
    """40 periods between a start at half the predicted amplitude and that move it by 0.2 %."""
    said, rows = run(tmp_path, capfd, "limit_cycle", c=-0.02566765529595611, starts=[0.02], periods=40)
    assert verdict(said).startswith("not settled, grows with zeta = -0.001 %, a = 0.0200")
    assert 0.02 < rows[-1]["amplitude"] < 0.0201


@pytest.mark.parametrize(
    ("c", "word"), [(0.0, "keeps its amplitude"), (5e-4, "not settled, falls with zeta = 0.001 %")]
)
def test_an_oscillator_that_nothing_attracts_is_on_no_limit_cycle(tmp_path: Path, capfd, c: float, word: str) -> None:
    said, rows = run(tmp_path, capfd, "limit_cycle", c=c, eps=1e15, reach=[0.02, 0.1], starts=[0.05], periods=60)
    assert verdict(said).startswith(word)
    assert rows[-1]["amplitude"] == pytest.approx(0.05 * np.exp(lowest(c, 1e15).real * rows[-1]["time"]), rel=1e-5)


def test_a_dof_that_stuck_at_the_start_may_move_further_than_all_did(tmp_path: Path, capfd) -> None:
    """It begins at 0.03 m and ends, beating, between 0.09 and 0.26 m, where m2 moves five times as far."""
    values = {"m2": 0.055, "reach": [0.02, 6.0], "c": -3.0, "starts": [0.03], "periods": 100}
    said, rows = run(tmp_path, capfd, "limit_cycle", **values)
    assert verdict(said).startswith("not settled, varies by 1")
    assert len(rows) > 90 and max(row["amplitude"] for row in rows[50:]) < 0.3


def test_a_limit_cycle_beyond_the_mode_is_reached(tmp_path: Path, capfd) -> None:
    said, rows = run(tmp_path, capfd, "limit_cycle", c=FED, reach=[0.02, 0.06], starts=[0.05], periods=200)
    assert verdict(said).startswith("limit cycle, a = ")
    assert rows[-1]["amplitude"] == pytest.approx(CYCLE, rel=1e-4)


def test_a_motion_that_has_left_the_mode_and_still_grows_says_so(tmp_path: Path, capfd) -> None:
    said, _ = run(tmp_path, capfd, "limit_cycle", c=FED, reach=[0.02, 0.06], starts=[0.05], periods=12)
    assert verdict(said).startswith("leaves the mode's range, grows with zeta = -")


@pytest.mark.parametrize(("c", "eps"), [(FED, 0.05), (FED, 1e8)])
def test_what_grows_for_ever_diverges(tmp_path: Path, capfd, c: float, eps: float) -> None:
    """Above the unstable cycle, stopped at twice the mode's reach; without friction, stopped far beyond."""
    said, rows = run(tmp_path, capfd, "limit_cycle", c=c, eps=eps, reach=[0.02, 3.0], starts=[2.5], periods=100)
    assert verdict(said).startswith("diverges, grows with zeta = -") and "stopped after" in verdict(said)
    if eps > 1.0:
        s = lowest(c, eps)
        assert rows[-1]["amplitude"] == pytest.approx(2.5 * np.exp(s.real * rows[-1]["time"]), rel=1e-3)
        assert rows[0]["frequency_hz"] == pytest.approx(s.imag / 2 / np.pi, rel=REPEATED)
    else:
        assert 5.0 < rows[-1]["amplitude"] < 7.0


def test_what_diverges_before_it_has_cycles_is_told_by_how_far_it_came(tmp_path: Path, capfd) -> None:
    said, rows = run(tmp_path, capfd, "limit_cycle", c=-25.0, starts=[0.05], periods=20)
    assert not rows and verdict(said).startswith("diverges; stopped before four full cycles: it grew to ")


def test_a_decay_says_where_noise_begins(tmp_path: Path, capfd) -> None:
    said, rows = run(tmp_path, capfd, "limit_cycle", c=5.0, eps=1e4, reach=[0.02, 0.1], starts=[0.05], periods=60)
    assert (
        verdict(said).startswith("ends in the noise of the integration, a = ")
        and "is the integration's noise" in said[-1]
    )
    assert rows[-1]["amplitude"] < 1e-8


def test_a_mode_without_a_point_leaves_out_what_starts_from_it_alone(tmp_path: Path, capfd) -> None:
    """The other analyses are done, the mode's own reason is told, exit 3: the run ended with exit 2, "there are no
    results here", and said nothing of the mode."""
    case = CASE.format(kind="limit_cycle", m2=0.02, eps=0.05, reach=[0.02, 3.0], c=300.0, starts=[0.05], periods=20)
    path, out = tmp_path / "case.toml", tmp_path / "run"
    path.write_text(case + '[[analysis]]\nname = "first"\ntype = "linear"\n')
    for _ in range(2):
        assert call("run", path, "--no-plots", "--force", "--out", out) == 3
        told = capfd.readouterr()
        assert "'mode' stopped early" in told.err and "analysis 'mode', first point: no solution" in told.err
        assert "motion: 'mode', which it starts from, has no point" in told.out
        assert (out / "first.csv").exists() and not (out / "motion.csv").exists()
