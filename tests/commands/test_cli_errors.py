"""The command line on wrong input: the message, the exit code, and nothing of an earlier run overwritten."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fretwave._core import tuned_constants
from fretwave.commands.main import main
from fretwave.run.stopped import advice

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
#: A short branch: the earlier run that must stay as it is.
SHORT = [
    "--only",
    "mode",
    "--no-plots",
    "--set",
    "mode.harmonics=3",
    "--set",
    "mode.samples=64",
]
RANGE = ["--set", "mode.amplitude=[0.02, 0.03]", "--set", "mode.report_at=[]"]

#: What is given wrong -> what is said.
WRONG = {
    "mode.harmonic=7": "unknown key 'harmonic'",
    "model.M=[[1.0, 0.0], [0.0, -0.02]]": "negative diagonal",
    "model.K=[[640.0, nan], [-40.0, 40.0]]": "K[0][1] = nan",
    "model.M=[[1.0, 1.0], [1.0, 1.0]]": "mass matrix is singular",
    "model.K=[[640.0, -41.0], [-40.0, 40.0]]": "not symmetric",
    "model.K=[[640.0]]": "wrong size",
    "mode.amplitude=[0, 3]": "mode.amplitude[0]",
    "mode.harmonics=0": "mode.harmonics",
    "model.M='M.npz'": "does not exist",
    "contact.damper.law=coulomb": "unknown contact law",
    "mode.petsc=-snes_rtoll 1e-9": "did you mean `-snes_rtol`?",
    "mode.petsc='-snes_rtoll 1e-9'": "did you mean `-snes_rtol`?",
}


def fingerprint(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}


@pytest.fixture(autouse=True)
def own_hook(monkeypatch):
    """The command line sets sys.excepthook; put it back after each test."""
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)


@pytest.fixture(scope="module")
def earlier(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "two_dof"
    assert main(["run", str(CASE), "--out", str(folder), *SHORT, *RANGE]) == 0
    return folder


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_input_overwrites_nothing(earlier: Path, wrong: str, capfd) -> None:
    before = fingerprint(earlier)
    overrides = [] if "amplitude" in wrong else RANGE
    if "harmonics" in wrong:
        code = main(["run", str(CASE), "--out", str(earlier), "--only", "mode", "--set", wrong])
    else:
        code = main(
            [
                "run",
                str(CASE),
                "--out",
                str(earlier),
                *SHORT,
                *overrides,
                "--set",
                wrong,
            ]
        )
    text = capfd.readouterr().err
    assert code == 2
    assert text.startswith("error: ")
    assert WRONG[wrong] in text
    assert "  where: " in text
    assert "  fix: " in text
    assert fingerprint(earlier) == before


def test_misspelt_option_on_the_command_line(earlier: Path, capfd) -> None:
    before = fingerprint(earlier)
    code = main(
        [
            "run",
            str(CASE),
            "--out",
            str(earlier),
            *SHORT,
            *RANGE,
            "--petsc",
            "-snes_max_itt",
        ]
    )
    assert code == 2
    assert "did you mean `-snes_max_it`?" in capfd.readouterr().err
    assert fingerprint(earlier) == before


def test_right_option_is_used_and_taken_back(tmp_path: Path) -> None:
    from petsc4py import PETSc

    options = ["--petsc", "-snes_max_it 30 -snes_atol 1e-12"]
    assert main(["run", str(CASE), "--out", str(tmp_path / "run"), *SHORT, *RANGE, *options]) == 0
    assert not PETSc.Options().hasName("mode_snes_max_it")


def test_where_the_time_goes_is_told_by_petsc(tmp_path: Path) -> None:
    """An analysis is a stage of -log_view; what a point costs stands there by name."""
    told = tmp_path / "log.txt"
    options = ["--set", "mode.petsc=-route krylov", "--petsc", f"-log_view :{told}"]
    run = ["run", str(CASE), "--out", str(tmp_path / "run"), *SHORT, *RANGE, *options]
    subprocess.run([sys.executable, "-m", "fretwave", *run], check=True, capture_output=True)
    text = told.read_text()
    stage = re.split(r"Event Stage \d+: mode", text)[1]
    counts = {line.split()[0]: int(line.split()[1]) for line in stage.splitlines() if line.startswith("Fw")}
    parts = ("FwContactForce", "FwContactJacob", "FwContactBlocks", "FwStructure", "FwPCBuild", "FwPCFollow")
    assert all(counts[name] > 0 for name in (*parts, "FwPairs", "FwErrorEstimate", "FwSummary"))
    assert counts["FwSummary"] < counts["FwContactForce"] < counts["FwStructure"]
    rows = len((tmp_path / "run" / "mode.csv").read_text().splitlines()) - 1
    assert counts["FwRecord"] == rows == counts["FwPoint"] - 1 and counts["FwTable"] > 0  # the last finds no point


@pytest.mark.parametrize("format", ["ascii_flamegraph", "ascii_xml", "ascii_xml:append"])
def test_what_called_what_is_told_by_petsc(tmp_path: Path, format: str) -> None:
    """Of both analyses; PETSc crashed at its end where it had not counted so from the beginning."""
    told, given = tmp_path / "log.txt", ["--only", "mode,mode_epmc"]
    options = [*given, "--set", "mode_epmc.harmonics=3", "--set", "mode_epmc.amplitude=[0.02, 0.05]"]
    run = ["run", str(CASE), "--out", str(tmp_path / "run"), *SHORT, *RANGE, *options, "--no-plots"]
    last = ["--petsc", f"-log_view :{told}:{format}"]
    subprocess.run([sys.executable, "-m", "fretwave", *run, *last], check=True, capture_output=True)
    assert re.search(
        r"FwPoint;SNESSolve;" if format == "ascii_flamegraph" else r"<name>FwPoint</name>", told.read_text()
    )


def test_petsc_s_help_lists_our_own_options_with_what_they_mean(tmp_path: Path) -> None:
    run = ["run", str(CASE), "--out", str(tmp_path / "run"), *SHORT, *RANGE, "--petsc", "-help"]
    done = subprocess.run([sys.executable, "-m", "fretwave", *run], check=True, capture_output=True, text=True)
    lines = [line.strip() for line in done.stdout.splitlines()]
    split = (re.match(r"(-\S+?):? <(?:now )?(.*)", line) for line in lines)  # as PETSc 3.18 and 3.26 write them
    listed = {found[1]: found[2] for found in split if found}
    for name, value, meaning in tuned_constants():
        assert meaning in listed[f"-{name}"] and float(listed[f"-{name}"].split(" : ")[0]) == pytest.approx(value, 1e-5)
    assert "direct or krylov" in listed["-mode_route"] and "dense or sparse" in listed["-mode_blocks"]
    assert "-mode_snes_rtol" in listed


@pytest.mark.parametrize("command", [["view"], ["report"], ["probe", "--dof", "m1"], ["stress"]])
@pytest.mark.parametrize("out", [".", "results.h5/out", "case.toml/a/b", "missing/out", "x" * 300])
def test_a_file_to_write_is_no_folder_and_lies_in_one(earlier: Path, monkeypatch, capfd, command, out) -> None:
    monkeypatch.chdir(earlier)
    assert main([command[0], ".", *command[1:], "--out", out]) == 2
    said = capfd.readouterr().err
    assert "--out" in said and said.count("fix:") == 1


@pytest.mark.parametrize("command", [["run"], ["sweep", "--over", "mode.harmonics=3,5"], ["study"]])
def test_results_go_into_no_file(tmp_path: Path, capfd, command: list[str]) -> None:
    """Told before the first point, not behind it."""
    (tmp_path / "taken").write_text("mine")
    for out in (tmp_path / "taken", tmp_path / "taken" / "below", tmp_path / ("x" * 300) / "run"):
        only = ["--only", "mode"] if command[0] != "study" else []
        assert main([command[0], str(CASE), "--quick", *only, *command[1:], "--out", str(out)]) == 2
        said = capfd.readouterr().err
        assert ("this name is too long" if "xx" in out.parent.name else "not a folder for results") in said
        assert said.count("fix:") == 1
    assert (tmp_path / "taken").read_text() == "mine"


def test_failure_before_the_first_point_makes_no_folder(tmp_path: Path, capfd) -> None:
    folder = tmp_path / "run"
    for wrong in ("mode.harmonics=0", "mode.petsc=-snes_rtoll 1"):
        assert (
            main(
                [
                    "run",
                    str(CASE),
                    "--out",
                    str(folder),
                    "--only",
                    "mode",
                    "--set",
                    wrong,
                ]
            )
            == 2
        )
    assert not folder.exists()


def test_not_converged_keeps_what_was_found(tmp_path: Path, capfd) -> None:
    folder = tmp_path / "run"
    code = main(
        [
            "run",
            str(CASE),
            "--out",
            str(folder),
            *SHORT,
            "--set",
            "mode.step.max_points=4",
            "--set",
            "mode.report_at=[]",
        ]
    )
    text = capfd.readouterr().err
    assert code == 3
    assert "'mode' stopped early" in text
    assert "  try: " in text
    assert len((folder / "mode.csv").read_text().splitlines()) == 5
    assert json.loads((folder / "run.json").read_text())["analyses"]["mode"]["status"] == "stopped"


def test_what_is_advised_after_a_loop_can_be_set(capfd) -> None:
    settings = re.findall(r"--set \S+=[\d.]+", advice("mode", "the branch is a closed loop: it comes back to 2"))
    assert main(["check", str(CASE), "--no-solve", *" ".join(settings).split()]) == 0
    assert len(settings) == 2


@pytest.mark.parametrize(
    "reason", ["is a closed loop: it comes back to {}", "comes back to {}, where it began"], ids=["closed", "back"]
)
def test_a_response_that_comes_round_may_be_begun_at_its_other_end(reason) -> None:
    """Its first frequency may lie under a curve that closes on itself; from the last one another leads through."""
    other = "--set forced.frequency="
    assert other in advice("forced", "the branch " + reason.format("2 rad/s"))
    assert other not in advice("forced", "the branch " + reason.format("amplitude 2"))
    assert other not in advice("forced", "the branch turns back onto itself: it passes 2 rad/s a second time")


@pytest.mark.parametrize("reason", ["step too small: DIVERGED_MAX_IT", "the branch comes back to amplitude 2, where"])
def test_steps_that_pass_over_loops_can_be_asked_for(reason) -> None:
    option = re.search(r"--petsc '-(fw_\w+) 1e300'", advice("mode", reason))
    assert option and option[1] in {name for name, _, _ in tuned_constants()}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["rum"], "invalid choice"),
        (["run"], "CASE"),
        (["run", "nowhere.toml"], "does not exist"),
        (["run", str(CASE), "--only", "mod"], "did you mean `mode`?"),
        (
            ["run", str(CASE), "--only", "free_decay", "--out", "nowhere"],
            "--only mode,free_decay",
        ),
        (["resume", "nowhere"], "not a run folder"),
        (["show", "nowhere"], "no results here"),
        (["plot", "nowhere"], "no results here"),
        (["plot", "nowhere", "--format", "pgn"], "did you mean `png`?"),
        (["check", str(CASE), "--set", "mode.harmonics=0"], "mode.harmonics"),
    ],
)
def test_wrong_command_lines(arguments: list[str], said: str, capfd, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert said in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_check_says_what_would_run(capfd) -> None:
    assert main(["check", str(CASE)]) == 0
    text = capfd.readouterr().out
    for said in (
        "no errors",
        "2 dofs: m1, m2",
        "friction_limit = 5",
        "harmonics 1, 3, ..., 21",
        "left out: even",
    ):
        assert said in text


def test_help_starts_without_the_solvers(launch) -> None:
    program = (
        "import sys; from fretwave.commands.main import parser; parser().format_help();"
        "print([m for m in ('petsc4py', 'mpi4py', 'matplotlib', 'h5py', 'numpy', 'rich') if m in sys.modules])"
    )
    assert launch(1, "-c", program).stdout.strip() == "[]"


def test_one_message_on_two_ranks(launch, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    wrong = ["--set", "mode.petsc=-snes_rtoll 1"]
    done = launch(
        2,
        "-m",
        "fretwave",
        "run",
        str(CASE),
        "--out",
        str(folder),
        *SHORT,
        *RANGE,
        *wrong,
    )
    assert done.returncode == 2
    assert done.stderr.count("error: no solver reads") == 1
    assert not folder.exists()


@pytest.mark.parametrize("command", ["view", "run", "check", "import", "show", "plot", "study"])
def test_an_unknown_option_is_told_of_its_command(command: str, capfd) -> None:
    assert main([command, "x", "--wrong"]) == 2
    said = capfd.readouterr().err
    assert "unrecognized arguments: --wrong" in said
    assert f"where:    fretwave {command}\n" in said and f"`fretwave {command} --help`" in said


def test_only_given_again_adds_to_what_was_given(tmp_path: Path) -> None:
    """free_decay begins with mode's result, and is refused alone."""
    again = ["--only", "mode", "--only", "free_decay"]
    assert main(["run", str(CASE), "--quick", "--no-plots", *again, "--out", str(tmp_path / "out")]) == 0
    assert {path.name for path in (tmp_path / "out").glob("*.csv")} >= {"mode.csv", "free_decay.csv"}


def test_options_of_the_time_integration_are_read_after_the_points(tmp_path: Path, capsys) -> None:
    """They were refused, as nothing had read them when the first point was found."""
    given = ["--only", "forced", "--no-plots", "--set", "forced.levels=[2.0]", "--set", "forced.time_points=1"]
    words = ["run", str(CASE), "--out", str(tmp_path / "run"), *given]
    assert main([*words, "--set", "forced.petsc=-time_ts_rtol 1e-6 -time_ts_event_tol 3"]) == 0
    assert "forced: PETSc options that no solver has read: -time_ts_event_tol\n" in capsys.readouterr().out
    assert main([*words, "--force", "--set", "forced.petsc=-time_ts_rtol 1e-6 -time_ts_rtoll 3"]) == 2
    assert "fix:      did you mean `-time_ts_rtol`?" in capsys.readouterr().err


#: Whose last option takes several values, and with them the file or folder.
SWALLOWED = {
    "import": (["--pairs", "a", "b", "out.h5"], "`fretwave import OUT.h5 ...`: before the options"),
    "probe": (["--dof", "tip", "--at", "peak", "run"], "`fretwave probe RUNDIR ...`: before the options"),
}


@pytest.mark.parametrize("name", SWALLOWED)
def test_a_place_behind_several_values(name, capfd):
    given, said = SWALLOWED[name]
    assert main([name, *given]) == 2
    assert said in capfd.readouterr().err
    assert main([name]) == 2
    assert f"`fretwave {name} --help` lists" in capfd.readouterr().err
