"""A study of wear: which runs it makes, what its errors are, and one on a cheap case."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_line import call
from models.wear_case import write_case
from mpi4py import MPI

from fretwave.case.load import load_case
from fretwave.files.csv_table import write_rows
from fretwave.plots.study import figures
from fretwave.results.reader import Run
from fretwave.results.study_report import LEGEND_OF_WEAR, PRINTED_OF_WEAR, markdown
from fretwave.run.wear_study import TOLERANCES, WearOutcome, WearPlan, WearSettings, wear_plan

pytestmark = pytest.mark.ranks(1)

BASE = WearSettings(harmonics=3, tolerance=1e-3, pressure_change=0.2)


def outcome(settings: WearSettings) -> WearOutcome:
    """Off by the tolerance in the worn volume, by 1/H in zeta."""
    worn, zeta = 2e-9 * (1 + settings.tolerance), 0.04 * (1 + 1 / settings.harmonics)
    return WearOutcome(1000.0, zeta, worn, 10, 30, 0.1 * settings.harmonics)


def filled(plan: WearPlan) -> WearPlan:
    plan.outcomes.update({settings: outcome(settings) for settings in plan.runs()})
    return plan


def test_each_sweep_leaves_the_others_as_in_the_analysis_and_has_its_own_finest():
    plan = filled(WearPlan(BASE, (7, 1, 3), (1e-4, 1e-1, 1e-3), (0.4, 0.2)))
    assert [settings.tolerance for settings in dict(plan.sweeps())["tolerance"]] == [1e-1, 1e-3, 1e-4]
    assert len(plan.runs()) == 3 + 3 + 2 - 2  # the analysis' own settings are in all three sweeps
    rows = plan.table()
    assert [(row["sweep"], row["harmonics"]) for row in rows if row["reference"]] == [
        *(("tolerance", 3), ("pressure_change", 3), ("harmonics", 7)),
    ]
    assert rows[0]["worn_error"] == pytest.approx(0.1 / 1.0001 - 1e-4 / 1.0001)
    first = next(row for row in rows if row["sweep"] == "harmonics")
    assert first["zeta_error"] == pytest.approx(2.0 / (1 + 1 / 7) - 1) and first["worn_error"] == 0.0


def test_a_sweep_without_its_finest_run_is_left_out():
    plan = filled(WearPlan(BASE, (1, 3), (1e-2, 1e-4)))
    del plan.outcomes[WearSettings(3, 1e-4, 0.2)]
    assert {row["sweep"] for row in plan.table()} == {"harmonics"}


def test_a_bound_that_never_rules_is_said():
    """Errors of exactly zero are no accuracy: the pressure ruled every step."""
    plan = filled(WearPlan(BASE, (1, 3), (1e-1, 1e-2, 1e-3)))
    assert list(plan.without_effect()) == []
    same = plan.outcomes[WearSettings(3, 1e-3, 0.2)]
    plan.outcomes[WearSettings(3, 1e-2, 0.2)] = replace(same, wall_s=7.0)
    (said,) = plan.without_effect()
    assert said.startswith("With tolerance = 0.01 all steps are those of the finest run, as pressure_change = 0.2")
    assert "--pressure-change" in said


def test_table_and_picture(tmp_path):
    rows = filled(WearPlan(BASE, (1, 3), (1e-1, 1e-2, 1e-4))).table()
    text = markdown(rows, ["a note"], PRINTED_OF_WEAR, LEGEND_OF_WEAR).splitlines()
    assert len({len(line) for line in text[: 2 + len(rows)]}) == 1 and text[-1] == "a note"
    assert "2.20000" in text[2]
    write_rows(tmp_path / "study.csv", rows)
    ((name, figure),) = figures(Run(tmp_path))
    assert name == "study" and [axes.get_title() for axes in figure.axes] == ["Damping", "Frequency", "Worn volume"]
    volume = {line.get_label(): line.get_ydata() for line in figure.axes[2].lines}
    assert volume["tolerance (tol)"] == pytest.approx([(0.1 - 1e-4) / 1.0001, (1e-2 - 1e-4) / 1.0001])


def test_sweeps_come_from_the_command_line_or_the_case_or_are_of_the_tolerance(tmp_path):
    path = write_case(tmp_path)
    nothing = SimpleNamespace(harmonics=None, tolerance=None, pressure_change=None)
    given = SimpleNamespace(harmonics=[1, 5], tolerance=None, pressure_change=[0.1, 0.3])
    case = load_case(path)
    plan = wear_plan(case, case.analyses["wear"], nothing)
    assert plan.base == WearSettings(3, 1e-3, 0.2) and plan.tolerance == TOLERANCES and not plan.harmonics
    path.write_text(path.read_text() + "\n[study]\nharmonics = [1, 3]\nwear_tolerance = [1e-2, 1e-5]\n")
    case = load_case(path)
    plan = wear_plan(case, case.analyses["wear"], nothing)
    assert (plan.harmonics, plan.tolerance, plan.pressure_change) == ((1, 3), (1e-2, 1e-5), ())
    plan = wear_plan(case, case.analyses["wear"], given)
    assert (plan.harmonics, plan.tolerance, plan.pressure_change) == ((1, 5), (), (0.1, 0.3))


@pytest.mark.ranks(1, 2)
def test_a_sharper_tolerance_pays_in_a_cheap_case(tmp_path):
    """The explicit stepper of order 3: errors fall with the tolerance, steps and Newton iterations grow."""
    folder = Path(MPI.COMM_WORLD.bcast(str(tmp_path)))
    if MPI.COMM_WORLD.rank == 0:
        write_case(folder)
    MPI.COMM_WORLD.barrier()
    choice = ["--tolerance", "1e-4,1e-6,1e-7", "--harmonics", "1,3", "--repeats", "1"]
    assert call("study", folder / "case.toml", "--analysis", "wear", "--out", folder / "study", *choice) == 0
    if MPI.COMM_WORLD.rank == 0:
        with (folder / "study" / "study.csv").open() as file:
            rows = list(csv.DictReader(file))
        swept = [row for row in rows if row["sweep"] == "tolerance"]
        errors, steps = ([float(row[key]) for row in swept] for key in ("worn_error", "steps"))
        assert 1e-3 > errors[0] > 10 * errors[1] > 0 == errors[2]
        assert steps[0] < steps[1] < steps[2]
        assert float(rows[-2]["harmonics"]) == 1 and float(rows[-2]["worn_error"]) > 0.05
        assert (folder / "study" / "study.png").exists() and (folder / "study" / "study.md").exists()


def test_an_analysis_that_cannot_be_studied_is_answered(tmp_path, capfd):
    assert call("study", write_case(tmp_path), "--analysis", "worn") == 2
    told = capfd.readouterr().err
    assert "--analysis mode" in told and "mode, wear" in told


def test_bad_input_is_told_once_and_is_no_run_that_failed(tmp_path, capfd):
    """It was told once for each run, all of it in one `measured`, and ended as not converged."""
    path = write_case(tmp_path)
    arguments = ["--analysis", "wear", "--set", "wear.coefficient=1e300", "--repeats", "1", "--out", tmp_path / "study"]
    assert call("study", path, *arguments) == 2
    told = capfd.readouterr()
    assert told.err.count("cannot be marched over") == 1 and "cannot be marched over" not in told.out


def test_a_run_without_a_start_is_told_in_one_line(tmp_path, capfd):
    path = write_case(tmp_path)
    arguments = ["--analysis", "wear", "--set", "mode.step.max_points=2", "--repeats", "1", "--out", tmp_path / "study"]
    assert call("study", path, *arguments, "--tolerance", "1e-2") == 3
    told = capfd.readouterr()
    assert "reaches none of the amplitudes of wear: the mode ends early" in told.out
    assert "milder finest settings" in told.err and told.err.count("try:") == 1


def test_a_march_that_is_cut_is_told_what_the_run_would_say(tmp_path, capfd):
    """Milder settings are of no use against a largest number of points."""
    path = write_case(tmp_path)
    arguments = ["--analysis", "wear", "--set", "wear.max_points=2", "--repeats", "1", "--out", tmp_path / "study"]
    assert call("study", path, *arguments, "--tolerance", "1e-2,1e-3") == 3
    told = capfd.readouterr().err
    assert "wear.max_points=20000" in told.rpartition("try:")[2]
    assert told.count("largest number of points") == 1
