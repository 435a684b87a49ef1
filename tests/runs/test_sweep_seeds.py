"""Sweeps over seeds: draws in the summary, quantiles against a law in closed form, the blade that moves most."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models.csv_columns import column, rows
from models.swept_case import CASE
from scipy.stats import kstest, lognorm
from test_engine_order import SECTORS, TEXT
from tolerances import SOLVED

from fretwave.columns import Column
from fretwave.plots.quantiles import figures
from fretwave.post.grid import Plan
from fretwave.post.quantiles import interval_ranks
from fretwave.results.reader import Run
from fretwave.results.sweep_quantiles import quantile_lines, quantile_rows
from fretwave.results.sweeps import write_sweep

pytestmark = pytest.mark.ranks(1)

COUNT = 80
MEAN, DEVIATION = 1.5, 0.6
DRAWN = "contact.slider.tangential_stiffness"
UNCERTAIN = f"""
[uncertainty]
values.{DRAWN} = {{ distribution = "lognormal", mean = {MEAN}, standard_deviation = {DEVIATION} }}
"""


def stuck_law(q: float) -> float:
    """Quantile of the stuck frequency of m = k = 1 with a lognormal stiffness beside k."""
    sigma = np.sqrt(np.log(1 + (DEVIATION / MEAN) ** 2))
    kt = lognorm.ppf(q, sigma, scale=MEAN * np.exp(-(sigma**2) / 2))
    return float(np.sqrt(1 + kt) / (2 * np.pi))


@pytest.fixture(scope="module")
def swept(tmp_path_factory) -> Path:
    """80 oscillators whose slider sticks: linear, of drawn stiffness."""
    folder = tmp_path_factory.mktemp("seeds")
    text = CASE.replace("amplitude = [0.05, 60.0]", "amplitude = [0.05, 0.2]\nreport_at = [0.1]")
    text = text.replace("maximum = 0.1", "initial = 0.5, maximum = 0.7")
    (folder / "case.toml").write_text(UNCERTAIN + text)
    words = ["--over", f"uncertainty.seed=1:{COUNT}", "--only", "mode", "--out", folder / "run"]
    assert call("sweep", folder / "case.toml", *words) == 0
    return folder / "run"


def test_each_draw_is_in_the_summary_and_gives_its_frequency(swept: Path) -> None:
    found = {key: column(swept / "summary.csv", key) for key in ("stuck_hz", DRAWN, "frequency_hz_at_1")}
    expected = np.sqrt(1 + found[DRAWN]) / (2 * np.pi)
    assert len(expected) == COUNT == len(set(found[DRAWN]))
    assert found["stuck_hz"] == pytest.approx(expected, rel=SOLVED)
    assert found["frequency_hz_at_1"] == pytest.approx(expected, rel=SOLVED)
    record = json.loads((swept / "values" / "0003" / "run.json").read_text())
    assert record["case"]["resolved"][DRAWN] == found[DRAWN][3]
    with h5py.File(swept / "results.h5") as file:
        assert np.array_equal(file["mode/summary"][DRAWN][()], found[DRAWN])


def test_frequencies_follow_the_law_of_the_stiffness(swept: Path) -> None:
    """The law in closed form; quantiles are order statistics of these very draws, and hold the law's quantile."""
    f = np.sort(column(swept / "summary.csv", "stuck_hz"))
    grid = np.linspace(0.001, 0.999, 999)
    law = lambda x: np.interp(x, [stuck_law(q) for q in grid], grid)  # noqa: E731
    assert kstest(f, law).pvalue > 1e-2
    table = [row for row in rows(swept / "mode_quantiles.csv") if row["quantity"] == "stuck_hz"]
    assert [float(row["q"]) for row in table] == [0.05, 0.5, 0.95]
    for row in table:
        low, high = interval_ranks(COUNT, float(row["q"]))
        assert (float(row["low"]), float(row["high"])) == (f[low - 1], f[high - 1])
        assert float(row["low"]) <= float(row["value"]) <= float(row["high"])
        assert float(row["low"]) <= stuck_law(float(row["q"])) <= float(row["high"])
        assert (row["unit"], row["n"], row["left_out"], row["left_out_values"]) == ("Hz", str(COUNT), "0", "")


def test_the_picture_shows_every_draw(swept: Path) -> None:
    (figure,) = [figure for _, figure in figures(Run(swept))]
    assert [axes.get_xlabel() for axes in figure.axes] == [
        "Frequency at the end of the branch [Hz]",
        "Frequency at 0.1 m [Hz]",
    ]
    x, share = figure.axes[1].lines[0].get_xydata().T
    assert np.array_equal(x, np.sort(column(swept / "summary.csv", "frequency_hz_at_1")))
    assert share == pytest.approx(np.arange(1, COUNT + 1) / COUNT)


def test_pictures_and_words(swept: Path, capsys) -> None:
    assert {path.name for path in swept.glob("*.png")} == {"mode_backbones.png", "mode_quantiles.png"}
    assert call("show", swept) == 0
    shown = capsys.readouterr().out
    median = next(
        row for row in rows(swept / "mode_quantiles.csv") if (row["quantity"], row["q"]) == ("frequency_hz_at_1", "0.5")
    )
    assert "mode, at amplitude 0.1: frequency_hz_at_1: 5 % " in shown
    assert f"50 % {float(median['value']):.5g} [{float(median['low']):.5g}, {float(median['high']):.5g}] Hz" in shown
    assert "95 % confidence intervals" in shown and "slip from" not in shown


def test_damping_that_is_rounding_is_told_as_none() -> None:
    """Of draws that all stick; the table keeps the numbers."""
    plan = Plan({"model.seed": [1, 2, 3, 4, 5, 6]})
    rows = [{"model.seed": k + 1, "value": k, "done": 1, "zeta_at_1": 1e-31 * (k - 3)} for k in range(6)]
    told = quantile_lines("mode", plan, rows, [Column("zeta_at_1", "1", "damping")], "")
    assert told[0] == "mode: zeta_at_1: 50 % 0 [0, 0] (n = 6)"
    few = quantile_lines("mode", Plan({"model.seed": [1, 2, 3]}), rows[:3], [Column("zeta_at_1", "1", "damping")], "")
    assert few[0] == "mode: zeta_at_1: 50 % 0 [unknown, unknown] (n = 3)"


def test_failed_values_are_left_out_and_named_and_other_keys_stay_apart(tmp_path: Path, capsys) -> None:
    """A branch that may have two points only stops early: with one of two values of the key all draws do."""
    (tmp_path / "case.toml").write_text(UNCERTAIN + CASE)
    words = ["--over", "uncertainty.seed=1:8", "--over", "mode.step.max_points=2,900", "--only", "mode", "--no-plots"]
    assert call("sweep", tmp_path / "case.toml", *words, "--out", tmp_path / "run") == 3
    said = "left out, for they failed or stopped early: 8 of 16 values: seed = 1, max_points = 2; seed = 2, "
    assert said in capsys.readouterr().out
    table = rows(tmp_path / "run" / "mode_quantiles.csv")
    assert {row["mode.step.max_points"] for row in table} == {"900"}
    assert {(row["n"], row["q"]) for row in table if row["quantity"] == "largest_zeta"} == {("8", "0.5")}
    done = column(tmp_path / "run" / "summary.csv", "done")
    assert list(done) == [0, 1] * 8
    assert call("show", tmp_path / "run") == 0
    assert said in capsys.readouterr().out


def test_what_lies_beyond_a_branch_has_no_quantile(tmp_path: Path) -> None:
    """Slip begins at the drawn limit over kt = 1. Draws that slip throughout or not at all lack it: the others' median
    was 1.13 with an interval from 0.97 to 1.29, that of all 30 is 0.95."""
    factor = (
        'factors.contact.slider.friction_limit = {{ distribution = "lognormal", mean = {}, standard_deviation = {} }}'
    )
    case, summary, known = tmp_path / "case.toml", tmp_path / "run" / "summary.csv", []
    for given in ((1.0, 0.5), (1.1, 0.02)):
        drawn = "[uncertainty]\n" + factor.format(*given)
        case.write_text(drawn + CASE.replace("[0.05, 60.0]", "[0.9, 1.4]").replace("samples = 512", "samples = 64"))
        words = ["--over", "uncertainty.seed=1:6", "--only", "mode", "--no-plots", "--out", tmp_path / "run"]
        assert call("sweep", case, *words) == 0
        known.append({row["quantity"] for row in rows(tmp_path / "run" / "mode_quantiles.csv")})
    slip = {"slip_threshold", "stick_until", "slip_from"}
    assert "largest_zeta" in known[0] and not slip & known[0]
    assert slip <= known[1]
    limit = column(summary, "factors.contact.slider.friction_limit")
    assert column(summary, "slip_threshold") == pytest.approx(limit, rel=2 * (np.pi / 64) ** 2)


def test_draws_at_other_amplitudes_say_theirs(tmp_path: Path, capsys) -> None:
    """Of two values of report_at each has its own; the picture, which has both, says from where to where."""
    (tmp_path / "case.toml").write_text(UNCERTAIN + CASE.replace("60.0", "0.4"))
    over = ["--over", "uncertainty.seed=1:6", "--over", "mode.report_at=[0.1],[0.3]"]
    words = [*over, "--only", "mode", "--set", "mode.amplitude=[0.05, 0.4]", "--no-plots"]
    assert call("sweep", tmp_path / "case.toml", *words, "--out", tmp_path / "run") == 0
    said = capsys.readouterr().out
    for at in ("0.1", "0.3"):
        assert f"report at = [{at}], at amplitude {at}: zeta_at_1" in said
    (figure,) = dict(figures(Run(tmp_path / "run"))).values()
    assert any("at 0.1 to 0.3 m" in axes.get_xlabel() for axes in figure.axes)


@pytest.mark.parametrize("groups", [2, 12])
def test_a_sweep_s_values_are_gone_through_as_often_whatever_their_number(groups: int, monkeypatch) -> None:
    """And each line is of its own draws: the medians and amplitudes are those of each group and wave by hand."""
    plan, gone, values = Plan({"model.friction": [*range(groups)], "model.seed": [*range(5)]}), [], Plan.values
    monkeypatch.setattr(Plan, "values", lambda self: gone.append(1) or values(self))
    random, waves = np.random.default_rng(0), (1, 2)
    rows = [
        {"value": n, "nodal_diameter": wave, "zeta_at_1": random.random(), "amplitude_at_1": n // 5 + wave / 10}
        for n in range(len(plan))
        for wave in waves
    ]
    lines = quantile_lines("flutter", plan, rows, [Column("zeta_at_1", "1", "damping")], "nodal_diameter")
    assert len(gone) < 6
    for group, wave in product(range(groups), waves):
        zeta = [row["zeta_at_1"] for row in rows if row["value"] // 5 == group and row["nodal_diameter"] == wave]
        place = f"flutter, friction = {group}, nodal diameter = {wave}, at amplitude {group + wave / 10:g}: zeta_at_1: "
        (line,) = [line for line in lines if line.startswith(place)]
        assert f"50 % {np.median(zeta):.5g} [" in line and line.endswith("(n = 5)")


def test_draws_of_seeds_that_are_crossed_have_no_intervals(swept: Path, monkeypatch) -> None:
    """Of 3 x 4 values 3 or 4 are independent: as those of 12 draws their intervals were too narrow."""
    plan, zeta = (
        Plan({"uncertainty.seed": [1, 2, 3], "mode.mistuning.seed": [1, 2, 3, 4]}),
        Column("zeta_at_1", "1", ""),
    )
    table = [{"value": k, "done": 1, "zeta_at_1": 0.01 * (k // 4 + 1)} for k in range(12)]
    (row,) = quantile_rows(plan, table, [zeta], "")
    assert (row["value"], row["n"]) == (pytest.approx(0.02), 12)
    assert np.isnan([row["low"], row["high"]]).all()
    told = quantile_lines("mode", plan, table, [zeta], "")
    assert told[0] == "mode: zeta_at_1: 50 % 0.02 [unknown, unknown] (n = 12)"
    assert "uncertainty.seed and mode.mistuning.seed are crossed" in told[-1]
    one_wheel = Plan({**plan.over, "uncertainty.seed": [*range(12)], "mode.mistuning.seed": [1]})
    assert np.isfinite(quantile_rows(one_wheel, table, [zeta], "")[0]["low"])
    for known in (False, True):
        monkeypatch.setattr("fretwave.plots.quantiles.crossed", lambda plan, known=known: known)
        (figure,) = [figure for _, figure in figures(Run(swept))]
        assert bool(figure.axes[0].collections) != known


# A wheel


@pytest.fixture(scope="module")
def wheels(tmp_path_factory) -> Path:
    """Six wheels of the small bladed disk, mistuned by the seed of [uncertainty], driven by an engine order."""
    folder = tmp_path_factory.mktemp("wheels")
    text = TEXT.replace("engine_order = 8", "engine_order = 8\nwheel = true\nmistuning = { standard_deviation = 0.05 }")
    factor = 'factors.contact.rub.friction_limit = { distribution = "normal", mean = 1.0, standard_deviation = 0.05 }'
    text += f"\n[uncertainty]\n{factor}\n"
    (folder / "case.toml").write_text(text.replace("harmonics = 3", "harmonics = 1"))
    assert call("sweep", folder / "case.toml", "--over", "uncertainty.seed=1:6", "--out", folder / "run") == 0
    return folder / "run"


def test_the_largest_blade_is_the_largest_of_all_sectors(wheels: Path) -> None:
    found = rows(wheels / "summary.csv")
    for number, row in enumerate(found):
        blades = rows(wheels / "values" / f"{number:04d}" / "forced_blades.csv")
        amplitude = np.array([float(blade["amplitude"]) for blade in blades])
        assert len(amplitude) == SECTORS
        assert float(row["largest_blade_amplitude"]) == np.nanmax(amplitude)
        assert int(float(row["largest_blade"])) == int(np.nanargmax(amplitude))
    largest, observed = (column(wheels / "summary.csv", f"largest_{name}amplitude") for name in ("blade_", ""))
    assert np.median(largest / observed) > 1.02, "sector 0 is one of six"
    table = rows(wheels / "forced_quantiles.csv")
    median = next(row for row in table if row["quantity"] == "largest_blade_amplitude")
    assert float(median["value"]) == pytest.approx(np.median(largest))
    assert (float(median["low"]), float(median["high"])) == (largest.min(), largest.max())


def test_the_seed_decides_the_wheel(wheels: Path) -> None:
    for number in (0, 5):
        resolved = json.loads((wheels / "values" / f"{number:04d}" / "run.json").read_text())["case"]["resolved"]
        assert resolved["forced.mistuning"]["seed"] == number + 1 == resolved["uncertainty.seed"]


def test_one_seed_alone_is_told_as_any_value(tmp_path: Path, capsys) -> None:
    """Its table of quantiles was an empty file, left where an earlier sweep had some, and nothing was told."""
    text = CASE.replace("amplitude = [0.05, 60.0]", "amplitude = [0.05, 0.2]")
    (tmp_path / "case.toml").write_text(UNCERTAIN + text)
    words = ["--only", "mode", "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", tmp_path / "case.toml", "--over", "uncertainty.seed=1", *words) == 0
    assert not list((tmp_path / "run").glob("*quantiles*"))
    assert "mode: seed = 1: " in capsys.readouterr().out
    assert len(rows(tmp_path / "run" / "summary.csv")) == 1


def test_no_table_where_too_few_came_to_their_end(tmp_path: Path) -> None:
    path = tmp_path / "mode_quantiles.csv"
    path.write_text("of an earlier sweep\n")
    write_sweep(tmp_path, "mode", "mode", Plan({"uncertainty.seed": [1, 2]}), [], {})
    assert not path.exists()
