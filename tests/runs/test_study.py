"""What a study runs, how it measures errors, and what it prints; solvers are replaced by closed forms."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest

from fretwave.files.csv_table import write_rows
from fretwave.results.study_report import markdown
from fretwave.run.study import what_helps
from fretwave.run.study_outcomes import Outcome, ResponseOutcome
from fretwave.run.study_plan import Plan, Settings, Study, common_amplitudes

pytestmark = pytest.mark.ranks(1)

PLAN = Plan(harmonics=(1, 3, 7), samples=(8, 64, 256), tolerance=(1e-2, 1e-10))


def solve(settings: Settings, extra=()) -> Outcome:
    """A branch with zeta off by 1/H^2 of its peak, omega by 1/N_t relative."""
    amplitude = np.concatenate([common_amplitudes(0.1, 1.0, 5), extra])
    zeta = 0.04 * amplitude * (1.0 + 1.0 / settings.harmonics**2)
    omega = np.full_like(amplitude, 25.0 * (1.0 + 1.0 / settings.samples))
    estimate = np.outer(np.full_like(amplitude, 25.0 * 0.008 / settings.harmonics**2), [1.0, 0.0, 0.0, 0.0])
    cost = 0.01 * settings.harmonics
    return Outcome(amplitude, omega, zeta, estimate, float(zeta.max()), 1.0, 50, 150, 2 * cost, cpu_s=cost)


def run_study(solver=solve):
    study = Study(PLAN, common_amplitudes(0.1, 1.0, 5))
    solved = []
    study.run(solver, lambda sweep, settings: solved.append((sweep, settings)))
    return study, solved


def test_one_setting_is_swept_at_a_time_and_the_finest_run_is_shared():
    study, solved = run_study()
    assert PLAN.reference == Settings(7, 256, 1e-10)
    assert [settings for _, settings in solved].count(PLAN.reference) == 1
    assert [row["reference"] for row in study.table()].count(1) == 3
    assert all(row["zeta_error"] == 0.0 for row in study.table() if row["reference"])


def test_fewer_than_two_samples_per_highest_harmonic_are_not_run():
    assert all(settings.samples > 14 for sweep, settings in PLAN.sweeps() if sweep == "samples")


def test_errors_are_measured_against_the_finest_run():
    study, _ = run_study()
    first = study.table()[0]
    peak = 0.04 * study.places[-1] * (1.0 + 1.0 / 49.0)
    assert first["zeta_error"] == pytest.approx(0.04 * study.places[-1] * (1.0 - 1.0 / 49.0) / peak)
    assert first["peak_zeta_error"] == pytest.approx(2.0 / (1.0 + 1.0 / 49.0) - 1.0)
    assert first["zeta_error_estimate"] == pytest.approx(0.008 / (1.0 + 1.0 / 256.0) / peak)
    # at the five amplitudes zeta is off by 0.04 a (1 - 1/49), an estimate of 0.008 is 0.3 to 1.4 of that
    ratios = 0.008 / (0.04 * study.places * (1.0 - 1.0 / 49.0))
    assert first["within_3"] == np.mean((ratios < 3) & (ratios > 1 / 3)) < 1 == first["within_10"]
    rows = [row for row in study.calibration() if row["sweep"] == "harmonics" and row["harmonics"] == 1]
    assert [row["estimate"] / row["error"] for row in rows] == pytest.approx(ratios, rel=1e-2)  # zeta is small
    samples = next(row for row in study.table() if row["sweep"] == "samples")
    assert samples["omega_error"] == pytest.approx((1.0 + 1.0 / 64.0) / (1.0 + 1.0 / 256.0) - 1.0)


def test_a_finest_run_judges_no_error_that_is_as_small_as_its_own():
    """zeta is off by 1/H^2, as every run says itself: 1 - 1/49 is 48 times 1/49, 1/25 - 1/49 about as large."""

    def exactly(settings):
        found = solve(settings)
        return replace(found, estimate=np.outer(found.amplitude / settings.harmonics**2, [1.0, 0.0, 0.0, 0.0]))

    study = Study(replace(PLAN, harmonics=(1, 5, 7)), common_amplitudes(0.1, 1.0, 5))
    study.run(exactly, lambda sweep, settings: None)
    far, near = study.table()[:2]
    assert far["judged"] == 5 and far["within_3"] == 1.0
    assert near["judged"] == 0 and np.isnan(near["within_3"]) and near["zeta_error"] > 0
    rows = [row for row in study.calibration() if row["harmonics"] == 5 and row["sweep"] == "harmonics"]
    assert [row["judge"] for row in rows] == pytest.approx(study.places / 49)


def test_amplitudes_that_a_run_meets_several_times_are_left_out():
    inside = common_amplitudes(0.1, 1.0, 5)[2]
    study, _ = run_study(lambda settings: solve(settings, [inside] if settings.harmonics == 3 else []))
    assert study.left_out == pytest.approx([inside])
    assert len(study.compared) == 4
    assert study.table()[0]["zeta_error"] > 0.0


def test_a_run_that_fails_is_named_and_the_others_are_kept():
    study, _ = run_study(lambda settings: "step too small" if settings.harmonics == 1 else solve(settings))
    assert study.failures == {Settings(1, 256, 1e-10): "step too small"}
    assert len(study.table()) == len(PLAN.sweeps()) - 1


def test_without_the_finest_run_there_is_no_table():
    study, _ = run_study(lambda settings: "no" if settings == PLAN.reference else solve(settings))
    assert study.table() == []


def test_what_others_finish_without_is_named_first():
    """And options that a study does not take are given as those of the analysis."""
    study, _ = run_study(lambda settings: "step too small" if settings.tolerance == 1e-10 else solve(settings))
    helps = what_helps(study, "mode")
    assert helps.startswith("a milder finest tolerance, with which other runs finish; or shorter steps")
    assert "--set mode.petsc='-fw_branch_other 1e300'" in helps and "--petsc" not in helps


def test_table_is_written_as_csv_and_as_markdown(tmp_path):
    rows = run_study()[0].table()
    write_rows(tmp_path / "study.csv", rows)
    lines = (tmp_path / "study.csv").read_text().splitlines()
    assert lines[0].startswith("sweep,harmonics,samples,tolerance,points,newton,wall_s,omega_error,zeta_error,")
    assert len(lines) == 1 + len(rows)
    text = markdown(rows, ["a note"]).splitlines()
    assert len({len(line) for line in text[: 2 + len(rows)]}) == 1  # aligned
    assert "harmonics (finest)" in text[4]
    assert text[-1] == "a note"


@pytest.mark.ranks(1, 2)
def test_study_of_the_two_dof_case_shows_that_harmonics_pay(tmp_path):
    """One harmonic misses 40 % of the peak damping, seven about 8 % (measured with other programs)."""
    from pathlib import Path

    from mpi4py import MPI

    from fretwave.commands import study as command

    folder = Path(MPI.COMM_WORLD.bcast(str(tmp_path)))
    case = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
    choice = ["--harmonics", "1,7,15", "--samples", "256", "--tolerance", "1e-10", "--repeats", "1"]
    assert command.main([str(case), "--analysis", "mode", "--out", str(folder), *choice]) == 0
    if MPI.COMM_WORLD.rank == 0:
        lines = (folder / "study.csv").read_text().splitlines()
        rows = [dict(zip(lines[0].split(","), line.split(","))) for line in lines[1:]]
        assert float(rows[0]["peak_zeta_error"]) == pytest.approx(0.40, abs=0.03)
        assert float(rows[1]["peak_zeta_error"]) == pytest.approx(0.08, abs=0.03)
        assert (folder / "study.png").exists()


def test_component_modes_are_swept_like_any_setting():
    plan = Plan(harmonics=(1, 3), samples=(64,), tolerance=(1e-10,), component_modes=(8, 2))
    assert plan.reference == Settings(3, 64, 1e-10, 8)
    swept = [settings for sweep, settings in plan.sweeps() if sweep == "component_modes"]
    assert swept == [Settings(3, 64, 1e-10, 2), Settings(3, 64, 1e-10, 8)]
    study = Study(plan, common_amplitudes(0.1, 1.0, 5))
    study.run(solve, lambda sweep, settings: None)
    assert "| modes " in markdown(study.table())
    assert "modes" not in markdown(run_study()[0].table())


def test_an_accuracy_is_held_against_the_quickest_set_that_keeps_it():
    """At H = 7 zeta is off by nothing, at 3 by 9 % of itself, at 1 by 96 %: 0.1 asks for 3, 0.01 for 7."""

    def choosing(settings: Settings) -> Outcome:
        return solve(settings) if settings.accuracy is None else replace(solve(settings), harmonics=5, samples=128)

    plan = replace(PLAN, samples=(256,), accuracy=(1e-2, 1e-1))
    study = Study(plan, common_amplitudes(0.1, 1.0, 5))
    study.run(choosing, lambda sweep, settings: None)
    rows = [row for row in study.table() if row["sweep"] == "accuracy"]
    assert [row["accuracy"] for row in rows] == [1e-1, 1e-2] and {row["harmonics"] for row in rows} == {5}
    assert [row["best_fixed_s"] for row in rows] == [pytest.approx(0.03), pytest.approx(0.07)]
    assert [row["kept"] for row in rows] == [1.0, 1.0]  # they are the finest run here
    sets = [(s.harmonics, s.samples) for sweep, s in plan.sweeps() if sweep == "set"]
    assert sets == [(1, 64), (3, 64), (7, 128)]
    text = markdown(study.table())
    assert "| kept " in text and "nan" not in text


@pytest.mark.ranks(1)
def test_a_study_asks_a_case_for_accuracies(tmp_path):
    from pathlib import Path

    from fretwave.commands import study as command

    case = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
    choice = ["--harmonics", "7,61", "--samples", "1024", "--tolerance", "1e-10", "--accuracy", "1e-1,3e-2"]
    assert command.main([str(case), "--out", str(tmp_path), *choice, "--repeats", "1"]) == 0
    with open(tmp_path / "study.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["sweep"] == "accuracy"]
    assert [float(row["accuracy"]) for row in rows] == [1e-1, 3e-2]
    assert all(float(row["kept"]) >= 0.95 for row in rows)
    assert 5 <= int(rows[0]["harmonics"]) < int(rows[1]["harmonics"]) < 61


def respond(settings: Settings) -> ResponseOutcome:
    """A response of 2 m at its peak that is off by 0.2 / H m everywhere, which it says twofold."""
    omega = np.linspace(20.0, 30.0, 7)[1:-1]
    value = 2.0 / (1.0 + (omega - 25.0) ** 2) + 0.2j / settings.harmonics
    estimate = np.outer(np.full_like(omega, 0.4 / settings.harmonics), [1.0, 0.0, 0.0, 0.0])
    peak = float(np.abs(value).max())
    cost = 0.01 * settings.harmonics
    return ResponseOutcome(omega, value.real, -value.imag, estimate, peak, 25.0, 40, 90, 2 * cost, cpu_s=cost)


def test_errors_of_a_response_are_those_of_its_complex_amplitude_over_the_peak():
    study = Study(replace(PLAN, accuracy=(1e-1,)), np.linspace(20.0, 30.0, 7)[1:-1], "omega")
    study.run(respond, lambda sweep, settings: None)
    first, peak = study.table()[0], float(np.hypot(2.0, 0.2 / 7))
    assert first["harmonics"] == 1 and first["peak_frequency_hz"] == pytest.approx(25.0 / (2 * np.pi))
    assert first["amplitude_error"] == pytest.approx(0.2 * 6 / 7 / peak)
    assert first["amplitude_error_estimate"] == pytest.approx(0.4 / peak)
    assert first["peak_amplitude_error"] == pytest.approx(np.hypot(2.0, 0.2) / peak - 1)
    rows = [row for row in study.calibration() if row["harmonics"] == 3 and row["sweep"] == "harmonics"]
    assert [row["omega"] for row in rows] == pytest.approx(study.places)
    assert [row["estimate"] / row["error"] for row in rows] == pytest.approx([0.4 / 3 / (0.2 / 3 - 0.2 / 7)] * 5)
    # H = 3 is off by less than 0.1 of the amplitude at three of five frequencies only
    asked = next(row for row in study.table() if row["sweep"] == "accuracy")
    assert asked["kept"] == 1.0 and asked["best_fixed_s"] == pytest.approx(0.07)


@pytest.mark.ranks(1, 2)
def test_a_forced_response_is_studied_at_its_largest_level(tmp_path):
    from pathlib import Path

    from mpi4py import MPI

    from fretwave.commands import study as command

    folder = Path(MPI.COMM_WORLD.bcast(str(tmp_path)))
    case = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
    choice = ["--harmonics", "3,15,31", "--samples", "128", "--tolerance", "1e-10", "--repeats", "1"]
    assert command.main([str(case), "--analysis", "forced", "--out", str(folder), *choice]) == 0
    if MPI.COMM_WORLD.rank == 0:
        with (folder / "study.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        # 0.2480 m with 61 and with 181 harmonics
        assert float(rows[2]["peak_amplitude"]) == pytest.approx(0.2480, rel=2e-3)
        assert float(rows[0]["peak_amplitude_error"]) == pytest.approx(0.67, abs=0.02)
        assert float(rows[1]["amplitude_error"]) < 0.03 < 0.3 < float(rows[0]["amplitude_error"])
        assert (folder / "study.png").exists() and (folder / "calibration.png").exists()
        assert "error of amplitude" in (folder / "study.md").read_text()
