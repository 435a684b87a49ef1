"""Names in pictures lie beside what they name, inside the axes, and on no other name."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from fretwave.plots import campbell, labels, safe, study, style, sweep_overview, swept
from fretwave.post.grid import Plan
from fretwave.results.reader import Run
from fretwave.results.results import AnalysisWriter

pytestmark = pytest.mark.ranks(1)


def boxes(axes):
    """Extents of all texts that say something, on the picture as it is saved."""
    axes.figure.draw_without_rendering()
    renderer = axes.figure.canvas.get_renderer()
    return [text.get_window_extent(renderer) for text in axes.texts if text.get_text()]


def covering(axes):
    return sum(one.overlaps(other) for one, other in combinations(boxes(axes), 2))


def inside(axes):
    ends = axes.get_window_extent()
    return all(ends.x0 <= b.x0 and b.x1 <= ends.x1 and ends.y0 <= b.y0 and b.y1 <= ends.y1 for b in boxes(axes))


def test_names_of_points_that_lie_close_do_not_cover_each_other():
    figure, axes = style.new_figure(3.0)
    points = [(0.5 + 0.01 * np.cos(k), 0.5 + 0.01 * np.sin(k)) for k in range(6)] + [(1.0, 1.0)]
    axes.plot(*np.transpose(points), "o-")
    axes.set(xlim=(0, 1), ylim=(0, 1))
    found = labels.beside(axes, [f"name {k}" for k in range(7)], points, 7 * [{"fontsize": 9}])
    assert [note.xy for note in found] == points
    assert covering(axes) == 0 and inside(axes)


def test_a_name_that_lies_far_off_is_led_to_its_point():
    figure, axes = style.new_figure(3.0)
    axes.plot([0.5] * 9, [0.5] * 9, "o")
    axes.set(xlim=(0, 1), ylim=(0, 1))
    labels.beside(axes, [f"a long name {k}" for k in range(12)], 12 * [(0.5, 0.5)], 12 * [{}])
    leaders = [text for text in axes.texts if not text.get_text()]
    far = [text for text in axes.texts if text.get_text() and np.hypot(*text.xyann) > 60]
    assert far and leaders and covering(axes) == 0


def test_a_line_is_named_where_no_curve_is():
    figure, axes = style.new_figure(3.0)
    axes.axhline(0.5)
    x = np.linspace(0.0, 1.0, 50)
    axes.plot(x, 0.5 - 0.5 * x**8)  # below the line at the right, along it at the left
    axes.plot(x, 0.5 + 0.5 * (1 - x) ** 8)
    axes.set(xlim=(0, 1), ylim=(0, 1))
    (note,) = labels.along(axes, [("the line's name", 0.5)])
    cover = labels.Cover(axes)
    cover.names.clear()
    here = cover.cost(note.get_window_extent(cover.renderer))
    assert here == 0.0 and inside(axes)


def test_a_study_names_every_setting_once_and_apart(tmp_path):
    """Run times and errors of the wear study, whose names covered each other."""
    rows = ["sweep,harmonics,tolerance,pressure_change,wall_s,omega_error,zeta_error,worn_error,reference"]
    told = (("tolerance", "5,{},0.4"), ("pressure_change", "5,1e-3,{}"))
    values = {"tolerance": (3e-2, 1e-2, 3e-3, 1e-3), "pressure_change": (1.6, 0.8, 0.4)}
    places = {"tolerance": (12.0, 11.0, 13.0, 14.0), "pressure_change": (8.0, 10.5, 21.0)}
    for sweep, text in told:
        for k, (value, wall) in enumerate(zip(values[sweep], places[sweep])):
            error = 1e-3 / (1 + 2 * k)
            rows.append(f"{sweep},{text.format(value)},{wall},{1e-3 * error},{error},{error / 2},0")
    (tmp_path / "study.csv").write_text("\n".join(rows))
    for axes in study.draw(Run(tmp_path).table("study")).axes:
        names = sorted(text.get_text() for text in axes.texts if text.get_text())
        assert names == sorted(["3e-2", "1e-2", "3e-3", "1e-3", "1.6", "0.8", "0.4"])
        assert covering(axes) == 0


def write_linear(folder):
    """Two modes in three waves of twelve sectors, met by engine orders close to the operating speed."""
    columns = ("contact", "nodal_diameter", "mode", "speed_rpm", "frequency_hz", "other_hz")
    from fretwave.columns import Column

    named = [Column(name, "1", name, "s" if name == "contact" else "f") for name in columns]
    told = {"type": "linear", "sectors": 12, "speed_rpm": 600.0, "engine_orders": "[2, 4, 8, 10]", "up_to_rpm": 800.0}
    writer = AnalysisWriter(folder, "linear", named, told)
    for diameter in (2, 4):
        for mode, hz in ((1, 19.5 * diameter / 2), (2, 21.0 * diameter / 2), (3, 85.0)):
            writer.append(dict(zip(columns, ("stuck", diameter, mode, 0.0, hz, 0.99 * hz))))
    writer.close("done", "")
    return Run(folder)


def test_margins_of_crossings_that_lie_close_are_apart_and_inside(tmp_path):
    run = write_linear(tmp_path)
    figure = campbell.draw(run, run["linear"])
    for axes in figure.axes:
        margins = [text for text in axes.texts if "%" in text.get_text()]
        assert len(margins) >= 2 and covering(axes) == 0
        ends, renderer = axes.get_window_extent(), figure.canvas.get_renderer()
        assert all(text.get_window_extent(renderer).x1 <= ends.x1 for text in margins)


def test_engine_orders_of_a_safe_diagram_stand_clear_of_its_frame(tmp_path):
    run = write_linear(tmp_path)
    (axes,) = safe.draw(run, run["linear"]).axes
    left = axes.get_window_extent().x0
    assert covering(axes) == 0 and min(box.x0 for box in boxes(axes)) > left


class Sweep:
    """A sweep of one key as its pictures see it, with one number for each value."""

    def __init__(self, values: list) -> None:
        self.plan, self.main, self.parts, self.split = Plan({"model.key": values}), 0, [], ""
        self.summary = {"frequency_of_largest_amplitude": np.linspace(10.0, 11.0, len(values))}


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        (["CNM", "EPMC"], ["CNM", "EPMC"]),
        (["", "-snes_max_it 1"], ['""', "-snes_max_it 1"]),
        (
            [[[640.0 + k, -40.0], [-40.0, 40.0]] for k in range(5)],
            [f"[[{640 + k}.0, -40.0], [-40..." for k in range(5)],
        ),
        ([True, False], ["true", "false"]),
    ],
)
def test_values_that_are_no_numbers_stand_side_by_side_below_a_sweep(values: list, shown: list[str]) -> None:
    figure = sweep_overview.overview(Sweep(values), sweep_overview.FORCED_PANELS[1:])
    figure.draw_without_rendering()
    found = figure.axes[0].get_xticklabels()
    assert [label.get_text() for label in found] == shown
    bottoms = [label.get_window_extent().get_points()[0] for label in found]
    assert all(np.diff([x for x, _ in bottoms]) > found[0].get_fontsize())
    if found[0].get_rotation() == 0.0:
        ends = [label.get_window_extent().get_points()[:, 0] for label in found]
        assert all(right < left for (_, right), (left, _) in zip(ends, ends[1:]))


def test_whole_numbers_have_whole_ticks_below_a_sweep() -> None:
    figure = sweep_overview.overview(Sweep([3, 4, 5]), sweep_overview.FORCED_PANELS[1:])
    ticks = figure.axes[0].get_xticks()
    assert {3, 4, 5} <= {*ticks} and (ticks == np.rint(ticks)).all()


def test_values_beside_a_colour_bar_have_six_digits() -> None:
    assert [swept.tick(value) for value in (28.480358684358, 3, 1e-9)] == ["28.4804", "3", "1e-09"]


def test_what_no_branch_of_a_sweep_has_is_not_named() -> None:
    """A regularised law slips from the start, and the others of these have no lowest frequency inside."""
    _, axes = style.new_figure(4.0)
    summary = {name: np.full(3, np.nan) for name in ("slip_threshold", "amplitude_of_lowest_frequency")}
    summary |= {name: np.ones(3) for name in ("onset_amplitude", "amplitude_of_largest_zeta")}
    sweep_overview._amplitudes(axes, np.arange(3.0), summary, 0)
    assert axes.get_legend_handles_labels()[1] == ["damping sets in", "largest damping"]
    assert sweep_overview._has_amplitudes(summary)
    assert not sweep_overview._has_amplitudes(
        {name: np.full(3, np.nan) for name in (*sweep_overview.AMPLITUDES, "stable_limit_cycle")}
    )


@pytest.mark.parametrize("count", [1, 2, 5, 7, 8])
def test_a_legend_above_the_axes_is_read_row_by_row(count: int) -> None:
    """Seven amplitudes stood in the order 1, 3, 4, 5, 6, 7 and below them 2, for a legend is filled by columns."""
    figure, axes = style.new_figure(4.0)
    for k in range(count):
        axes.plot([0.0, 1.0], [k, k], label=f"amplitude {k}")
    style.legend_outside(figure, axes, columns=6)
    figure.canvas.draw()
    [legend] = figure.legends
    places = {text.get_text(): text.get_window_extent() for text in legend.get_texts()}
    read = sorted(places, key=lambda name: (-round(places[name].y0), places[name].x0))
    assert read == [f"amplitude {k}" for k in range(count)]
