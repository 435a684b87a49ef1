"""Component modes for an accuracy: how many are taken, what is said of it, and that the accuracy is kept."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from command_line import call
from models.chain_case import BUILDER, CHAIN

from fretwave.case.component_modes import Choice, choice_of
from fretwave.case.load import load_case
from fretwave.case.reduction_report import ReductionReport
from fretwave.errors import CaseErrors
from fretwave.hb.states import ZETA_FLOOR

pytestmark = pytest.mark.ranks(1)


@pytest.fixture
def write(tmp_path: Path):
    """The chain of 18 dofs, 12 of them inner ones, with another [reduction] and further keys of its mode."""

    def make(reduction: str, mode: str = "harmonics = 3\nsamples = 64") -> Path:
        (tmp_path / "model.py").write_text(BUILDER.read_text())
        assert "modes = 12" in CHAIN
        text = CHAIN.replace("modes = 12", reduction)
        analysis = (
            f'\n[[analysis]]\nname = "mode"\ntype = "mode"\nnormalise = "tip"\namplitude = [2e-7, 1e-6]\n{mode}\n'
        )
        (tmp_path / "case.toml").write_text(text + analysis)
        return tmp_path / "case.toml"

    return make


def report(modes: int, error: float, unreduced: int = 10_000, interface: int = 0) -> ReductionReport:
    waves = [{"full_hz": [0.0, 1.0], "relative": [None, -error]}] if interface else []
    relative = [0.0 if interface else error]
    comparison = [1.0], [1.0], relative
    return ReductionReport(unreduced, 100, modes, 1.0, *comparison, 0.0, 0.0, interface, waves, faces=2 * interface)


@pytest.mark.parametrize("interface", [0, 8])
def test_numbers_double_until_the_accuracy_is_kept(interface: int) -> None:
    choice = Choice(1e-4, 5)
    assert choice.next(report(10, 1e-2, interface=interface)) == 20
    assert choice.next(report(20, 1e-3, interface=interface)) == 40
    assert choice.next(report(40, 9e-5, interface=interface)) is None
    assert "10 leave 1.0e-02, 20 leave 1.0e-03, 40 leave 9.0e-05" in choice.line()
    assert "not kept" not in choice.line()


def test_frequencies_beyond_those_that_are_compared_are_not_taken_for_good() -> None:
    """80 below 1 Hz, of a response up to 3 Hz: the number was enough at 80, with an error of 1e-15 of others."""
    choice = Choice(1e-6, 1, up_to_hz=3.0, compare=80)
    found = replace(report(80, 0.0), full_hz=[1.0] * 80, reduced_hz=[1.0] * 80, relative=[0.0] * 80)
    assert not choice.looks_further(found) and choice.next(found) == 160 and "80 do not tell of all" in choice.line()


def test_modes_that_change_little_or_are_all_there_are_end_it() -> None:
    choice = Choice(1e-6, 5)
    assert choice.next(report(10, 1e-3)) == 20
    assert choice.next(report(20, 0.9e-3)) is None and "change little: this is not kept" in choice.line()
    choice = Choice(1e-6, 5)
    assert choice.next(report(10, 1e-3, unreduced=115)) == 15
    assert choice.next(report(15, 1e-4, unreduced=115)) is None and "15 are the most" in choice.line()


def test_frequencies_beyond_those_that_count_do_not(write) -> None:
    found = ReductionReport(10_000, 100, 10, 1.0, [1.0] * 3, [1.0] * 3, [1e-7, 1e-5, 1e-2], 0.0, 0.0)
    assert Choice(1e-4, 2).next(found) is None
    assert Choice(1e-4, 3).next(found) == 20


def test_an_analysis_accuracy_asks_for_one_of_its_frequency(write) -> None:
    choice = choice_of(load_case(write("compare = 3", "accuracy = 1e-2\nlinear_mode = 2")))
    assert choice is not None and (choice.asked, choice.frequencies) == (pytest.approx(1e-2 * ZETA_FLOOR), 2)
    assert choice_of(load_case(write("compare = 3"))) is None
    assert choice_of(load_case(write("modes = 6", "accuracy = 1e-2"))) is None
    told = choice_of(load_case(write("accuracy = 1e-3", "accuracy = 1e-2")))
    assert told is not None and (told.asked, told.frequencies) == (1e-3, 5)


@pytest.mark.parametrize(
    "reduction, said",
    [
        ("accuracy = 1e-5\nmodes = 6", "is given beside modes"),
        ("accuracy = 1e-5\nup_to_hz = 100.0", "is given beside up_to_hz"),
        ("accuracy = 1e-5\ncompare = 0", "is of no frequency"),
    ],
)
def test_what_contradicts_it_is_refused(write, reduction: str, said: str) -> None:
    with pytest.raises(CaseErrors) as caught:
        load_case(write(reduction))
    assert said in str(caught.value)


def test_it_is_kept_with_contact_that_slides_too(tmp_path: Path) -> None:
    """A stiff slider holds its dof as a reduction does: stuck modes are exact where those without it are not."""
    n, asked, count = 60, 1e-5, 4
    K = 100.0 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    M = np.diag(np.linspace(1.0, 3.0, n))
    text = f"[model]\ndofs = {[f'm{k}' for k in range(n)]}\nM = {M.tolist()}\nK = {K.tolist()}\n".replace("'", '"')
    slider = '[[contact]]\nname = "pad"\nlaw = "jenkins"\npairs = ["m40"]\ntangential_stiffness = 1e9\n'
    linear = f'friction_limit = 1.0\n[[analysis]]\nname = "linear"\ntype = "linear"\nmodes = {count}\n'
    (tmp_path / "case.toml").write_text(f"{text}[reduction]\naccuracy = {asked}\ncompare = {count}\n{slider}{linear}")
    assert call("run", str(tmp_path / "case.toml"), "--no-plots", "--out", str(tmp_path / "run")) == 0
    held = K + 1e9 * np.diag(np.arange(n) == 40)
    rows = list(csv.DictReader((tmp_path / "run" / "linear.csv").open()))
    for contact, stiffness in (("stuck", held), ("free", K)):
        exact = np.sqrt(scipy.linalg.eigh(stiffness, M, eigvals_only=True)[:count]) / (2 * np.pi)
        found = [float(row["frequency_hz"]) for row in rows if row["contact"] == contact]
        np.testing.assert_allclose(found, exact, rtol=asked)
    assert "with sliding contact: " in (tmp_path / "run" / "run.log").read_text()


@pytest.mark.parametrize("observed", ['"m9"', "{ mode = 4 }"], ids=["dof", "coordinate"])
def test_a_mode_above_the_number_of_kept_dofs_is_one_of_the_component_modes_too(tmp_path: Path, observed: str) -> None:
    """The fourth of a chain that keeps one or two of its dofs."""
    n = 24
    K = 100.0 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    text = f"[model]\ndofs = {[f'm{k}' for k in range(n)]}\nM = {np.eye(n).tolist()}\nK = {K.tolist()}\n"
    slider = '[reduction]\n[[contact]]\nlaw = "jenkins"\npairs = ["m3"]\ntangential_stiffness = 50.0\n'
    mode = f'[[analysis]]\nname = "a"\ntype = "mode"\nlinear_mode = 4\naccuracy = 1e-2\nnormalise = {observed}\n'
    last = "friction_limit = 1e9\n" + mode + "amplitude = [0.01, 0.02]\n"
    K[3, 3] += 50.0
    (tmp_path / "case.toml").write_text(text.replace("'", '"') + slider + last)
    assert call("run", str(tmp_path / "case.toml"), "--no-plots", "--out", str(tmp_path / "run")) == 0
    found = [float(row["omega"]) for row in csv.DictReader((tmp_path / "run" / "a.csv").open())]
    np.testing.assert_allclose(found, np.sqrt(scipy.linalg.eigh(K, eigvals_only=True)[3]), rtol=1e-6)


CHAIN_60 = 100.0 * (2 * np.eye(60) - np.eye(60, k=1) - np.eye(60, k=-1))


def stuck_chain(folder: Path, analysis: str, reduction: str = "") -> Path:
    """60 unit masses, a slider of 50 N/m that never slips at the 21st, and an analysis `a` of accuracy 1e-2."""
    text = f"[model]\ndofs = {[f'm{k}' for k in range(60)]}\nM = {np.eye(60).tolist()}\nK = {CHAIN_60.tolist()}\n"
    slider = '[[contact]]\nlaw = "jenkins"\npairs = ["m20"]\ntangential_stiffness = 50.0\nfriction_limit = 1e9\n'
    damped = f"mass_damping = 0.1\n[reduction]\n{reduction}\n"
    keys = f'[[analysis]]\nname = "a"\naccuracy = 1e-2\n{analysis}\n'
    (folder / "case.toml").write_text(text.replace("'", '"') + damped + slider + keys)
    return folder / "case.toml"


def test_a_response_asks_for_the_frequencies_of_its_range(tmp_path: Path) -> None:
    """From the 24th mode on, far above the first one and those that are compared unless more count."""
    forced = 'type = "forced"\nforce = { m0 = 1.0 }\nlevels = [1.0]\nfrequency = [1.8, 2.0]\nobserve = "m0"'
    assert call("run", stuck_chain(tmp_path, forced), "--no-plots", "--out", tmp_path / "run") == 0
    K = CHAIN_60 + 50.0 * np.diag(np.arange(60) == 20)
    for row in csv.DictReader((tmp_path / "run" / "a.csv").open()):
        omega = float(row["omega"])
        exact = np.linalg.solve(K + (0.1j * omega - omega**2) * np.eye(60), np.eye(60)[0])[0]
        found = float(row["amplitude"]) * np.exp(1j * float(row["phase"]))
        assert abs(found - exact) < 1e-2 * abs(exact)


@pytest.mark.parametrize("compare", [0, 1])
def test_the_frequency_of_the_mode_counts_whatever_is_compared_else(tmp_path: Path, compare: int) -> None:
    mode = 'type = "mode"\nnormalise = "m0"\namplitude = [0.01, 0.02]\nlinear_mode = 16'
    case = stuck_chain(tmp_path, mode, f"compare = {compare}")
    assert call("run", case, "--no-plots", "--out", tmp_path / "run") == 0
    exact = np.sqrt(np.linalg.eigvalsh(CHAIN_60 + 50.0 * np.diag(np.arange(60) == 20))[15])
    found = [float(row["omega0"]) for row in csv.DictReader((tmp_path / "run" / "a.csv").open())]
    np.testing.assert_allclose(found, exact, rtol=1e-2 * ZETA_FLOOR)


def test_of_a_sector_it_is_kept_in_the_waves_of_the_analyses(tmp_path: Path) -> None:
    """Also where all inner dofs are needed: 20 of 23, one of each face and one of contact."""
    n, sectors, diameters, count = 23, 6, 2, 3
    K = 100.0 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    K[0, 0] = K[-1, -1] = 100.0
    M, names = np.diag(np.linspace(1.0, 3.0, n)), [f"m{k}" for k in range(n)]
    model = f'[model]\nsectors = {sectors}\nlow = ["m0"]\nhigh = ["m{n - 1}"]\ndofs = {names}\n'.replace("'", '"')
    text = f"{model}M = {M.tolist()}\nK = {K.tolist()}\n[reduction]\naccuracy = 1e-12\ncompare = {count}\n"
    slider = '[[contact]]\nname = "pad"\nlaw = "jenkins"\npairs = ["m9"]\ntangential_stiffness = 50.0\n'
    linear = f'friction_limit = 1.0\n[[analysis]]\nname = "linear"\ntype = "linear"\nmodes = {count}\n'
    (tmp_path / "case.toml").write_text(f"{text}{slider}{linear}nodal_diameters = [{diameters}]\n")
    assert call("run", str(tmp_path / "case.toml"), "--no-plots", "--out", str(tmp_path / "run")) == 0
    log, found = ((tmp_path / "run" / name).read_text() for name in ("run.log", "run.json"))
    assert "20 leave" in log and "not kept" not in log
    waves = json.loads(found)["reduction"]["waves"]
    assert [(wave["nodal_diameter"], wave["contact"]) for wave in waves] == [(2, "stuck"), (2, "sliding")]
    tie = np.eye(n, n - 1, dtype=complex)
    tie[-1, 0] = np.exp(2j * np.pi * diameters / sectors)
    exact = scipy.linalg.eigh(tie.conj().T @ K @ tie, tie.conj().T @ M @ tie, eigvals_only=True)[:count]
    np.testing.assert_allclose(waves[1]["reduced_hz"], np.sqrt(exact) / (2 * np.pi), rtol=1e-11)


def test_a_run_keeps_it_and_says_so(write, tmp_path: Path) -> None:
    out = tmp_path / "run"
    assert call("run", str(write("accuracy = 1e-9\ncompare = 3")), "--no-plots", "--out", str(out)) == 0
    found = json.loads((out / "run.json").read_text())["reduction"]
    assert found["component_modes"] == 12  # ten are not enough, twelve are all
    assert max(abs(error) for error in found["relative"]) <= 1e-9
    assert "component modes for 1.0e-09 of the lowest frequencies: 10 leave" in (out / "run.log").read_text()
