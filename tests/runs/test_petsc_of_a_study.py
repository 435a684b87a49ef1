"""PETSc options of a study: they steer what they steer in a run, and are told once where no run of it reads them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from command_line import call
from models.core_models import options
from models.wear_case import write_case

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "cases" / "robustness"))
import bases  # noqa: E402
from mutations import as_toml  # noqa: E402

pytestmark = pytest.mark.ranks(1)

UNREAD = "PETSc options that no solver has read"
SMALL = ["--harmonics", "1,3", "--samples", "32", "--tolerance", "1e-6", "--places", "2", "--repeats", "1"]


@pytest.fixture
def study(tmp_path: Path, capfd):
    """Studies an analysis with options of its own, and tells its exit code and what it said."""

    def studies(case: Path, name: str, petsc: str, *words: str) -> tuple[int, str]:
        given = ["--analysis", name, "--set", f'{name}.petsc="{petsc}"', "--out", tmp_path / "study", *words]
        code = call("study", case, *given)
        return code, "".join(capfd.readouterr())

    return studies


def oscillator(folder: Path) -> Path:
    case = bases.two_dof()
    forced = next(analysis for analysis in case["analysis"] if analysis["type"] == "forced")
    case["analysis"].append({**forced, "name": "of-two", "backbone": []})
    for analysis in case["analysis"]:
        analysis.pop("step", None)
    (folder / "case.toml").write_text(as_toml(case), encoding="utf-8")
    return folder / "case.toml"


@pytest.mark.parametrize(
    ("name", "petsc", "unread"),
    [
        ("mode", "-static_snes_max_it 24 -snes_max_itt 9 -modes_eps_ncv 30", "-static_snes_max_it, -snes_max_itt"),
        ("of-two", "-snes_max_it 24 -ksp_typ preonly", "-ksp_typ"),
    ],
    ids=["of a mode", "of a response with a dash in its name"],
)
def test_what_no_run_of_a_study_reads_is_told_once(study, tmp_path: Path, name: str, petsc: str, unread: str) -> None:
    """It was told by a run and a sweep; a response's own ones had no effect where its name has a dash."""
    code, said = study(oscillator(tmp_path), name, petsc, *SMALL)
    assert code == 0 and said.count("no solver has read") == 1 and f"note: {UNREAD}: {unread}\n" in said


def test_what_a_static_state_before_a_mode_reads_steers_it_in_a_study(study, tmp_path: Path) -> None:
    """It was solved without the options of the analysis."""
    code, said = study(write_case(tmp_path), "mode", "-static_snes_max_it 24 -modes_eps_ncv 30", *SMALL)
    assert code == 0 and "no solver has read" not in said


def test_a_study_of_wear_reads_the_options_of_wear(study, tmp_path: Path) -> None:
    """It took those of its mode, as no run does."""
    more = ["--set", 'mode.petsc="-snes_max_itt 3"', "--tolerance", "1e-1,1e-2"]
    code, said = study(write_case(tmp_path), "one", "-snes_max_it 24 -snes_max_itt 24", *more)
    assert code == 0 and f"note: {UNREAD}: -snes_max_itt\n" in said and said.count("no solver has read") == 1


def test_one_of_the_environment_without_effect_on_a_study_is_told(study, tmp_path: Path) -> None:
    with options(snes_rtol=1e-3):
        code, said = study(oscillator(tmp_path), "mode", "-snes_max_it 24", *SMALL)
    assert code == 0 and "that no solver has read: -snes_rtol (an analysis' own begin with its name: -mode_" in said
