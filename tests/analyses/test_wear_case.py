"""Wear from a case file: the table, what it says of bad input, kills, ranks, and no wear at all."""

from __future__ import annotations

import csv
import json
import re
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from test_built import BUILDER, TEXT
from test_resume import command, kill_at, without_time
from tolerances import LAST_DIGITS, REPEATED, ROUNDING

from fretwave.analyses.wear import march_advice
from fretwave.case.load import load_case
from fretwave.commands.main import main
from fretwave.errors import CaseErrors

pytestmark = pytest.mark.ranks(1)

WEAR = """
[[analysis]]
name = "wear"
type = "wear"
mode = "mode"
amplitude = [1.8e-6, 2.1e-6]
cycles = 3.0
coefficient = 1e-12
report_at = [1.0]
"""
#: Differences between rank counts come from the order of additions.
RANK_TOLERANCE = 1e-9


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("wear_case")
    (path / "model.py").write_text(BUILDER.read_text())
    (path / "case.toml").write_text(TEXT + WEAR)
    return path


def arguments(folder: Path, out: Path, *more: str) -> list[str]:
    return ["run", str(folder / "case.toml"), "--only", "wear", "--no-plots", "--out", str(out), *more]


def rows(folder: Path, name: str = "wear") -> list[dict[str, str]]:
    with open(folder / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def run(folder: Path, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("run")
    assert main(arguments(folder, out)) == 0
    return out


def test_table_has_a_line_for_each_amplitude(run: Path) -> None:
    table = rows(run)
    for number, amplitude in enumerate((1.8e-6, 2.1e-6)):
        line = [row for row in table if int(row["line"]) == number]
        assert [float(row["amplitude"]) for row in line] == pytest.approx([amplitude] * len(line), rel=ROUNDING)
        cycles, worn = (np.array([float(row[key]) for row in line]) for key in ("cycles", "worn_1"))
        assert cycles[0] == 0 and (np.diff(cycles) > 0).all() and cycles[-1] == pytest.approx(3.0, rel=LAST_DIGITS)
        assert worn[0] == 0 and (np.diff(worn) >= 0).all() and worn[-1] > 0
        assert [row["event"] for row in line if row["event"]] == ["start", "report", "stop"]
        assert max(abs(float(row["energy_error"])) for row in line) < REPEATED


@pytest.fixture(scope="module")
def unworn(folder: Path, tmp_path_factory) -> list[dict[str, str]]:
    out = tmp_path_factory.mktemp("mode")
    assert main(["run", str(folder / "case.toml"), "--only", "mode", "--no-plots", "--out", str(out)]) == 0
    return rows(out, "mode")


BY_SOURCE = [f"lambda_error_{name}" for name in ("harmonics", "samples", "reduction")]


def test_new_surfaces_have_the_errors_of_the_mode(run: Path, unworn: list[dict[str, str]]) -> None:
    """But for what their linear systems are solved to: 1 % at most."""
    for new in (row for row in rows(run) if row["event"] == "start"):
        own = next(row for row in unworn if float(row["amplitude"]) == pytest.approx(float(new["amplitude"]), rel=1e-9))
        for name in ("omega_error", "zeta_error"):
            assert float(new[name]) == pytest.approx(float(own[name]), rel=1e-2)
        for name in BY_SOURCE:
            assert float(new[name]) == pytest.approx(float(own[name]), rel=1e-2, abs=1e-3 * float(own["omega_error"]))


@pytest.mark.parametrize(
    ("sets", "known"),
    [
        ([], "events"),
        (["wear.errors=true"], "all"),
        (["wear.errors=false"], "none"),
        (["mode.errors=false"], "none"),
        (["mode.errors=false", "wear.errors=true"], "all"),
    ],
    ids=str,
)
def test_errors_are_where_they_are_asked_for(folder: Path, tmp_path: Path, capfd, sets: list[str], known: str) -> None:
    given = [word for text in sets for word in ("--set", text)]
    assert main(arguments(folder, tmp_path, "--set", "wear.amplitude=[2.1e-6]", *given)) == 0
    table = rows(tmp_path)
    assert len(table) > 4
    expected = [known == "all" or (known == "events" and row["event"] != "") for row in table]
    assert [row["omega_error"] != "nan" for row in table] == expected
    told = capfd.readouterr().out
    assert ("error of zeta up to" in told) == any(expected)
    assert ("errors of the points between" in told) == (not sets)


def test_arrays_belong_to_the_rows(run: Path) -> None:
    with h5py.File(run / "results.h5") as file:
        wear = file["wear"]
        areas, depth = wear["pairs_pads/area"][()], wear["depth_pads"][()]
        assert depth @ areas == pytest.approx(wear["points/worn_1"][()], rel=ROUNDING)
        assert (wear["rate_pads"][()] >= 0).all() and (wear["load_pads"][()] > 0).all()
        assert wear["coefficients"].shape[0] == len(depth) and len(wear["reported"]) == 6
        vibrations = wear["points/cycles"][()] * wear.attrs["cycle_unit"]
        assert wear["points/vibrations"][()] == pytest.approx(vibrations, rel=ROUNDING)
    assert not list(run.glob(".wear*"))
    assert json.loads((run / "run.json").read_text())["analyses"]["wear"]["status"] == "done"


def test_the_coefficient_only_scales_time(folder: Path, run: Path, tmp_path: Path) -> None:
    """Ten times k_w: a tenth of the vibrations, the same normalised cycles."""
    assert main(arguments(folder, tmp_path, "--set", "wear.coefficient=1e-11")) == 0
    one, ten = rows(run), rows(tmp_path)
    for key, ratio in (("zeta", 1.0), ("worn_1", 1.0), ("cycles", 1.0), ("vibrations", 0.1)):
        assert [float(row[key]) for row in ten] == pytest.approx([ratio * float(row[key]) for row in one], rel=1e-7)


def test_without_a_coefficient_there_is_the_mode(folder: Path, tmp_path: Path) -> None:
    """k_w = 0: the reported points of the mode to the last digit, found by the same iterations."""
    assert main([*arguments(folder, tmp_path, "--set", "wear.coefficient=0.0"), "--only", "mode,wear"]) == 0
    expected = {float(row["amplitude"]): row for row in rows(tmp_path, "mode") if row["event"] == "report"}
    table = rows(tmp_path)
    assert len(table) == 2
    for row in table:
        mode = expected[float(row["amplitude"])]
        for key in ("omega", "omega0", "beta", "zeta", "stick", "slip", "open", "force_outside"):
            assert row[key] == mode[key], key
        assert (row["newton"], row["linear"], row["residual"]) == (mode["newton"], mode["linear"], mode["residual"])


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_do_not_matter(folder: Path, run: Path, tmp_path: Path, launch, ranks: int) -> None:
    """Groups of ranks take the lines; and one line on all ranks."""
    done = launch(ranks, "-m", "fretwave", *arguments(folder, tmp_path), timeout=120)
    assert done.returncode == 0, done.stderr
    one, many = rows(run), rows(tmp_path)
    for key in ("worn_1", "omega", "zeta", "cycles"):
        assert [float(row[key]) for row in many] == pytest.approx([float(row[key]) for row in one], rel=RANK_TOLERANCE)


def test_one_line_on_two_ranks(folder: Path, run: Path, tmp_path: Path, launch) -> None:
    done = launch(2, "-m", "fretwave", *arguments(folder, tmp_path, "--set", "wear.amplitude=[2.1e-6]"), timeout=120)
    assert done.returncode == 0, done.stderr
    one = [row for row in rows(run) if row["line"] == "1"]
    for key in ("worn_1", "omega", "zeta", "cycles"):
        found = [float(row[key]) for row in rows(tmp_path)]
        assert found == pytest.approx([float(row[key]) for row in one], rel=RANK_TOLERANCE)


@pytest.mark.parametrize("branch", ["[5e-7, 1e-6]", "[2e-6, 3e-6]"])
def test_amplitudes_may_lie_outside_the_branch_of_the_mode(
    folder: Path, run: Path, tmp_path: Path, branch: str
) -> None:
    """The mode is followed as far as wear needs it."""
    assert main(arguments(folder, tmp_path, "--set", f"mode.amplitude={branch}", "--set", "mode.report_at=[]")) == 0
    expected, found = (float(rows(out)[-1]["worn_1"]) for out in (run, tmp_path))
    assert found == pytest.approx(expected, rel=1e-6)


def test_a_killed_run_resumes_exactly(folder: Path, run: Path, tmp_path: Path) -> None:
    """Killed in the second line: the first is not computed again, and the table is the uninterrupted one."""
    line = tmp_path / ".wear_lines" / "line_001" / "line.csv"
    lines = kill_at(command(*arguments(folder, tmp_path)), line, 4)
    assert 4 <= lines < len(rows(run))
    first = (tmp_path / ".wear_lines" / "line_000" / "line.csv").read_text()
    done = subprocess.run(command("resume", str(tmp_path)), check=True, capture_output=True, text=True)
    assert without_time(rows(tmp_path)) == without_time(rows(run))
    walls = [row["wall_s"] for row in rows(tmp_path) if row["line"] == "0"]
    assert walls == [row["wall_s"] for row in csv.DictReader(first.splitlines())] and "resumed" in done.stdout
    with h5py.File(tmp_path / "results.h5") as one, h5py.File(run / "results.h5") as other:
        assert sorted(one["wear"]) == sorted(other["wear"])
        assert np.array_equal(one["wear/rest_displacement"], other["wear/rest_displacement"])


def test_an_amplitude_that_the_mode_does_not_reach_leaves_the_others(folder: Path, tmp_path: Path, launch) -> None:
    """Exit 3, and what was found is kept; without any start nothing is written."""
    words = ["--set", "mode.step.max_points=8", "--set", "wear.amplitude=[2.5e-7, 2.1e-6]"]
    done = launch(1, "-m", "fretwave", *arguments(folder, tmp_path / "some", *words))
    assert done.returncode == 3 and "a = 2.1e-06 m: not reached by the mode" in done.stderr
    assert {row["line"] for row in rows(tmp_path / "some")} == {"0"}
    done = launch(
        1, "-m", "fretwave", *arguments(folder, tmp_path / "none", *words, "--set", "wear.amplitude=[2.1e-6]")
    )
    assert done.returncode == 3 and "reaches none of the amplitudes" in done.stderr
    assert re.search(r"of wear: the mode ends early: \w", done.stderr) and "--set mode.step" in done.stderr
    assert not (tmp_path / "none").exists()


BAD = [
    ('mode = "mode"', 'mode = "mod"', "is no mode analysis"),
    ("report_at = [1.0]", "report_at = [4.0]", "beyond the last cycle"),
    ("coefficient = 1e-12", "coefficient = -1e-12", "coefficient"),
    ("cycles = 3.0", 'cycles = 3.0\nstepper = "euler"', "stepper"),
]


@pytest.mark.parametrize("old, new, message", BAD)
def test_bad_input_is_refused(folder: Path, tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in WEAR
    (tmp_path / "model.py").write_text(BUILDER.read_text())
    (tmp_path / "case.toml").write_text(TEXT + WEAR.replace(old, new))
    with pytest.raises(CaseErrors, match=message):
        load_case(tmp_path / "case.toml")


def test_wear_of_odd_harmonics_is_refused(tmp_path: Path) -> None:
    (tmp_path / "model.py").write_text(BUILDER.read_text())
    text = (TEXT + WEAR).replace('type = "mode"', 'type = "mode"\nretain = "odd"', 1)
    (tmp_path / "case.toml").write_text(text)
    with pytest.raises(CaseErrors, match="odd harmonics alone"):
        load_case(tmp_path / "case.toml")


@pytest.mark.parametrize(
    "settings",
    [
        {"coefficient": 1e300},
        {"coefficient": 5e-324},
        {"coefficient": 1e300, "cycle_unit": 1.0},
        {"cycle_unit": 1e300, "cycles": 1e300},
        {"cycle_unit": 1e-300, "cycles": 1e-300},
    ],
)
def test_cycles_that_are_no_number_are_refused(
    folder: Path, tmp_path: Path, capsys, settings: dict[str, float]
) -> None:
    """They divided by zero, stood still at steps of no length, or did not end: the unit was 0 or infinite, or its
    product with the cycles was, or a step at the present rates was none of so many cycles."""
    words = [word for key, value in settings.items() for word in ("--set", f"wear.{key}={value}")]
    assert main(arguments(folder, tmp_path, *words, "--set", "wear.report_at=[]")) == 2
    found = capsys.readouterr().err
    assert "cannot be marched over" in found and "analysis 'wear'" in found and "fix:" in found


@pytest.mark.parametrize("coefficient, unit", [(1e-300, None), (1e100, None), (0.0, 1e300)])
def test_far_coefficients_and_units_that_are_numbers_are_marched(
    folder: Path, tmp_path: Path, coefficient: float, unit: float | None
) -> None:
    words = ["--set", f"wear.coefficient={coefficient}", *(["--set", f"wear.cycle_unit={unit}"] if unit else [])]
    assert main(arguments(folder, tmp_path, *words, "--set", "wear.report_at=[]")) == 0


def test_steps_have_an_end(folder: Path, run: Path, tmp_path: Path, capsys) -> None:
    """Steps of a millionth of the pressure went on for days; what was found is kept, and gone on with counts on."""
    words = [f"--set=wear.{text}" for text in ("max_points=6", "amplitude=[2.1e-6]", "report_at=[1e-9, 3.0]")]
    assert main(arguments(folder, tmp_path, *words, "--set", "wear.pressure_change=1e-7")) == 3
    told = capsys.readouterr()
    assert "largest number of points" in told.err and "6 points are kept" in told.err
    assert (
        "--set wear.max_points=" in told.err
        and "missed: a = 2.1e-06 m: report at 3 cycles: the march ended at" in told.out
    )
    table = rows(tmp_path)
    assert len(table) == 6 and float(table[-1]["cycles"]) > 0
    assert [row["event"] for row in table if row["event"]] == ["start", "report"]


def test_a_resumed_march_counts_the_points_before(folder: Path, tmp_path: Path) -> None:
    words = ("--set", "wear.max_points=9", "--set", "wear.amplitude=[2.1e-6]", "--set", "wear.pressure_change=1e-4")
    kill_at(command(*arguments(folder, tmp_path, *words)), tmp_path / ".wear_lines" / "line_000" / "line.csv", 4)
    assert subprocess.run(command("resume", str(tmp_path)), capture_output=True).returncode == 3
    assert len(rows(tmp_path)) == 9


def test_pairs_without_area_cannot_wear(tmp_path: Path) -> None:
    code, areas = BUILDER.read_text(), "areas=np.full(2, AREA),"
    text = TEXT.replace("tangential_stiffness_per_area = 2e10", "tangential_stiffness = 4e6")
    assert areas in code and text != TEXT
    (tmp_path / "model.py").write_text(code.replace(areas, ""))
    (tmp_path / "case.toml").write_text(text + WEAR)
    with pytest.raises(CaseErrors, match="areas of the pairs are not known"):
        load_case(tmp_path / "case.toml")


@pytest.mark.parametrize("area", ["-1e-4", "0.0", "np.nan"])
def test_pairs_whose_area_is_none_cannot_wear(tmp_path: Path, area: str) -> None:
    """As consistent weights of quadratic faces are at corners: such a pair wore backwards, its load grew."""
    code, areas = BUILDER.read_text(), "areas=np.full(2, AREA),"
    text = TEXT.replace("tangential_stiffness_per_area = 2e10", "tangential_stiffness = 4e6")
    assert areas in code and text != TEXT
    (tmp_path / "model.py").write_text(code.replace(areas, f"areas=np.array([AREA, {area}]),"))
    (tmp_path / "case.toml").write_text(text + WEAR)
    with pytest.raises(CaseErrors, match=r"(?s)areas of some pairs are no areas.*pair 1.*fix"):
        load_case(tmp_path / "case.toml")


@pytest.mark.parametrize(
    "reason", ["step too small: the contact changes too fast", "largest number of points", "the mode ends here"]
)
def test_what_is_advised_after_a_march_can_be_set(tmp_path: Path, reason: str) -> None:
    """It was `wear.step.minimum`, a key of modes."""
    (tmp_path / "model.py").write_text(BUILDER.read_text())
    (tmp_path / "case.toml").write_text(TEXT + WEAR)
    settings = re.findall(r"--set '?([\w.]+)=(\S+?)[,)' ]", march_advice("wear", reason))
    assert settings
    for name, value in settings:
        load_case(tmp_path / "case.toml", [f"{name}={value if value[0] != '[' else '[1e-6]'}"])
