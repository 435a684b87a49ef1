"""What a picture says of its own curves: computed points, errors, and where and why a branch stopped short."""

from __future__ import annotations

import json

import numpy as np
import pytest
from models.table_rows import SHARED
from tolerances import ROUNDING

from fretwave.columns import FLUTTER, FORCED, MODE
from fretwave.plots import backbone, flutter, forced, gauges, marks, style, sweeps
from fretwave.post.grid import Plan
from fretwave.results.reader import Run
from fretwave.results.results import AnalysisWriter
from fretwave.results.sweeps import read_branch, write_sweep

pytestmark = pytest.mark.ranks(1)

AMPLITUDE = np.geomspace(1e-5, 4e-4, 9)


def write_mode(folder, status="done", reason="stop value reached", error=None):
    """Of nine points; the error of zeta grows to the one given."""
    writer = AnalysisWriter(
        folder, "mode", MODE, {"type": "mode", "method": "CNM", "normalise": "tip"}, ["tip"], ["1c"]
    )
    for point, a in enumerate(AMPLITUDE):
        row = {"point": point, "amplitude": a, "omega": 6.0, "omega0": 6.0, "frequency_hz": 1.0 - 0.01 * point}
        row |= {**SHARED, "beta": 0.0, "zeta": 0.01 * point, "wall_s": 0.0, "event": ""}
        row |= {} if error is None else {"zeta_error": error * point / 8, "omega_error": 0.0 * error}
        writer.append(row, np.zeros((1, 1)))
    writer.close(status, reason)
    return Run(folder)["mode"]


def write_forced(folder, reason, **attributes):
    """Level 1 over seven frequencies, level 2 over the first four of them."""
    writer = AnalysisWriter(
        folder, "forced", FORCED, {"type": "forced", "observe": "tip", **attributes}, ["tip"], ["1c"]
    )
    for level, count in ((1.0, 7), (2.0, 4)):
        for point, hertz in enumerate(np.linspace(1.0, 2.0, 7)[:count]):
            row = {"point": point, "level": level, "omega": 6.3 * hertz, "frequency_hz": hertz}
            row |= {**SHARED, "amplitude": level * hertz, "phase": 0.0, "wall_s": 0.0, "event": ""}
            writer.append({**row, "amplitude_error": 0.05 * level}, np.zeros((1, 1)))
    writer.close("stopped", reason)
    return Run(folder)["forced"]


def marked(axes, marker):
    """Data (n, 2) of the lines with a marker, one under the other, without entries of the legend."""
    lines = [line for line in axes.get_lines() if line.get_marker() == marker and len(line.get_xdata())]
    return np.concatenate([np.empty((0, 2)), *(line.get_xydata() for line in lines)])


def entries(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_every_computed_point_has_its_mark(tmp_path):
    figure = backbone.draw([write_mode(tmp_path)])
    upper, lower = figure.axes
    np.testing.assert_allclose(marked(upper, "o"), np.column_stack([1e6 * AMPLITUDE, 1.0 - 0.01 * np.arange(9)]))
    np.testing.assert_allclose(marked(lower, "o")[:, 1], np.arange(9.0), atol=ROUNDING)
    assert entries(figure).count("computed points") == 1


def test_a_branch_that_came_to_its_end_has_no_mark_of_a_stop(tmp_path):
    figure = backbone.draw([write_mode(tmp_path)])
    assert len(marked(figure.axes[0], "X")) == 0 and not any("stopped" in entry for entry in entries(figure))


def test_a_branch_that_stopped_short_is_marked_with_its_reason(tmp_path):
    mode = write_mode(tmp_path, "stopped", "the step fell below its smallest")
    figure = backbone.draw([mode])
    for axes, last in zip(figure.axes, (0.92, 8.0)):
        np.testing.assert_allclose(marked(axes, "X"), [[1e6 * AMPLITUDE[-1], last]])
    assert entries(figure).count("stopped short: the step fell below its smallest") == 1


def test_an_unfinished_branch_says_so(tmp_path):
    mode = write_mode(tmp_path)
    mode.attributes["status"] = "running"
    assert marks.UNFINISHED in entries(backbone.draw([mode]))


def test_the_error_is_told_in_the_unit_of_its_axis(tmp_path):
    figure = backbone.draw([write_mode(tmp_path, error=0.004)])
    assert "estimated error, at most 0 Hz and 0.4 %" in entries(figure)
    assert len(figure.axes[1].collections) == 1


def test_an_error_that_is_not_known_is_called_so(tmp_path):
    mode = write_mode(tmp_path, error=np.nan)
    figure = backbone.draw([mode])
    assert "error not estimated" in entries(figure) and not any("at most" in entry for entry in entries(figure))
    assert len(figure.axes[1].collections) == 0


def test_each_level_has_its_own_reason_and_place(tmp_path):
    found = write_forced(tmp_path, "level 2: no step is short enough; 3 pairs slip")
    figure = forced.draw(found, [], None)
    left, right = figure.axes
    np.testing.assert_allclose(marked(left, "X"), [[1.5, 3.0]])
    assert entries(figure).count("level 2 stopped short: no step is short enough; 3 pairs slip") == 1
    assert len(marked(left, "o")) == len(marked(right, "o")) == 11
    assert "estimated error, at most 0.1 m" in entries(figure)


def test_a_level_without_a_point_is_named_without_a_mark(tmp_path):
    found = write_forced(tmp_path, "level 4: no first point", levels=json.dumps([1.0, 2.0, 4.0]))
    figure = forced.draw(found, [], None)
    assert "level 4 stopped short: no first point" in entries(figure) and len(marked(figure.axes[0], "X")) == 0


def test_each_wave_has_its_own_reason(tmp_path):
    writer = AnalysisWriter(tmp_path, "flutter", FLUTTER, {"type": "flutter", "normalise": "tip", "events": "[]"})
    for diameter in (-1, 2):
        for point, a in enumerate(AMPLITUDE):
            row = {"point": point, "nodal_diameter": diameter, "amplitude": a, "omega": 6.0, "omega0": 6.0, **SHARED}
            writer.append({**row, "frequency_hz": 1.0, "beta": 0.0, "zeta": 0.01, "wall_s": 0.0, "event": ""})
    writer.close("stopped", "nodal diameter -1: too many points")
    figure = flutter.damping(Run(tmp_path)["flutter"])
    np.testing.assert_allclose(marked(figure.axes[0], "X"), [[1e6 * AMPLITUDE[-1], 1.0]])
    assert "nodal diameter -1 stopped short: too many points" in entries(figure)


def test_many_reasons_are_counted_and_long_ones_cut(tmp_path):
    mode = write_mode(tmp_path, "stopped", "; ".join(f"mu = {k}: " + "very " * 80 for k in range(6)))
    reasons = marks.why_stopped(mode, [f"mu = {k}" for k in range(6)])
    assert list(reasons) == [f"mu = {k}" for k in range(6)] and "; mu" not in reasons["mu = 0"]
    figure, axes = style.new_figure(3.0)
    marks.stops(axes, {name: (float(k), 1.0) for k, name in enumerate(reasons)}, reasons)
    style.legend_outside(figure, axes)
    assert len(entries(figure)) == marks.REASONS + 1 and entries(figure)[-1] == "and 3 more that stopped"
    assert max(map(len, entries(figure))) <= marks.LETTERS + 4 and len(marked(axes, "X")) == 6


def test_names_stand_once_in_a_legend_inside_the_axes(tmp_path):
    mode = write_mode(tmp_path)
    rows = ["point,level,amplitude,frequency_hz,stress_amplitude,mean_stress,goodman"]
    rows += [f"{k},{level},{a},1,{1e6 * a},5,{0.1 * k}" for level in (1, 2) for k, a in enumerate(AMPLITUDE)]
    (tmp_path / "mode_gauges.csv").write_text("\n".join(rows))
    figure = gauges.draw(mode, Run(tmp_path).table("mode_gauges"))
    for axes in figure.axes:
        names = [text.get_text() for text in axes.get_legend().get_texts()]
        assert len(names) == len(set(names)) > 0


def test_a_legend_is_never_wider_than_its_picture():
    figure, axes = style.new_figure(3.0)
    for number in range(6):
        axes.plot([0, 1], [0, 1], label=f"{number} is the number of a curve with a name of many words")
    style.legend_outside(figure, axes, columns=5)
    assert figure.legends[0].get_window_extent(figure.canvas.get_renderer()).width <= figure.bbox.width


def test_a_sweep_marks_the_value_that_stopped_and_names_it(tmp_path, comm):
    """Of two responses the second came to half of its range; both have errors and points."""
    parts = []
    for number, (status, count) in enumerate((("done", 9), ("stopped", 5))):
        folder = tmp_path / str(number)
        folder.mkdir()
        told = {"type": "forced", "observe": "tip", "run_id": "one"}
        writer = AnalysisWriter(folder, "forced", FORCED, told, ["tip"], ["1c"])
        for point, hertz in enumerate(np.linspace(1.0, 2.0, 9)[:count]):
            row = {"point": point, "level": 1.0, "omega": 2 * np.pi * hertz, "frequency_hz": hertz, "phase": 0.0}
            row |= {**SHARED, "amplitude": 1.0 + number, "amplitude_error": 0.25, "wall_s": 0.0, "event": ""}
            writer.append(row, np.zeros((1, 1)))
        writer.close(status, "level 1: folds without end")
        parts.append(read_branch(folder, "forced", number, "one"))
    plan = Plan({"load.scale": (3, 4)})
    ending = {"status": "stopped", "reason": "scale = 4: level 1: folds without end", "run_id": "one"}
    write_sweep(tmp_path, "sweep", "forced", plan, parts, ending)
    figure = dict(sweeps.figures(Run(tmp_path)))["sweep_responses"]
    np.testing.assert_allclose(marked(figure.axes[0], "X"), [[1.5, 2.0]])
    assert len(marked(figure.axes[0], "o")) == 14 and len(figure.axes[0].collections) == 2
    assert "scale = 4 stopped short: level 1: folds without end" in entries(figure)
    assert "estimated error, at most 0.25 m" in entries(figure)
