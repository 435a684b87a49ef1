"""Pictures of a small synthetic run: what must be on them is on them, and they come from the results alone."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import call
from matplotlib.figure import Figure
from models.legends import legend_texts
from models.table_rows import SHARED
from tolerances import ROUNDING

from fretwave.analyses.mode import summarise
from fretwave.columns import FORCED, MODE
from fretwave.plots import (
    backbone,
    faces,
    forced,
    free_decay,
    limit_cycles,
    phase_planes,
    plot_run,
    style,
    trajectories,
)
from fretwave.plots import study as study_picture
from fretwave.report.findings import marked
from fretwave.results.overview import overviews
from fretwave.results.reader import Run
from fretwave.results.results import AnalysisWriter

pytestmark = pytest.mark.ranks(1)

REPORTED = (3, 10, 16, 20, 26)


def write_mode(folder, name="mode", method="CNM", shift=0.0):
    """A mode with a damping peak of 4 % at a = 0.2; `shift` moves the damping."""
    described = {"type": "mode", "method": method, "normalise": "m1", "stuck_omega": 25.3, "free_omega": 24.2}
    writer = AnalysisWriter(folder, name, MODE, described, ["m1", "m2"], ["1c", "1s", "3c", "3s"])
    tau = 2.0 * np.pi * np.arange(32) / 32
    for i, a in enumerate(np.geomspace(0.02, 2.0, 31)):
        zeta = 0.04 * np.exp(-(np.log(a / 0.2) ** 2)) + shift
        omega = 25.3 - 0.55 * (1.0 + np.tanh(np.log(a / 0.2)))
        row = {"point": i, "amplitude": a, "omega": omega, "omega0": omega, "frequency_hz": omega / (2 * np.pi)}
        row |= {"beta": zeta * omega, "zeta": zeta, "wall_s": 0.01, **SHARED}
        row["event"] = {10: "fold", 12: "fold", 15: "peak_damping"}.get(i, "report" if i in REPORTED else "")
        q = a * np.array([[1.0, 0.0, 0.01, 0.0], [0.8, 0.5, 0.1, 0.05]])
        loop = {"u": np.cos(tau)[:, None, None], "v": -np.sin(tau)[:, None, None], "f": -np.sin(tau)[:, None, None]}
        writer.append(row, q, {"damper": loop} if row["event"] else None)
    writer.close("done", "stop value reached")


def write_forced(folder):
    described = {"type": "forced", "observe": "m1", "backbone": json.dumps(["mode", "mode_epmc"])}
    writer = AnalysisWriter(folder, "forced", FORCED, described, ["m1", "m2"], ["1c", "1s"])
    for level in (1.0, 2.0):
        for i, omega in enumerate(np.linspace(23.0, 27.0, 15)):
            q = level / (25.0**2 - omega**2 + 40.0j)
            row = {"point": i, "level": level, "omega": omega, "frequency_hz": omega / (2 * np.pi)}
            row |= {"amplitude": abs(q), "phase": np.angle(q), "wall_s": 0.01, "event": "", **SHARED}
            writer.append(row, np.zeros((2, 2)))
    writer.close("done", "stop value reached")
    table = "level,frequency_hz,amplitude,amplitude_hb,relative_difference\n1,4,0.01,0.01,0\n2,4,0.02,0.02,0\n"
    (folder / "forced_time.csv").write_text(table)


def write_transients(folder):
    described = {"type": "free_decay", "mode": "mode", "amplitude": "[1.0, 0.3]"}
    columns = ("start", "cycle", "time", "amplitude", "omega", "zeta", "omega_mode", "zeta_mode")
    writer = AnalysisWriter(folder, "free_decay", columns, described)
    for start, a0 in enumerate((1.0, 0.3)):
        for cycle in range(5):
            writer.append(dict(zip(columns, (start, cycle, 0.25 * cycle, a0 * 0.9**cycle, 25.0, 0.02, 25.0, 0.02))))
    writer.close("done", "")
    described = {"type": "limit_cycle", "mode": "flutter", "amplitude": "[0.05, 0.3, 1.5]"}
    columns = ("start", "cycle", "time", "amplitude", "frequency_hz")
    writer = AnalysisWriter(folder, "limit_cycle", columns, described)
    for start, a0 in enumerate((0.05, 0.3, 1.5)):
        for cycle in range(20 if start < 2 else 5):
            writer.append(dict(zip(columns, (start, cycle, 0.25 * cycle, a0 * 1.1**cycle, 4.0))))
        writer.dataset(f"motion_{start}", np.random.default_rng(0).standard_normal((3, 50)))
    writer.close("done", "")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    write_mode(folder)
    write_mode(folder, "mode_epmc", "EPMC")
    write_mode(folder, "flutter", shift=-0.02)
    write_forced(folder)
    write_transients(folder)
    return folder


@pytest.fixture(scope="module")
def run(folder):
    return Run(folder)


def dashes(axes):
    return [line.get_linestyle() for line in axes.get_lines()]


def test_every_picture_of_a_run_is_written_from_its_results(folder):
    names = {path.name for path in plot_run(folder)}
    assert names == {
        *(f"{mode}_trajectories.png" for mode in ("mode", "mode_epmc", "flutter")),
        *(f"{mode}_phase_planes.png" for mode in ("mode", "mode_epmc", "flutter")),
        *(f"{mode}_hysteresis_damper.png" for mode in ("mode", "mode_epmc", "flutter")),
        *("mode_backbone.png", "flutter_backbone.png", "forced_response.png", "free_decay_cycles.png"),
        *("limit_cycle_envelopes.png", "limit_cycle_phase_planes.png"),
    }
    assert all((folder / name).stat().st_size > 5000 for name in names)


def test_only_names_analyses_or_kinds_of_picture(folder):
    assert [path.name for path in plot_run(folder, ["forced"])] == ["forced_response.png"]
    assert {path.name for path in plot_run(folder, ["mode"])} == {
        *("mode_trajectories.png", "mode_phase_planes.png", "mode_hysteresis_damper.png", "mode_backbone.png"),
    }
    assert {path.name for path in plot_run(folder, ["backbone"])} == {"mode_backbone.png", "flutter_backbone.png"}


@pytest.mark.parametrize(("name", "fix"), [("mode_epmcc", "--only mode_epmc"), ("nonsense", "--only flutter")])
def test_a_name_of_no_pictures_is_refused(folder, capsys, name, fix):
    assert call("plot", folder, "--only", name) == 2
    told = capsys.readouterr()
    assert told.out == "" and f"fix:      {fix}" in told.err and "an analysis (" in told.err


@pytest.mark.parametrize("name", ["mode", "backbone", "mode,forced"])
def test_what_has_pictures_is_no_error(folder, name):
    assert call("plot", folder, "--only", name) == 0


@pytest.mark.parametrize(
    ("names", "none", "made"), [("gauges", "gauges", 0), ("linear", "linear", 0), ("safe,forced,wear", "safe, wear", 1)]
)
def test_a_name_without_a_picture_of_these_results_is_said_and_the_others_are_drawn(folder, capsys, names, none, made):
    for path in folder.glob("*.png"):
        path.unlink()
    assert call("plot", folder, "--only", names) == 2
    told = capsys.readouterr()
    assert len(list(folder.glob("*.png"))) == made and told.out.startswith(f"{made} picture")
    assert f"measured: {none}\n" in told.err and "expected: one of backbone, " in told.err
    for kind in ("mode", "forced", "free_decay", "limit_cycle", "phase_planes"):
        assert kind in told.err
    assert "gauges," not in told.err and "fix:      --only backbone" in told.err


def test_a_format_twice_is_one(folder, capsys):
    assert call("plot", folder, "--only", "forced", "--format", "png,PNG,.png") == 0
    assert capsys.readouterr().out.startswith("1 picture in ")


def test_pictures_are_vectors_on_request(folder):
    """The same twice, with their texts; no date makes them differ."""
    first = plot_run(folder, ["forced"], formats=["svg", "pdf"])
    assert [path.name for path in first] == ["forced_response.svg", "forced_response.pdf"]
    content = [path.read_bytes() for path in first]
    assert b"<svg" in content[0][:500] and content[1].startswith(b"%PDF-")
    assert [path.read_bytes() for path in plot_run(folder, ["forced"], formats=["svg", "pdf"])] == content


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_pictures_that_the_results_do_not_make_any_more_are_told_and_stay(tmp_path, capsys, ending):
    """Those of an analysis that is gone looked like pictures of these results; a user's own are nobody's business."""
    write_mode(tmp_path, "former")
    (former,) = plot_run(tmp_path, ["backbone"], formats=[ending])
    own = former.with_name(f"own.{ending}")
    Figure().savefig(own)
    (tmp_path / "results.h5").unlink()
    write_mode(tmp_path)
    for _ in range(2):
        assert call("plot", tmp_path, "--format", ending) == 0
        said = capsys.readouterr().out
        assert f"note: 1 picture from before that these results do not make: former_backbone.{ending}\n" in said
        assert former.exists() and own.exists() and "own" not in said
    former.unlink()
    assert call("plot", tmp_path, "--format", ending) == 0 and "from before" not in capsys.readouterr().out


def test_an_empty_folder_has_no_pictures(tmp_path):
    assert plot_run(tmp_path) == []


def test_backbone_shows_both_methods_both_asymptotes_folds_and_peak(run):
    figure = backbone.draw([run.analyses["mode"], run.analyses["mode_epmc"]])
    upper, lower = figure.axes
    assert [text.get_text() for text in upper.texts] == ["stuck 4.027 Hz", "free 3.852 Hz"]
    assert {"--", "-."} <= set(dashes(upper))
    assert any(text.startswith("CNM, H = 3: peak ζ 4 % at 0.2 m") for text in legend_texts(figure))
    assert "fold in amplitude" in legend_texts(figure)
    assert lower.get_xscale() == "log"
    assert lower.get_xlabel() == "Modal amplitude of m1 [m]"
    assert len(upper.child_axes) == len(lower.child_axes) == 1  # close-up of the folds


@pytest.mark.parametrize("damping", [0.0, 0.00544, -0.02])
def test_damping_that_is_the_same_throughout_has_no_peak(tmp_path, damping):
    """Of a branch that sticks only rounding has a largest value, here one that was located too."""
    random = np.random.default_rng(3)
    described = {"type": "mode", "method": "CNM", "normalise": "m1", "stuck_omega": 25.3}
    writer = AnalysisWriter(tmp_path, "mode", MODE, described, ["m1", "m2"], ["1c", "1s"])
    for i, a in enumerate(np.geomspace(0.02, 2.0, 31)):
        zeta = damping * (1 + 1e-12 * random.standard_normal()) + 1e-15 * random.standard_normal()
        row = {"point": i, "amplitude": a, "omega": 25.3, "omega0": 25.3, "frequency_hz": 25.3 / (2 * np.pi)}
        row |= {"beta": 0.0, "zeta": zeta, "wall_s": 0.01, **SHARED, "slip": 0.0}
        writer.append(row | {"event": "peak_damping" if i in (15, 16, 17) else ""}, a * np.ones((2, 2)))
    writer.close("done", "stop value reached")
    run = Run(tmp_path)
    figure = backbone.draw([run.analyses["mode"]])
    (name,) = [text for text in legend_texts(figure) if text.startswith("CNM")]
    assert name == f"CNM, H = 1: ζ {100 * damping:.3g} % throughout"
    assert not any(line.get_marker() == style.PEAK["marker"] for axes in figure.axes for line in axes.get_lines())
    (told,) = overviews(tmp_path)[1]
    assert not any("largest damping" in words for words in marked(run.analyses["mode"], told).values())
    table = {key: run.analyses["mode"].columns[key] for key in ("amplitude", "zeta", "wall_s")}
    (line,) = summarise("mode", {**table, "event": [""] * 31, "zeta_error": np.zeros(31)}, [], "m")
    assert "largest" not in line.partition("fold")[0] and f"damping {100 * damping:.4g} % throughout" in line


@pytest.mark.ranks(1)
def test_a_branch_that_comes_back_is_told_up_to_where_it_was():
    """Of 1 to 3 m and back to 0.25 m "a 1 to 0.25 m" was said."""
    amplitude, zeta = np.array([1.0, 3.0, 0.25]), np.array([0.01, 0.02, 0.01])
    table = {"amplitude": amplitude, "zeta": zeta, "zeta_error": 0 * zeta, "wall_s": 0 * zeta}
    (line,) = summarise("mode", {**table, "event": ["", "fold", ""]}, [], "m")
    assert "3 points, a 0.25 to 3 m" in line


@pytest.mark.parametrize("late", [False, True])
def test_the_close_up_of_the_folds_covers_no_point(tmp_path, late):
    """Of a branch whose folds are early, and of one that slips, and is damped, at its end."""
    described = {"type": "mode", "method": "CNM", "normalise": "m1", "stuck_omega": 25.3}
    writer = AnalysisWriter(tmp_path, "mode", MODE, described, ["m1"], ["1c", "1s"])
    a = np.geomspace(0.02, 2.0, 61)
    begin = 50 if late else 8
    a[begin : begin + 3] = a[begin + 1] * np.array([1.01, 1.0, 0.99])  # a narrow fold and back
    slips = np.clip(np.arange(61) - begin, 0, None) / 61.0
    for i, amplitude in enumerate(a):
        omega, zeta = 25.3 - 4.0 * slips[i], 0.1 * slips[i]
        row = {"point": i, "amplitude": amplitude, "omega": omega, "omega0": omega, "frequency_hz": omega / 2 / np.pi}
        row |= {"beta": zeta * omega, "zeta": zeta, "wall_s": 0.01, **SHARED}
        row["event"] = "fold" if i in (begin, begin + 2) else ""
        writer.append(row, amplitude * np.array([[1.0, 0.0]]))
    writer.close("done", "")
    figure = backbone.draw([Run(tmp_path)["mode"]])
    figure.canvas.draw()
    for axes, values in zip(figure.axes[:2], (25.3 - 4.0 * slips, 10.0 * slips)):
        (inset,) = axes.child_axes
        values = values / (2 * np.pi) if axes is figure.axes[0] else values
        points = axes.transData.transform(np.column_stack([a, values]))
        box = inset.get_tightbbox()
        assert not any(box.contains(x, y) for x, y in points)


def test_backbone_under_negative_damping_marks_stable_and_unstable_limit_cycles(run):
    figure = backbone.draw([run.analyses["flutter"]])
    assert {"limit cycle, stable in its own amplitude", "limit cycle, unstable"} <= set(legend_texts(figure))
    stable, unstable = run.analyses["flutter"].mode_curve().crossings()
    width = np.sqrt(np.log(2.0))
    assert stable.amplitude == pytest.approx(0.2 * np.exp(-width), rel=1e-2) and stable.stable
    assert unstable.amplitude == pytest.approx(0.2 * np.exp(width), rel=1e-2) and not unstable.stable


def test_trajectories_and_phase_planes_are_closed_and_named_by_amplitude(run):
    mode = run.analyses["mode"]
    for figure in (trajectories.draw(mode), phase_planes.planes(mode)):
        left, right = figure.axes[:2]
        assert len(left.get_lines()) == len(right.get_lines()) == 4
        for line in left.get_lines():
            x, y = line.get_data()
            assert (x[0], y[0]) == pytest.approx((x[-1], y[-1]))
        assert legend_texts(figure)[0] == "0.0317 m"


def test_velocity_of_a_phase_plane_includes_the_decay_for_cnm_only(run):
    _, cnm = phase_planes.motion_of(run.analyses["mode"], 15)
    _, epmc = phase_planes.motion_of(run.analyses["mode_epmc"], 15)
    columns, amplitude = run.analyses["mode"].columns, run.analyses["mode"].columns["amplitude"][15]
    assert cnm[0, 0] == pytest.approx(-columns["beta"][15] * amplitude * 1.03, rel=ROUNDING)
    assert epmc[0, 0] == pytest.approx(0.0, abs=ROUNDING)


def test_hysteresis_loops_are_closed(run):
    left, _ = phase_planes.loops(run.analyses["mode"], "damper").axes
    assert len(left.get_lines()) >= 3
    for line in left.get_lines():
        x, y = line.get_data()
        assert (x[0], y[0]) == (x[-1], y[-1])


def test_response_has_a_curve_per_level_backbones_and_time_points(run):
    modes = [run.analyses["mode"], run.analyses["mode_epmc"]]
    figure = forced.draw(run.analyses["forced"], modes, run.table("forced_time"))
    names = ["level 1", "level 2", "backbone, CNM", "backbone, EPMC", "time integration"]
    assert legend_texts(figure) == [*names, "computed points", "estimated error, at most 0.1 mm"]
    assert dashes(figure.axes[0]).count("--") == 1


def test_free_decay_has_the_mode_and_a_set_of_circles_per_start(run):
    (figure,) = [figure for _, figure in free_decay.figures(run)]
    names = ["mode, CNM", "cycles of the decay from 1 m", "cycles of the decay from 0.3 m"]
    assert legend_texts(figure) == [*names, "computed points"]
    assert len(figure.axes[0].get_lines()[2].get_xdata()) == 5


def test_limit_cycles_show_every_start_and_both_predictions(run):
    figures = dict(limit_cycles.figures(run))
    names = legend_texts(figures["limit_cycle_envelopes"])
    assert names[:3] == ["low start, a = 0.05 m", "intermediate start, a = 0.3 m", "high start, a = 1.5 m"]
    assert [name.split(",")[1] for name in names[3:]] == [" stable in its own amplitude", " unstable"]
    assert [text.get_text() for text in figures["limit_cycle_envelopes"].axes[0].texts] == ["diverges, stopped"]
    assert len(figures["limit_cycle_phase_planes"].axes) == 3


def test_study_has_a_line_per_sweep_without_the_reference(tmp_path):
    rows = ["sweep,harmonics,samples,tolerance,wall_s,omega_error,zeta_error,zeta_error_estimate,reference"]
    rows += ["harmonics,1,256,1e-10,0.1,1e-2,0.4,0.3,0", "harmonics,7,256,1e-10,0.2,0,0,0.1,1"]
    rows += ["samples,7,64,1e-10,0.1,1e-4,1e-3,0.1,0", "samples,7,256,1e-10,0.2,0,0,0.1,1"]
    (tmp_path / "study.csv").write_text("\n".join(rows))
    figure = study_picture.draw(Run(tmp_path).table("study"))
    left, right = figure.axes
    assert [len(line.get_xdata()) for line in right.get_lines()] == [1, 1]
    assert (left.get_xscale(), left.get_yscale()) == ("log", "log")
    assert [path.name for path in plot_run(tmp_path)] == ["study.png"]


def test_legends_lie_above_the_axes(run):
    with style.rules():
        for _, figure in (*backbone.figures(run), *forced.figures(run), *limit_cycles.figures(run)):
            figure.draw_without_rendering()
            bottom = figure.legends[0].get_window_extent().y0
            assert all(axes.get_window_extent().y1 <= bottom for axes in figure.axes)


def test_shares_of_stick_slip_and_open_are_counted_over_the_samples():
    shares = faces.status_shares(np.array([[0, 1, 2, 2], [1, 0, 1, 1]]).T)
    assert np.array_equal(shares.T, [[0.25, 0.25, 0.5], [0.25, 0.75, 0.0]])
