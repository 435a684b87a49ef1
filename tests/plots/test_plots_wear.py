"""Pictures of wear: what they show is what the tables say, and the kinds of pairs follow their stated rule."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from command_line import call
from models.wear_case import write_case
from tolerances import ROUNDING

from fretwave.plots import plot_run, wear, wear_lines, wear_pairs
from fretwave.results.reader import Run

pytestmark = pytest.mark.ranks(1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    base = tmp_path_factory.mktemp("wear")
    assert call("run", write_case(base), "--only", "wear,one", "--out", base / "run", "--no-plots") == 0
    return base / "run"


@pytest.fixture(scope="module")
def run(folder):
    return Run(folder)


def table(folder, name):
    with (folder / f"{name}.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def title_of(axes):
    return axes.get_title(loc="left") or axes.get_title()


def test_every_picture_is_written(folder):
    names = {path.name for path in plot_run(folder)}
    assert names == {
        f"{name}_{word}.png" for name in ("wear", "one") for word in ("modal", "volume", "pairs_pads", "profile_pads")
    }
    assert all((folder / name).stat().st_size > 5000 for name in names)
    assert {path.name for path in plot_run(folder, ["one"])} == {name for name in names if name.startswith("one")}


def test_the_map_is_cut_where_its_legend_says(folder, run):
    """Curves over the amplitude hold the table's values at the first and last cycle; a line without wear goes on."""
    rows = table(folder, "wear")
    lines = wear_lines.lines_of(run.analyses["wear"])
    figure = wear.draw_modal_map(run.analyses["wear"], lines)
    cuts = next(axes for axes in figure.axes if title_of(axes) == "Damping ratio [%]" and axes.lines)
    assert [line.get_label() for line in cuts.lines] == ["0", "0.5", "1", "2", "4", "8"]
    for curve, cycle in ((cuts.lines[0], 0.0), (cuts.lines[3], 2.0), (cuts.lines[-1], 8.0)):
        met = np.isclose(rows["cycles"].astype(float), cycle)
        expected = [100 * float(rows["zeta"][met & (rows["line"] == number)][0]) for number in ("1", "2")]
        assert curve.get_ydata()[1:] == pytest.approx(expected, rel=ROUNDING)
        assert curve.get_ydata()[0] == pytest.approx(100 * float(rows["zeta"][rows["line"] == "0"][0]), rel=ROUNDING)
    assert cuts.lines[0].get_xdata() == pytest.approx([1.0, 2.0, 3.0])
    assert figure.axes[0].get_ylabel() == "Modal amplitude of tip [µm]"


def test_volumes_of_wide_range_are_logarithmic():
    linear, norm = wear.volume_levels(np.array([[0.0, 0.1], [0.0, 2.0]]))
    assert norm is None and linear[0] == 0.0 and linear[-1] >= 2.0
    levels, norm = wear.volume_levels(np.array([[0.0, 0.0], [0.0, 0.019], [0.0, 22.3]]))
    assert norm is not None and levels == pytest.approx([d * 10.0**k for k in range(-2, 2) for d in (1, 2, 5)])


def test_volumes_of_faces_are_depth_times_area(run):
    analysis = run.analyses["one"]
    figure = wear.draw_volume(analysis, wear_lines.lines_of(analysis))
    upper, lower = figure.axes
    depth = analysis.field("depth_pads")[-1]
    assert upper.lines[0].get_label() == "pads"
    assert upper.lines[0].get_ydata()[-1] == pytest.approx(1e9 * 2e-4 * depth.sum())
    edges = lower.patches[0].get_data()
    assert np.sum(edges.values * np.diff(edges.edges)) == pytest.approx(1e9 * 2e-4 * depth.sum())


def test_the_summary_says_cycles_and_volume(folder, run, capfd):
    assert call("show", folder) == 0
    line = next(text for text in capfd.readouterr().out.splitlines() if text.startswith("one"))
    columns = run.analyses["one"].columns
    assert "2.5e-06 m, 8 cycles" in line and f"worn {1e9 * columns['worn_1'][-1]:.3g} mm^3" in line


def test_histories_name_the_kinds_that_are_there_and_those_that_are_not(run):
    analysis = run.analyses["one"]
    (line,) = wear_lines.lines_of(analysis)
    figure = wear_pairs.draw_histories(analysis, line, "pads", analysis.pairs("pads"))
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["never wears (only pair 0)", "keeps wearing (only pair 1)"]
    title = title_of(figure.axes[0])
    assert title == "a = 2.5 µm, 2 pairs of pads; left out, for there is none: stops wearing, wears again"
    figure = wear_pairs.draw_profiles(line, "pads", analysis.pairs("pads"))
    profile = next(axes for axes in figure.axes if axes.get_ylabel() == "Worn depth [µm]" and axes.lines)
    assert profile.lines[0].get_xdata() == pytest.approx([0.0, 100.0])
    assert profile.lines[0].get_ydata() == pytest.approx(1e6 * analysis.field("depth_pads")[-1])


def test_histories_need_no_places(run):
    analysis = run.analyses["one"]
    figure = wear_pairs.draw_histories(analysis, wear_lines.lines_of(analysis)[0], "pads", None)
    assert [axes.get_ylabel() for axes in figure.axes] == ["Worn depth [µm]", "Mean normal force [N]"]


def test_kinds_follow_the_rate_of_a_pair():
    """Rates of known form: none, exponential decay to 1e-4 and to 0.1, growth that stops and comes back."""
    t = np.linspace(0.0, 1.0, 400)
    twice = np.exp(-((t - 0.2) ** 2) / 0.005) + 0.5 * np.exp(-((t - 0.7) ** 2) / 0.005)  # of areas 2 to 1
    slight = np.exp(-((t - 0.2) ** 2) / 0.005) + 0.2 * np.exp(-((t - 0.7) ** 2) / 0.005)
    late = np.exp(-((t - 0.6) ** 2) / 0.01)
    rate = np.stack([0 * t, np.exp(-9.2 * t), np.exp(-2.3 * t), twice, slight, late], axis=1)
    depth = np.vstack([np.zeros(6), np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t)[:, None], axis=0)])
    found = wear_lines.kinds(depth, rate)
    assert found == ["never wears", "stops wearing", "keeps wearing", "wears again", *(2 * ["stops wearing"])]
    shares = [wear_lines.second_spell(depth[:, k], rate[:, k]) for k in range(1, 6)]
    assert shares == pytest.approx([0, 0, 1 / 3, 1 / 6, 0], abs=2e-3)


def test_a_line_that_ended_early_while_wearing_is_blank_behind_its_end():
    line = wear_lines.WearLine(1.0, {"cycles": np.array([0.0, 1.0, 2.0])}, {}, {}, {})
    found = line.at(np.array([1.0, 2.0, 4.0]), np.array([0.5, 2.0, 2.5]))
    assert found[:2] == pytest.approx([1.5, 4.0]) and np.isnan(found[2])


def test_jumps_are_marked(run):
    analysis = run.analyses["one"]
    (line,) = wear_lines.lines_of(analysis)
    assert len(line.jumps) == 0
    figure = wear.draw_modal(analysis, [replace(line, jumps=np.array([3.0, 5.0]))])
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert names == ["a = 2.5 µm", wear.JUMP]
    lines = [replace(line, amplitude=a, jumps=np.full(k, 4.0)) for k, a in enumerate((1e-6, 2e-6, 3e-6))]
    figure = wear.draw_modal_map(analysis, lines)
    (title,) = figure.texts
    assert title.get_text().endswith(f"red marks: {wear.JUMP}")
    assert sum(len(mark.get_xdata()) for mark in figure.axes[0].lines) == 3


@pytest.mark.parametrize(
    ("value", "text"), [(1e-14, "10$^{-14}$"), (1.36e7, r"1.36 $\times$ 10$^{7}$"), (250.0, "250")]
)
def test_powers_are_written_as_such(value, text):
    assert wear_lines.power(value) == text
