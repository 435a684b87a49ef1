"""PETSc options of a whole run: each goes to the analyses whose solvers read it, and is told where nothing does."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from command_line import call
from models.core_models import options

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "cases" / "robustness"))
import bases  # noqa: E402
from mutations import as_toml  # noqa: E402

from fretwave.errors import InputError  # noqa: E402
from fretwave.mpi.petsc_options import AnalysisOptions  # noqa: E402
from fretwave.mpi.petsc_share import RunWide  # noqa: E402
from fretwave.mpi.petsc_time import unread_in_time  # noqa: E402
from fretwave.mpi.petsc_values import parse  # noqa: E402

pytestmark = pytest.mark.ranks(1)

UNREAD = "that no solver has read"


@pytest.fixture
def run(tmp_path: Path, capfd):
    """Runs analyses of the oscillator with options, and tells its exit code and what it said."""
    (tmp_path / "case.toml").write_text(as_toml(bases.two_dof()), encoding="utf-8")

    def runs(only: str, petsc: str = "", *more: str) -> tuple[int, str]:
        out = ["--out", tmp_path / "out", "--no-plots", "--force"]
        code = call("run", tmp_path / "case.toml", "--only", only, f"--petsc={petsc}", *out, *more)
        return code, "".join(capfd.readouterr())

    return runs


@pytest.mark.parametrize(
    "petsc",
    [
        "-route direct",  # of harmonic balance alone
        "-ts_max_steps 100000",  # of steps in time alone
        "-modes_eps_ncv 30",  # what the core advises where modes do not converge
        "-mode_snes_max_it 24 -free_decay_ts_max_steps 100000",  # each of one analysis
        "-mode_epmc_snes_max_it 24",  # of an analysis whose name begins with that of another
    ],
)
def test_it_need_be_read_by_one_analysis_alone(run, petsc: str) -> None:
    code, said = run("mode,mode_epmc,free_decay", petsc)
    assert code == 0 and UNREAD not in said


@pytest.mark.parametrize("routes", ["-mode_epmc_route krylov", "-mode_route krylov -mode_epmc_route direct"])
def test_it_need_be_read_by_one_route_alone(run, routes: str) -> None:
    """The first analysis refused what the other one's route reads."""
    code, said = run("mode,mode_epmc", f"{routes} -ksp_gmres_restart 40")
    assert code == 0 and UNREAD not in said
    code, said = run("mode,mode_epmc", f"{routes} -ksp_gmres_restrat 40")
    assert code == 2 and "no solver reads the PETSc option -ksp_gmres_restrat" in said


@pytest.mark.parametrize(
    ("petsc", "only"),
    [
        ("-ts_rtoll 1e-9", "mode,free_decay"),
        ("-free_decay_ts_adapt_clipp 0.1,5", "mode,free_decay"),
        ("-forced_time_ts_rtoll 1e-9", "mode,mode_epmc,forced"),
    ],
    ids=["of all", "of one analysis", "of the check in time"],
)
def test_a_misspelt_one_of_a_time_integration_is_refused_before_anything_is_solved(run, petsc: str, only: str) -> None:
    """It was found when the first motion began, all modes before it done."""
    code, said = run(only, petsc, "--set", "forced.time_points=1")
    name = petsc.split()[0].replace("free_decay_", "").replace("forced_", "")
    assert code == 2 and f"no solver reads the PETSc option {name}\n" in said and "results in" not in said
    assert "fix:" in said


@pytest.mark.parametrize(("name", "option"), [("free_decay", "ts_rtoll"), ("forced", "time_ts_rtoll")])
def test_check_says_the_same_of_those_of_a_case(tmp_path: Path, capfd, name: str, option: str) -> None:
    """It called a case right that no run began with."""
    (tmp_path / "case.toml").write_text(as_toml(bases.two_dof()), encoding="utf-8")
    given = ["--set", "forced.time_points=1", "--set", f"{name}.petsc='-{option} 1e-9'"]
    assert call("check", tmp_path / "case.toml", *given) == 2
    said = capfd.readouterr()
    assert f"no solver reads the PETSc option -{option}\n" in said.err and "no errors" not in said.out
    right = [word.replace("rtoll", "rtol") for word in given]
    assert call("check", tmp_path / "case.toml", "--only", name, *right) == 0


@pytest.mark.parametrize(
    "petsc", ["-ts_rtol 1e-9", "-ts_type bdf -ts_bdf_order 3", "-ts_adapt_type dsp -ts_adapt_dsp_filter h211b"]
)
def test_names_that_another_method_reads_are_names(petsc: str) -> None:
    assert not unread_in_time(dict(parse(petsc)))
    assert unread_in_time(dict(parse(f"{petsc} -ts_bdf_ordr 3 -ts_view"))) == ["ts_bdf_ordr"]


def test_the_route_may_stand_in_the_case(run) -> None:
    more = ("--set", "mode_epmc.petsc='-route krylov'")
    assert run("mode,mode_epmc", "-ksp_gmres_restart 40", *more)[0] == 0
    code, said = run("mode,mode_epmc", "-ksp_gmres_restart 40")
    assert code == 2 and "analysis 'mode'" in said


def test_of_one_analysis_it_steers_that_alone(run) -> None:
    said = run("mode,mode_epmc", "-mode_epmc_snes_monitor")[1]
    first, second = said.split("mode_epmc: 2 of 2 analyses")
    assert "SNES Function norm" in second and "SNES Function norm" not in first


@pytest.mark.parametrize("petsc", ["-snes_rtoll 1e-9", "-routee direct", "-fw_linear_renewl 1", "-mode_snes_rtoll 1"])
def test_a_misspelt_one_is_refused_before_the_first_point(run, petsc: str, tmp_path: Path) -> None:
    code, said = run("mode", petsc)
    assert code == 2 and petsc.split()[0].removeprefix("-mode_") in said and not (tmp_path / "out").exists()


def test_what_nothing_has_read_is_told_at_the_end(run) -> None:
    code, said = run("mode,mode_epmc", "-static_snes_monitor -component_eps_tol 1e-9")
    assert code == 0 and said.count(UNREAD) == 1
    assert f"{UNREAD}: -static_snes_monitor, -component_eps_tol" in said


@pytest.mark.parametrize("petsc", ["-malloc_debug", "-info :file", "-fp_trap", "-options_left", "-on_error_abort"])
def test_what_petsc_reads_as_it_starts_belongs_into_the_environment(run, petsc: str) -> None:
    code, said = run("mode", petsc)
    assert code == 2 and f"PETSC_OPTIONS='{petsc}'" in said


@pytest.mark.parametrize(
    "name, value, expected",
    [
        ("mode_snes_rtol", "abc", "0 to below 1"),
        ("mode_ksp_type", "nonsense", "a name that PETSc knows"),
        ("mode_snes_rtoll", "1", "did you mean `-snes_rtol`?"),
        ("fw_linear_renewal", "-3", "above 0"),
        ("fw_linear_renewl", "3", "did you mean `-fw_linear_renewal`?"),
    ],
)
def test_those_of_the_environment_are_held_to_the_same_rules(run, name: str, value: str, expected: str) -> None:
    with options(**{name: value}):
        code, said = run("mode")
    assert code == 2 and expected in said and "PETSc error" not in said


def test_one_of_an_analysis_that_does_not_run_is_told(run) -> None:
    """And goes to no other whose name it begins with."""
    code, said = run("mode", "-mode_epmc_snes_max_it 24")
    assert code == 0 and f"{UNREAD}: -mode_epmc_snes_max_it" in said
    with options(mode_epmc_snes_max_it=24):
        assert run("mode")[0] == 0


def test_one_of_another_analysis_leaves_a_sweep_alone(tmp_path: Path, capfd) -> None:
    text = as_toml(bases.two_dof())
    sweep = '[[analysis]]\nname = "losses"\ntype = "sweep"\nof = "mode_epmc"\nover = { mode_epmc.harmonics = [1, 3] }\n'
    (tmp_path / "case.toml").write_text(text + sweep, encoding="utf-8")
    words = ["--only", "mode,losses", "--petsc=-mode_snes_max_it 24", "--no-plots", "--out", tmp_path / "out"]
    assert call("run", tmp_path / "case.toml", *words) == 0
    assert UNREAD not in "".join(capfd.readouterr())


@pytest.mark.parametrize(
    ("petsc", "only", "told"),
    [
        ("-static_snes_max_it 24", "mode,losses", True),
        ("-modes_eps_ncv 30", "mode,losses", False),
        ("-free_decay_ts_max_steps 9", "mode,losses", True),
    ],
    ids=["no static state", "read by every value", "of an analysis that does not run"],
)
def test_what_no_value_of_a_sweep_reads_is_told(tmp_path: Path, capfd, petsc: str, only: str, told: bool) -> None:
    """A single run said so at its end, a sweep nothing."""
    text = as_toml(bases.two_dof())
    sweep = '[[analysis]]\nname = "losses"\ntype = "sweep"\nof = "mode_epmc"\nover = { mode_epmc.harmonics = [1, 3] }\n'
    (tmp_path / "case.toml").write_text(text + sweep, encoding="utf-8")
    given = ["--no-plots", f"--petsc={petsc}"]
    assert call("run", tmp_path / "case.toml", "--only", only, *given, "--out", tmp_path / "one") == 0
    said, (name, _) = "".join(capfd.readouterr()), petsc.split()
    assert said.count(f"{UNREAD}: {name}") == told
    words = ["--over", "mode.harmonics=1,3", "--only", "mode", "--out", tmp_path / "two"]
    assert call("sweep", tmp_path / "case.toml", *words, "--petsc=-static_snes_max_it 24 -modes_eps_ncv 30") == 0
    assert f"note: PETSc options {UNREAD}: -static_snes_max_it\n" in capfd.readouterr().out


def test_shared_ones_of_an_analysis_alone_are_told(run) -> None:
    code, said = run("mode", "", "--set", 'mode.petsc="-static_snes_rtoll 1e-9"')
    assert code == 0 and f"{UNREAD}: -static_snes_rtoll" in said


@pytest.mark.parametrize(("petsc", "ends"), [("-snes_max_it 24", 0), ("-snes_rtoll 1e-9", 2)])
def test_an_analysis_may_be_named_like_a_shared_one(petsc: str, ends: int, tmp_path: Path, capfd) -> None:
    case = bases.two_dof()
    case["analysis"] = [{**case["analysis"][0], "name": "static"}]
    (tmp_path / "case.toml").write_text(as_toml(case), encoding="utf-8")
    words = ["--only", "static", f"--petsc={petsc}", "--no-plots", "--out", tmp_path / "out"]
    assert call("run", tmp_path / "case.toml", *words) == ends
    assert UNREAD not in "".join(capfd.readouterr())


@pytest.mark.parametrize("name", ["info", "history", "version", "malloc", "log_all"])
def test_an_analysis_may_have_the_name_of_what_petsc_reads_as_it_starts(name: str) -> None:
    assert parse(f"-{name}_snes_rtol 1e-9") == [(f"{name}_snes_rtol", "1e-9")]
    with pytest.raises(InputError, match="as it starts"):
        parse(f"-{name} 1")


def test_one_of_the_environment_without_effect_is_told(run) -> None:
    with options(snes_rtol=1e-3):
        code, said = run("mode")
    assert code == 0 and f"{UNREAD}: -snes_rtol (an analysis' own begin with its name: -mode_snes_rtol)" in said


def test_one_of_the_environment_stands_again_behind_an_analysis() -> None:
    from petsc4py import PETSc

    with options(fw_linear_renewal=0.25):
        with AnalysisOptions("mode_", ["-fw_linear_renewal 0.5"]).inserted():
            assert PETSc.Options().getReal("fw_linear_renewal") == 0.5
        assert PETSc.Options().getReal("fw_linear_renewal") == 0.25


def test_the_more_special_one_wins_and_of_two_the_last() -> None:
    wide = RunWide(parse("-mode_snes_rtol 1e-9 -snes_rtol 1e-6 -snes_rtol 1e-7"), {"mode_": "", "epmc_": ""})
    assert AnalysisOptions("mode_", [], wide).pairs == {"mode_snes_rtol": "1e-9"}
    assert AnalysisOptions("epmc_", [], wide).pairs == {"epmc_snes_rtol": "1e-7"}
    assert AnalysisOptions("epmc_", ["-snes_rtol 1e-5"], wide).pairs == {"epmc_snes_rtol": "1e-5"}


def test_one_analysis_own_ones_are_no_other_one_s() -> None:
    with pytest.raises(InputError, match="epmc_snes_rtol"):
        AnalysisOptions("mode_", ["-epmc_snes_rtol 1e-5"]).check_used(lambda: ["-mode_epmc_snes_rtol 1e-5"], "here")
