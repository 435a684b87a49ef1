"""What is said of the values of a sweep: which of them stopped and why, and numbers in the unit of their analysis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models.csv_columns import rows
from models.swept_case import CASE
from test_engine_order import TEXT
from tolerances import SOLVED

from fretwave.results.file import open_results
from fretwave.results.sweep_summary import FORCED_LEVELS, summarise
from fretwave.results.sweeps import Branch
from fretwave.run.sweep import NAMED, why_branches_stopped, why_stopped

pytestmark = pytest.mark.ranks(1)

#: What rounding alone has no amplitude of.
OF_AMPLITUDE = ("onset_amplitude", "amplitude_of_largest_zeta", "amplitude_of_lowest_frequency")
#: Of four values what is said of each, and of the branches that one analysis has at the first three of them.
WHY = (("done", ""), ("stopped", "of its own; of another"), ("stopped", "of another"), ("failed", "no start"))
OWN = ((0, "done", ""), (1, "stopped", "of its own"), (2, "done", "stop value reached"))
LIMITS = "contact.slider.friction_limit="
#: A second mode of the same oscillator, of mass 4, over its own coordinate: sqrt(mass) times the displacement.
MODAL = CASE[CASE.index("[[analysis]]") : CASE.index('[[analysis]]\nname = "limits"')]
MODAL = MODAL.replace('"mode"', '"modal"', 1).replace('normalise = "x"', "normalise = { mode = 1 }")
HEAVY = CASE.replace("[[1.0]]", "[[4.0]]", 1)


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "case.toml"
    path.write_text(HEAVY.replace("60.0", "3.0") + MODAL.replace("60.0", "6.0"))
    return path


def test_amplitudes_of_other_units_stand_in_columns_of_their_own(case: Path, tmp_path: Path) -> None:
    """Slip begins where the displacement is the limit over kt, in the coordinate of the mode at twice that."""
    case.write_text(case.read_text().replace("[model]", '[model]\nunits = "mm-t-s"'))
    words = ["--over", f"{LIMITS}0.5,1.0", "--only", "mode,modal", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, *words) == 0
    columns = {"mode": ("slip_threshold [mm]", 1.0), "modal": ("slip_threshold [sqrt(t) mm]", 2.0)}
    for row in rows(tmp_path / "run" / "summary.csv"):
        own, factor = columns.pop(row["analysis"]) if row["value"] == "1" else columns[row["analysis"]]
        limit = float(row["contact.slider.friction_limit [N]"])
        assert float(row[own]) == pytest.approx(factor * limit, rel=0.5 * (np.pi / 512) ** 2)
        assert [row[name] for name in row if "slip_threshold" in name and name != own] == [""]
    assert not columns


def test_a_sweep_is_not_blamed_for_an_earlier_one_in_its_folder(case: Path, tmp_path: Path, capsys) -> None:
    """The first stops early in another analysis, whose results stay there."""
    words = ["--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, "--only", "modal", "--over", "modal.step.max_points=3,900", *words) == 3
    assert call("sweep", case, "--only", "mode", "--over", f"{LIMITS}0.5,1.0", *words) == 0
    assert call("resume", tmp_path / "run", "--no-plots") == 0
    assert "number of points" in capsys.readouterr().err


def test_show_says_why_a_sweep_stopped(case: Path, tmp_path: Path, capsys) -> None:
    words = ["--only", "mode", "--over", "mode.step.max_points=3,900", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, *words) == 3
    assert call("show", tmp_path / "run") == 0
    assert "mode: stopped early: max_points = 3: largest number of points" in capsys.readouterr().out


def test_each_analysis_of_a_sweep_has_its_own_reasons(case: Path, tmp_path: Path) -> None:
    """Of two keys each stops the branches of one analysis; both are done at the last value."""
    over = [word for name in ("mode", "modal") for word in ("--over", f"{name}.step.max_points=3,900")]
    words = ["--only", "mode,modal", *over, "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, *words) == 3
    with open_results(tmp_path / "run" / "results.h5") as file:
        said = {name: str(file[name].attrs["reason"]).split("; ") for name in ("mode", "modal")}
        assert [file[name].attrs["status"] for name in said] == ["stopped"] * 2
    for name, other in (("mode", "modal"), ("modal", "mode")):
        assert len(said[name]) == 2 and all("largest number of points" in one for one in said[name])
        assert all(f"{name}.step.max_points = 3" in one for one in said[name])
        assert any(f"{other}.step.max_points = 900" in one for one in said[name])


def test_an_analysis_that_is_done_has_no_reason(case: Path, tmp_path: Path, capsys) -> None:
    words = ["--only", "mode,modal", "--over", "mode.step.max_points=3,900", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, *words) == 3
    assert call("show", tmp_path / "run") == 0
    shown = capsys.readouterr().out
    assert "mode: stopped early: max_points = 3" in shown and "modal: stopped early" not in shown


def test_a_value_that_comes_to_no_point_of_an_analysis_gives_its_reason() -> None:
    outcomes = [{"status": status, "reason": reason} for status, reason in WHY]
    found = [Branch(k, Path(), {}, {}, {"status": status, "reason": reason}, {}) for k, status, reason in OWN]
    assert why_branches_stopped(outcomes, found) == {1: "of its own", 3: "no start"}
    assert why_stopped(outcomes) == {1: "of its own; of another", 2: "of another", 3: "no start"}


def test_a_value_that_fails_has_its_line_too(case: Path, tmp_path: Path, capsys) -> None:
    words = ["--only", "mode", "--over", "mode.petsc='','-nonsense 1'", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, *words) == 2
    assert 'petsc = "-nonsense 1": failed: no solver reads the PETSc option -nonsense' in capsys.readouterr().out


def test_of_many_values_that_stopped_the_first_are_named(case: Path, tmp_path: Path, capsys) -> None:
    count = NAMED + 2
    words = ["--set", "mode.step.max_points=2", "--over", f"{LIMITS}1:{count}", "--only", "mode", "--no-plots"]
    assert call("sweep", case, *words, "--out", tmp_path / "run") == 3
    said = capsys.readouterr().err
    assert f"{count} of {count} values did not come to their end" in said
    assert said.count("largest number of points") == NAMED and "; and 2 more values" in said and ", ..." in said


def test_one_value_is_one_value(case: Path, tmp_path: Path, capsys) -> None:
    words = ["--over", f"{LIMITS}1.0", "--only", "mode", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, *words) == 0
    assert "sweep of mode, 1 value of contact.slider.friction_limit" in capsys.readouterr().out


@pytest.mark.parametrize("damping", [0.0, 1e-6, 0.05, -0.02])
def test_a_branch_without_slip_has_no_amplitude_of_its_damping(damping: float) -> None:
    """Rounding has a largest value too: it is no onset of damping, no peak and no lowest frequency."""
    random, n = np.random.default_rng(0), 200
    table = {"amplitude": np.geomspace(1.0, 10.0, n), "slip": np.zeros(n), "event": [""] * n, "newton": np.ones(n)}
    noise = [1 + 4e-16 * random.standard_normal(n) for _ in range(3)]
    noise[1][0] += 1e-11  # as of a first point that is solved less well than those after it
    table |= {"omega": noise[0], "omega0": noise[0], "frequency_hz": 100.0 * noise[1]}
    found = summarise("mode", {**table, "zeta": damping * noise[2] + 1e-17 * random.standard_normal(n)}, {})
    assert np.isnan([found[name] for name in OF_AMPLITUDE]).all()
    assert found["largest_zeta"] == pytest.approx(damping, rel=SOLVED, abs=1e-15)


@pytest.mark.parametrize("error", [2.6e-10, 1e-13])
def test_the_error_of_a_first_point_is_no_onset_of_damping(error: float) -> None:
    """Of a preloaded beam whose damping falls from first slip on: it had risen by 6e-12 behind the first point."""
    amplitude = np.linspace(1e-6, 1e-5, 5)
    zeta = 5.1664e-3 + np.array([0.0, 5.76e-12, 5.75e-12, -5.5e-6, -3.6e-6])
    table = {"amplitude": amplitude, "zeta": zeta, "zeta_error": np.array([error, 1e-13, 1e-13, 1e-4, 1e-4])}
    table |= {"slip": np.array([0.0, 0.0, 0.0, 0.01, 0.02]), "stick": np.array([1.0, 1.0, 1.0, 0.99, 0.98])}
    table |= {name: np.full(5, 1.4e4) for name in ("omega", "omega0", "frequency_hz")} | {"event": [""] * 5}
    assert np.isnan(summarise("mode", table, {})["onset_amplitude"]) == (error > 6e-12)


def test_of_a_driven_wheel_the_line_is_of_the_sector_that_moves_most() -> None:
    row = {"unit": "m", "largest_amplitude": 0.2, "frequency_of_largest_amplitude": 10.0}
    blade = {"largest_blade_amplitude": 0.9, "largest_blade_frequency_hz": 11.0}
    assert FORCED_LEVELS.words(row) == "largest 0.2 m at 10 Hz"
    assert FORCED_LEVELS.words({**row, **blade, "largest_blade": 14.0}) == "largest 0.9 m of sector 14 at 11 Hz"
    assert FORCED_LEVELS.words({**row, **blade, "largest_blade": np.nan}) == "largest 0.2 m at 10 Hz"


def test_a_sweep_from_slip_to_stick(case: Path, tmp_path: Path, capsys) -> None:
    words = ["--over", f"{LIMITS}0.5,100.0", "--only", "mode", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, *words) == 0
    slips, sticks = rows(tmp_path / "run" / "summary.csv")
    assert 0.5 < float(slips["onset_amplitude"]) < float(slips["amplitude_of_largest_zeta"]) < 3.0
    assert [sticks[name] for name in OF_AMPLITUDE] == ["nan"] * len(OF_AMPLITUDE)
    assert "friction_limit = 100.0 N: slip from 100 m, zeta 0 % throughout" in capsys.readouterr().out


def test_a_sweep_of_branches_that_have_no_such_amplitude_has_its_picture(case: Path, tmp_path: Path, capsys) -> None:
    words = [
        "--over",
        "model.mass_damping=0.0,0.1",
        "--set",
        f"{LIMITS}0.0",
        "--only",
        "mode",
        "--out",
        tmp_path / "run",
    ]
    assert call("sweep", case, *words) == 0
    assert "no picture" not in capsys.readouterr().out
    assert (tmp_path / "run" / "mode_summary.png").exists()


@pytest.mark.parametrize("values", ["true,false", "false,true"])
def test_values_whose_tables_have_other_columns_keep_all_of_theirs(tmp_path: Path, values: str) -> None:
    """A wheel's branches beside those of one of its sectors: which comes first decides nothing."""
    wheel = TEXT[: TEXT.index("[[analysis]]")] + MODAL.replace("{ mode = 1 }", '"disk"').replace("60.0", "0.2")
    (tmp_path / "case.toml").write_text(wheel + "nodal_diameter = 2\n")
    words = ["--over", f"modal.wheel={values}", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", tmp_path / "case.toml", *words) == 0
    with open_results(tmp_path / "run" / "results.h5") as file:
        points, numbers = file["modal/points"], file["modal/points/value"][()]
        for number, wheel in enumerate(values.split(",")):
            mine = file[f"modal/values/{number:04d}/points"]
            assert ("participation" in mine) == (wheel == "true")
            for name in (points.keys() | mine.keys()) - {"value", "modal.wheel"}:
                here = points[name][()][numbers == number]
                nothing = np.full(len(here), np.nan if here.dtype.kind == "f" else -1)
                expected = mine[name][()] if name in mine else nothing
                assert np.array_equal(here, expected, equal_nan=here.dtype.kind == "f")


def test_a_level_that_stopped_leaves_the_others_in_the_quantiles(tmp_path: Path, capsys) -> None:
    """Below 4/pi times its limit a slider bounds a response at resonance: draws of low limits stop at level 2 alone."""
    text = CASE[: CASE.index("[[analysis]]")].replace("[model]", "[uncertainty]\nvalues.LIMIT = DRAWN\n[model]")
    spread = '{ distribution = "uniform", low = 0.5, high = 3.5 }'
    forced = "harmonics = 1\nsamples = 128\nforce = { x = 1.0 }\nlevels = [0.5, 2.0]\nfrequency = [0.14, 0.24]\n"
    forced = f'[[analysis]]\nname = "forced"\ntype = "forced"\n{forced}observe = "x"\n'
    text = text.replace("LIMIT", LIMITS.rstrip("=")).replace("DRAWN", spread) + forced
    (tmp_path / "case.toml").write_text(text)
    words = ["--over", "uncertainty.seed=1:8", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", tmp_path / "case.toml", *words) == 3
    found = rows(tmp_path / "run" / "summary.csv")
    limits = {row["uncertainty.seed"]: float(row[LIMITS.rstrip("=")]) for row in found}
    bounded = {seed for seed, limit in limits.items() if 4 / np.pi * limit > 2.0}
    assert 0 < len(bounded) < len(limits)
    assert {row["uncertainty.seed"] for row in found if (row["level"], row["done"]) == ("2.0", "1")} == bounded
    assert all(row["done"] == "1" for row in found if row["level"] == "0.5")
    table = rows(tmp_path / "run" / "forced_quantiles.csv")
    counts = {(row["level"], row["n"]) for row in table if row["quantity"] == "largest_amplitude"}
    assert counts == {("0.5", "8"), ("2.0", str(len(bounded)))}
    said = [f"seed = {seed} (level 2)" for seed in limits if seed not in bounded]
    assert f"{len(said)} of 8 values: {'; '.join(said)}" in capsys.readouterr().out


def test_a_response_that_moves_most_at_an_end_of_the_range_is_told_to_have_no_peak(tmp_path: Path, capsys) -> None:
    """A stuck slider on m = k = 1: stuck frequencies of kt = 1 and 3 are 0.2251 and 0.3183 Hz, the range holds one."""
    forced = '[[analysis]]\nname = "forced"\ntype = "forced"\nharmonics = 1\nsamples = 64\nforce = { x = 1e-3 }\n'
    forced += 'levels = [0.5, 1.0]\nfrequency = [0.2, 0.25]\nobserve = "x"\n'
    damped = CASE.replace("K = [[1.0]]", "K = [[1.0]]\nmass_damping = 0.05")
    drawn = '[uncertainty]\nfactors.model.mass_damping = { distribution = "uniform", low = 0.9, high = 1.1 }\n'
    case, over = tmp_path / "case.toml", ["--over", "contact.slider.tangential_stiffness=1.0,3.0"]
    case.write_text(drawn + damped + forced)
    for name, seeds, said in (("plain", [], "2 of 4"), ("drawn", ["--over", "uncertainty.seed=1:3"], "6 of 12")):
        run = tmp_path / name
        assert call("sweep", case, *over, *seeds, "--only", "forced", "--no-plots", "--out", run) == 0
        told = f"forced: {said} responses move most at an end of the frequency range (peak_within = 0)"
        assert told in capsys.readouterr().out
        table = [(row["contact.slider.tangential_stiffness"], row["peak_within"]) for row in rows(run / "summary.csv")]
        assert set(table) == {("1.0", "1"), ("3.0", "0")}
        assert call("show", run) == 0
        assert told in capsys.readouterr().out
    stiff = ["--set", "contact.slider.tangential_stiffness=3.0", "--only", "forced", "--no-plots", "-q"]
    assert call("run", case, *stiff, "--out", tmp_path / "one") == 0
    assert call("show", tmp_path / "one") == 0
    assert "0.25 Hz (at an end of the range: the peak is beyond)" in capsys.readouterr().out
