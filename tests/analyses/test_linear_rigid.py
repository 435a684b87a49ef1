"""Rigid motions of linear modes: rounding is told as zero, in any unit, and what is soft is not."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from command_line import call

from fretwave import InputError, Model, linear_modes
from fretwave.analyses.parts.linear_waves import without_rounding
from fretwave.report.report import report_run

pytestmark = pytest.mark.ranks(1)


def loose(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Five masses in three bodies, of which two have a spring inside."""
    random, K = np.random.default_rng(seed), np.zeros((5, 5))
    for ends in ((0, 1), (2, 3)):
        K[np.ix_(ends, ends)] += 10.0 ** random.uniform(-2, 2) * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return np.diag(10.0 ** random.uniform(-2, 2, 5)), K


@pytest.mark.parametrize(("seed", "unit"), [(31, 1e9), (32, 1e9), (35, 1e-9), (31, 1.0)])
def test_what_rounding_leaves_of_a_loose_body_is_zero(seed: int, unit: float) -> None:
    """The third body was told at some 1e-8 of the others' frequencies, or 6e-18 Hz."""
    M, K = loose(seed)
    found = without_rounding(linear_modes(Model(M, unit * K), 5, "free"), unit * K)
    springs = [unit * K[i, i] * (1 / M[i, i] + 1 / M[i + 1, i + 1]) for i in (0, 2)]
    assert [mode.omega for mode in found] == pytest.approx([0.0, 0.0, 0.0, *np.sqrt(sorted(springs))], rel=1e-9, abs=0)


@pytest.mark.parametrize("heavy", [1e-3, 1.0])
def test_a_mass_without_a_spring_beside_a_far_lighter_body(heavy: float) -> None:
    """Its eigenvalue, of no rounding of its own, became a shift next to zero: "-10" of MUMPS."""
    M, K = np.diag([7e-7, 9e-7, heavy]), 290.0 * np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    exact = np.sqrt(290.0 * (1 / 7e-7 + 1 / 9e-7))
    found = without_rounding(linear_modes(Model(M, K), 3, "free"), K)
    assert [mode.omega for mode in found] == pytest.approx([0, 0, exact], rel=1e-9)


def test_loose_parts_that_hide_each_other_are_refused_in_words() -> None:
    """No modes of a shift that only the heavier of two can bear; of these two one has a mode at 0.0014 rad/s."""
    M, K = np.diag([1e-6, 1e-6, 1e6, 1e6]), np.zeros((4, 4))
    K[:2, :2], K[2:, 2:] = ([[k, -k], [-k, k]] for k in (1e8, 1.0))
    with pytest.raises(InputError, match="loose parts cannot be told"):
        linear_modes(Model(M, K), 4, "free")


@pytest.mark.parametrize("soft", [1e-9, 1e-3, 1.0])
def test_a_soft_spring_keeps_its_frequency(soft: float) -> None:
    """Below eps of the highest omega^2 as well, as far as the modes themselves know it."""
    K = np.diag([soft, 1e10])
    before = linear_modes(Model(np.eye(2), K), 2, "free")
    assert without_rounding(before, K) == before
    assert before[0].omega == pytest.approx(np.sqrt(soft), rel=1e-3)


def test_rigid_motions_are_named(tmp_path, capfd) -> None:
    M, K = loose(31)
    case = tmp_path / "case.toml"
    case.write_text(
        f"[model]\ndofs = ['a', 'b', 'c', 'd', 'e']\nM = {M.tolist()}\nK = {(1e9 * K).tolist()}\n"
        "[[contact]]\nname = 'pads'\nlaw = 'jenkins'\npairs = ['a', 'c', 'e']\ntangential_stiffness = 1e9\n"
        "friction_limit = 1.0\n[[analysis]]\nname = 'linear'\ntype = 'linear'\nmodes = 5\ncontact = ['free']\n"
    )
    assert call("run", case, "--no-plots", "--out", tmp_path / "run") == 0
    said = capfd.readouterr().out
    assert "linear: free: 5 modes, 3 rigid at 0 Hz, " in said
    with open(tmp_path / "run" / "linear.csv", newline="") as file:
        assert [float(row["frequency_hz"]) == 0 for row in csv.DictReader(file)] == 3 * [True] + 2 * [False]
    report_run(tmp_path / "run")
    page = (tmp_path / "run" / "report.html").read_text()
    assert "free, mode 3, rigid" in page and "mode 4, rigid" not in page
