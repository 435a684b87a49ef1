"""What the lines of the pictures hold: closed forms between the points, the tables' values, and their units."""

from __future__ import annotations

import json

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from models.duffing import C, mode, response, stiffness
from models.kept_branches import relative, write_branches
from models.legends import legend_texts
from models.table_rows import SHARED as COMMON
from tolerances import ROUNDING, SOLVED

from fretwave.columns import FORCED, MODE, Column
from fretwave.plots import (
    backbone,
    flutter,
    forced,
    forced_blades,
    free_decay,
    limit_cycles,
    loops,
    phase_planes,
    study,
    style,
    sweeps,
    trajectories,
    wheel,
)
from fretwave.post.grid import Plan
from fretwave.results.reader import Run
from fretwave.results.results import AnalysisWriter
from fretwave.results.sweeps import read_branch, write_sweep

pytestmark = pytest.mark.ranks(1)
#: Cubics err by less, chords between the same points by more.
CUBIC, CHORD = 2e-5, 2e-4
SHARED = {**COMMON, "wall_s": 0.01, "event": ""}
TAU = 2 * np.pi * np.arange(64) / 64


def frequency(a, damping=C):
    return np.sqrt(stiffness(a) - damping**2 / 4) / (2 * np.pi)


def ratio(a, damping=C):
    """Damping ratio [%]."""
    return 100 * damping / 2 / np.sqrt(stiffness(a))


def chord_error(x, y, points, truth):
    """Of straight lines between the points, at the abscissas of a line."""
    kept = np.isin(x, points)
    return relative(np.interp(x, x[kept], y[kept]), truth(x))


def line_named(axes, start):
    (found,) = [line for line in axes.lines if str(line.get_label()).startswith(start)]
    return found.get_xydata().T


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A mode of the Duffing oscillator from 0.5 to 4 m in a few steps, and its responses at two levels."""
    from mpi4py import MPI

    folder = tmp_path_factory.mktemp("kept")
    comm = MPI.COMM_WORLD
    write_branches(folder, comm, "mode", [mode()], (0.5, 4.0), 0.2, method="CNM", normalise="x", stuck_omega=2.0)
    problems = [response(0.02, level) for level in (1.0, 2.0)]
    extra = {"observe": "x", "backbone": json.dumps(["mode"])}
    write_branches(folder, comm, "forced", problems, (1.8, 2.3), 0.1, **extra)
    waves = [mode(damping=damping) for damping in (-0.02, 0.06)]
    rows = [{"nodal_diameter": -1}, {"nodal_diameter": 2}]
    write_branches(folder, comm, "flutter", waves, (0.5, 4.0), 0.2, rows=rows, method="CNM", normalise="x", events="[]")
    columns = ("start", "cycle", "time", "amplitude", "omega", "zeta", "omega_mode", "zeta_mode")
    writer = AnalysisWriter(folder, "free_decay", columns, {"type": "free_decay", "mode": "mode", "amplitude": "[3.0]"})
    for cycle, a in enumerate((2.9, 2.5, 2.2)):
        writer.append(dict(zip(columns, (0, cycle, 0.1 + cycle, a, 2.0 + a, 0.01 * a, 2.0, 0.02))))
    writer.close("done", "")
    return Run(folder)


def test_backbone_runs_through_the_closed_form_in_hertz_and_percent(kept):
    points = kept["mode"]["amplitude"]
    figure = backbone.draw([kept["mode"]])
    upper, lower = figure.axes
    for axes, truth in ((upper, frequency), (lower, ratio)):
        a, y = line_named(axes, "CNM")
        assert relative(y, truth(a)) < CUBIC and chord_error(a, y, points, truth) > CHORD
        assert np.isin(points, a).all() and len(a) == 8 * (len(points) - 1) + 1
    assert lower.get_xlim() == pytest.approx((0.5, 4.0))
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("Frequency ω/2π [Hz]", "Damping ratio ζ [%]")
    assert lower.get_xlabel() == "Modal amplitude of x [m]"


def test_asymptotes_have_the_digits_that_tell_them_apart():
    assert [style.apart([4.026, 3.845])(value) for value in (4.026, 3.845)] == ["4.026", "3.845"]
    assert [style.apart([193.33226, 193.33101])(value) for value in (193.33226, 193.33101)] == ["193.332", "193.331"]
    assert style.apart([7.0, 7.0])(7.0) == "7"


def test_responses_solve_their_equation_and_are_divided_by_their_level(kept):
    figure = forced.draw(kept["forced"], [kept["mode"]], None)
    left, right = figure.axes
    for level in (1.0, 2.0):
        f, a = line_named(left, f"level {level:g}")
        omega = 2 * np.pi * f
        force = np.sqrt((stiffness(a) - omega**2) ** 2 + (C * omega) ** 2) * a
        assert np.abs(force / (0.02 * level) - 1).max() < 0.02
        assert (f[0], f[-1]) == pytest.approx((1.8 / 2 / np.pi, 2.3 / 2 / np.pi))
        np.testing.assert_allclose(line_named(right, f"level {level:g}"), [f, a / level])
    f, a = line_named(left, "backbone")
    assert relative(f, frequency(a)) < CUBIC
    assert left.get_xlabel() == "Excitation frequency [Hz]" and left.get_ylabel() == "Amplitude of x [m]"
    assert left.get_xlim() == pytest.approx((1.8 / 2 / np.pi, 2.3 / 2 / np.pi))
    amplitude, error = kept["forced"]["amplitude"], kept["forced"]["amplitude_error"]
    assert amplitude.max() < (amplitude + error).max() < 1.3 * amplitude.max()
    assert left.get_ylim() == pytest.approx((0.0, 1.05 * (amplitude + error).max()))  # with room for the bands


def test_every_wave_has_its_own_damping(kept):
    figure = flutter.damping(kept["flutter"])
    (axes,) = figure.axes
    for name, damping in (("ND -1", -0.02), ("ND +2", 0.06)):
        a, zeta = line_named(axes, name)
        assert relative(zeta, ratio(a, damping)) < CUBIC
        assert (a.min(), a.max()) == pytest.approx((0.5, 4.0))
    assert axes.get_ylabel() == "Damping ratio ζ, friction and flow [%]"
    assert flutter.spans(*flutter.wave(kept["flutter"], -1)) == [(pytest.approx(0.5), pytest.approx(4.0), -1.0)]
    assert [flutter.spans(*flutter.wave(kept["flutter"], 2))[0][2]] == [1.0]


def test_cycles_of_a_decay_lie_on_axes_fitted_to_what_is_seen(kept):
    (figure,) = [figure for _, figure in free_decay.figures(kept)]
    upper, lower = figure.axes
    a, f = line_named(upper, "mode")
    assert relative(f, frequency(a)) < CUBIC
    amplitude = np.array([2.9, 2.5, 2.2])
    np.testing.assert_allclose(line_named(upper, "cycles"), [amplitude, (2.0 + amplitude) / (2 * np.pi)])
    np.testing.assert_allclose(line_named(lower, "cycles"), [amplitude, amplitude])
    assert lower.get_xlim() == pytest.approx((2.2 / 1.3, 2.9 * 1.3))
    seen = [frequency(2.2 / 1.3), 4.9 / (2 * np.pi)]
    low, high = upper.get_ylim()
    assert seen[0] - 0.2 * np.ptp(seen) < low < seen[0] + 0.02 and seen[1] < high < seen[1] + 0.2 * np.ptp(seen)


def test_a_sweep_draws_the_branch_of_every_value(tmp_path, comm):
    values, parts = (0.02, 0.06), []
    for number, damping in enumerate(values):
        folder = tmp_path / str(number)
        run = {"method": "CNM", "normalise": "x", "run_id": "one"}
        write_branches(folder, comm, "mode", [mode(damping=damping)], (0.5, 4.0), 0.2, **run)
        parts.append(read_branch(folder, "mode", number, "one"))
    plan = Plan({"dampers.0.c": values})
    write_sweep(tmp_path, "sweep", "mode", plan, parts, {"status": "done", "reason": "", "run_id": "one"})
    found = dict(sweeps.figures(Run(tmp_path)))
    upper, lower = found["sweep_backbones"].axes
    for number, damping in enumerate(values):
        for axes, truth in ((upper, frequency), (lower, ratio)):
            a, y = axes.lines[number].get_xydata().T
            assert len(a) == 8 * (parts[number].points - 1) + 1
            assert relative(y, truth(a, damping)) < CUBIC
    assert legend_texts(found["sweep_backbones"])[:2] == ["c = 0.02", "c = 0.06"]
    _, damping_axes = found["sweep_summary"].axes
    x, zeta = damping_axes.lines[0].get_xydata().T
    np.testing.assert_allclose(x, values)
    np.testing.assert_allclose(zeta, ratio(0.5, np.array(values)), rtol=1e-6)
    assert damping_axes.get_ylabel() == "Largest damping ratio ζ [%]"


def write_ellipses(folder, method="CNM", mean=None):
    """x1 = a cos t, x2 = a/2 sin t, and a contact that moves like a ellipse of work pi a b.

    About a mean of each of three dofs, where there is one, the third of which stands still.
    """
    described = {"type": "mode", "method": method, "normalise": "one"}
    dofs, labels, shape = ["one", "two"], ["1c", "1s"], np.array([[1.0, 0.0], [0.0, 0.5]])
    if mean is not None:
        dofs, labels, shape = [*dofs, "three"], ["0", *labels], np.vstack([shape, [0.0, 0.0]])
    writer = AnalysisWriter(folder, "mode", MODE, described, dofs, labels)
    for point, a in enumerate((0.1, 0.2, 0.4)):
        row = {"point": point, "amplitude": a, "omega": 3.0, "omega0": 5.0, "frequency_hz": 3.0 / (2 * np.pi)}
        row |= {"beta": 0.0, "zeta": 0.01 * a, **SHARED, "event": "report"}
        u, f = np.zeros((64, 1, 2)), np.zeros((64, 1, 2))
        u[:, 0, 1], f[:, 0, 1] = a * np.cos(TAU), -7.0 * np.sin(TAU)
        v = np.gradient(u, axis=0)
        q = a * shape
        if mean is not None:
            q, u, f = np.column_stack([mean, q]), u + mean[0], f + 100.0
        writer.append(row, q, {"pad": {"u": u, "v": v, "f": f}})
    writer.close("done", "")
    return Run(folder)["mode"]


def test_trajectories_and_phase_planes_are_the_ellipses_of_the_coefficients(tmp_path):
    found = write_ellipses(tmp_path)
    left, right = trajectories.draw(found).axes
    for line, a in zip(left.lines, (0.1, 0.2, 0.4)):
        x, y = line.get_xydata().T
        np.testing.assert_allclose((x / a) ** 2 + (2 * y / a) ** 2, 1, rtol=ROUNDING)
    assert left.get_xlabel() == "Displacement of one [m]" and left.get_ylabel() == "Displacement of two [m]"
    np.testing.assert_allclose(right.lines[0].get_xydata(), right.lines[2].get_xydata(), atol=ROUNDING)
    upper, lower = phase_planes.planes(found).axes[::2]
    for line, unit, a in zip(upper.lines, lower.lines, (0.1, 0.2, 0.4)):
        x, v = line.get_xydata().T
        np.testing.assert_allclose((x / a) ** 2 + (v / (3.0 * a)) ** 2, 1, rtol=ROUNDING)
        np.testing.assert_allclose(np.hypot(*unit.get_xydata().T), 1, rtol=ROUNDING)
    assert upper.get_ylabel() == "Velocity of one [m/s]"


def test_hysteresis_is_that_of_the_pair_that_works(tmp_path):
    left, right = phase_planes.loops(write_ellipses(tmp_path), "pad").axes
    for line, a in zip(left.lines, (0.1, 0.2, 0.4)):
        x, y = line.get_xydata().T
        np.testing.assert_allclose((x / a) ** 2 + (y / 7.0) ** 2, 1, rtol=ROUNDING)
        assert (x[0], y[0]) == (x[-1], y[-1]) and len(x) == 65
    assert left.get_ylabel() == "Contact force [N]"
    np.testing.assert_allclose(np.hypot(*right.lines[0].get_xydata().T), 1, rtol=ROUNDING)


def test_what_is_scaled_to_the_amplitude_leaves_the_static_state_out(tmp_path):
    """Its displacement over the amplitude said nothing, and chose the dof that is drawn: that which moves is."""
    found = write_ellipses(tmp_path, mean=[3.0, -2.0, 50.0])
    left, right = trajectories.draw(found).axes
    np.testing.assert_allclose(left.lines[0].get_xydata().mean(axis=0), [3.0, -2.0], atol=0.1)
    lower = phase_planes.planes(found).axes[2]
    loops_left, loops_right = phase_planes.loops(found, "pad").axes
    np.testing.assert_allclose(loops_left.lines[0].get_xydata()[:-1].mean(axis=0), [3.0, 100.0], rtol=ROUNDING)
    for axes, half in ((right, 0.5), (lower, 1.0), (loops_right, 1.0)):
        for line in axes.lines:
            x, y = line.get_xydata().T
            np.testing.assert_allclose(np.hypot(x, y / half), 1, rtol=1e-12)
        assert "from its mean" in axes.get_xlabel()
    assert left.get_ylabel() == "Displacement of two [m]"


def test_loops_in_space_are_in_microns_along_the_slip_and_under_the_normal_force(tmp_path):
    writer = AnalysisWriter(tmp_path, "mode", MODE, {"type": "mode", "normalise": "one"}, ["one"], ["1c", "1s"])
    for point, a in enumerate((1e-6, 2e-6, 4e-6)):
        row = {"point": point, "amplitude": a, "omega": 3.0, "omega0": 3.0, "frequency_hz": 0.5}
        row |= {"beta": 0.0, "zeta": 0.01, **SHARED, "event": "report"}
        u, f = np.zeros((64, 3, 1)), np.zeros((64, 3, 1))
        u[:, 1, 0], u[:, 2, 0] = 0.6 * a * np.cos(TAU), 0.8 * a * np.cos(TAU)
        f[:, 0, 0], f[:, 1, 0], f[:, 2, 0] = 50 + 10 * np.cos(TAU), -3 * np.sin(TAU), -4 * np.sin(TAU)
        writer.append(row, np.zeros((1, 2)), {"pad": {"u": u, "v": np.gradient(u, axis=0), "f": f}})
    writer.close("done", "")
    upper, lower = loops.draw(Run(tmp_path)["mode"], "pad").axes
    for line, other, a in zip(upper.lines, lower.lines, (1.0, 2.0, 4.0)):
        x, y = line.get_xydata().T
        np.testing.assert_allclose((x / a) ** 2 + (y / 5) ** 2, 1, rtol=SOLVED)
        n, f = other.get_xydata().T
        np.testing.assert_allclose(((n - 50) / 10) ** 2 + (f / 5) ** 2, 1, rtol=SOLVED)
    assert upper.get_xlabel() == "Tangential displacement [µm]" and lower.get_xlabel() == "Normal force [N]"


def write_wheel(folder, sectors=6, diameter=2):
    """x_j = cos(t - n theta j), each sector later than the one before: a forward wave; then mostly one sector."""
    described = {"type": "mode", "normalise": "tip@0", "sectors": sectors, "sector_dofs": 2, "method": "CNM"}
    dofs = [f"{name}@{j}" for j in range(sectors) for name in ("root", "tip")]
    columns = [*MODE[:-1], "participation", "amplification", "event"]
    named = [Column(c, "1", c) if c in ("participation", "amplification") else c for c in columns]
    writer = AnalysisWriter(folder, "mode", named, described, dofs, ["1c", "1s"])
    wave = np.exp(-2j * np.pi * diameter * np.arange(sectors) / sectors)
    for point, (shape, share) in enumerate(((wave, 1.0), (np.where(np.arange(sectors) == 3, 2.0, 0.1), 0.2))):
        q = np.zeros((2 * sectors, 2))
        q[1::2] = np.column_stack([shape.real, -shape.imag])
        row = {"point": point, "amplitude": 0.1 * (1 + point), "omega": 3.0, "omega0": 3.0, "frequency_hz": 0.5}
        row |= {
            "beta": 0.0,
            "zeta": 1e-24 + 0.01 * point,
            **SHARED,
            "participation": share,
            "amplification": np.abs(shape).max(),
        }
        writer.append(row, q)
    writer.close("done", "")
    return Run(folder)


def test_sectors_of_a_wheel_are_bars_of_their_amplitude_over_the_tuned_waves(tmp_path):
    run = write_wheel(tmp_path)
    found = dict(wheel.figures(run))
    first, waves, last, _ = found["mode_sectors"].axes
    assert [bar.get_height() for bar in first.patches] == pytest.approx(6 * [1.0])
    assert [bar.get_height() for bar in last.patches] == pytest.approx([0.1, 0.1, 0.1, 2.0, 0.1, 0.1])
    marked = [[bar.get_facecolor() == to_rgba(style.RED) for bar in axes.patches] for axes in (first, last)]
    assert marked == [6 * [False], [sector == 3 for sector in range(6)]]  # rounding makes no sector the largest
    shares = {round(bar.get_x() + bar.get_width() / 2): bar.get_height() for bar in waves.patches}
    assert shares[2] == pytest.approx(1.0) and sum(shares.values()) == pytest.approx(1.0)
    assert [axes.texts[0].get_text().split(", ")[1] for axes in (first, last)] == ["ζ = 0 %", "ζ = 1 %"]
    upper, lower = found["mode_localisation"].axes
    np.testing.assert_allclose(upper.lines[0].get_xydata(), [[100.0, 1.0], [200.0, 0.2]])
    assert lower.get_xlabel().endswith("[mm]")
    np.testing.assert_allclose(lower.lines[0].get_ydata(), [1.0, 2.0])


def test_responses_of_blades_pass_through_their_points(tmp_path):
    described = {"type": "forced", "observe": "tip@0", "sectors": 2, "sector_dofs": 1}
    writer = AnalysisWriter(tmp_path, "forced", FORCED, described, ["tip@0", "tip@1"], ["1c", "1s"])
    hertz = np.linspace(1.0, 2.0, 11)
    blades = np.array([1 / (1 + 9 * (hertz - 1.4) ** 2), 2 / (1 + 9 * (hertz - 1.6) ** 2)])
    for point, (f, q) in enumerate(zip(hertz, blades.T)):
        row = {"point": point, "level": 1.0, "omega": 2 * np.pi * f, "frequency_hz": f, "amplitude": q[0], "phase": 0.0}
        writer.append({**row, **SHARED}, np.column_stack([0.6 * q, 0.8 * q]))
    writer.close("done", "")
    (tmp_path / "forced_blades.csv").write_text("level,sector,amplification\n1,0,0.7\n1,1,1.3\n")
    (tmp_path / "forced_tuned.csv").write_text("level,frequency_hz,amplitude\n1,1,0.5\n1,1.5,1.5\n1,2,0.5\n")
    (figure,) = [figure for _, figure in forced_blades.figures(Run(tmp_path))]
    upper, lower = figure.axes
    for name, expected in (("other", blades[0]), ("sector 1", blades[1])):
        f, a = line_named(upper, name)
        for point, value in zip(hertz, expected):
            assert a[np.argmin(np.abs(f - point))] == pytest.approx(value, rel=SOLVED)
        assert a.max() <= expected.max() * (1 + 1e-12)
    np.testing.assert_allclose(lower.lines[0].get_xydata(), [[0, 0.7], [1, 1.3]])
    lower = figure.axes[1]
    legend = lower.get_legend()
    assert "tuned wheel" in [text.get_text() for text in legend.get_texts()] and not lower.texts
    figure.draw_without_rendering()
    box = legend.get_window_extent()
    curves = [lower.transData.transform(line.get_xydata()) for line in lower.get_lines() if len(line.get_xdata())]
    assert all(y < box.y0 for curve in curves for _, y in curve), "names lie on no curve"
    bound = forced_blades.whitehead(2)
    assert [line.get_ydata()[0] for line in lower.lines[1:]] == pytest.approx([1.0, bound])
    assert upper.get_ylabel() == "Amplitude of tip, level 1 [m]"


def test_limit_cycles_hold_the_motions_and_stand_where_damping_is_zero(tmp_path):
    writer = AnalysisWriter(tmp_path, "mode", MODE, {"type": "mode", "method": "CNM", "normalise": "m"})
    amplitude = np.geomspace(0.05, 2.0, 60)
    for point, a in enumerate(amplitude):
        zeta = 0.01 * np.log(a / 0.1) * np.log(1.0 / a)  # feeds below 0.1 and above 1
        row = {"point": point, "amplitude": a, "omega": 3.0, "omega0": 3.0, "frequency_hz": 0.5, "beta": 3 * zeta}
        writer.append({**row, **SHARED, "zeta": zeta})
    writer.close("done", "")
    columns = ("start", "cycle", "time", "amplitude", "frequency_hz")
    told = {"type": "limit_cycle", "mode": "mode", "amplitude": "[0.3]"}
    writer = AnalysisWriter(tmp_path, "limit_cycle", columns, told)
    for cycle in range(5):
        writer.append(dict(zip(columns, (0, cycle, 2.0 * cycle, 0.3 - 0.04 * cycle, 0.5))))
    history = np.array([np.arange(50.0), np.cos(np.arange(50.0)), np.sin(np.arange(50.0))])
    writer.dataset("motion_0", history)
    writer.close("done", "")
    found = dict(limit_cycles.figures(Run(tmp_path)))
    (axes,) = found["limit_cycle_envelopes"].axes
    time, envelope = axes.lines[0].get_xydata().T
    np.testing.assert_allclose(time, 2.0 * np.arange(5))
    np.testing.assert_allclose(envelope, 0.3 - 0.04 * np.arange(5))
    predicted = {line.get_label().split(",")[1]: line.get_ydata()[0] for line in axes.lines[1:]}
    assert predicted == {
        " stable in its own amplitude": pytest.approx(0.1, rel=1e-3),
        " unstable": pytest.approx(1.0, rel=1e-3),
    }
    plane = found["limit_cycle_phase_planes"].axes[0]
    np.testing.assert_allclose(plane.lines[0].get_xydata(), history[1:].T)


def test_a_predicted_orbit_has_the_mean_of_the_static_state(tmp_path):
    """It grew with the amplitude to which the nearest point is scaled."""
    writer = AnalysisWriter(tmp_path, "mode", MODE, {"type": "mode", "normalise": "m"}, ["m"], ["0", "1c", "1s"])
    for point, a in enumerate((0.5, 2.0)):
        row = {"point": point, "amplitude": a, "omega": 3.0, "omega0": 3.0, "frequency_hz": 0.5, "beta": 0.0}
        writer.append({**row, **SHARED, "zeta": 0.01 * (a - 1.0)}, np.array([[7.0, a, 0.0]]))
    writer.close("done", "")
    found = Run(tmp_path)["mode"]
    (zero,) = found.mode_curve().crossings()
    ((_, x, v),) = limit_cycles.predicted_orbits(found)
    np.testing.assert_allclose(np.hypot(x - 7.0, v / 3.0), zero.amplitude, rtol=SOLVED)


def test_envelopes_that_end_early_have_the_word_of_their_summary(tmp_path):
    writer = AnalysisWriter(tmp_path, "mode", MODE, {"type": "mode", "method": "CNM", "normalise": "m"})
    for point, a in enumerate(np.geomspace(0.05, 2.0, 9)):
        row = {"point": point, "amplitude": a, "omega": 3.0, "omega0": 3.0, "frequency_hz": 0.5, "beta": 0.03}
        writer.append({**row, **SHARED, "zeta": 0.01})
    writer.close("done", "")
    columns = ("start", "cycle", "time", "amplitude", "frequency_hz")
    told = {"type": "limit_cycle", "mode": "mode", "amplitude": "[0.3, 0.4, 0.5]"}
    writer = AnalysisWriter(tmp_path, "limit_cycle", columns, told)
    for start, growth, count in ((0, 1.0, 20), (1, 1.2, 8), (2, 0.5, 8)):
        for cycle in range(count):
            writer.append(dict(zip(columns, (start, cycle, 2.0 * cycle, 0.3 * growth**cycle, 0.5))))
    words = ("limit cycle", "leaves the mode's range", "ends in the noise of the integration")
    writer.close("done", "", endings=json.dumps([{"text": word} for word in words]))
    (axes,) = dict(limit_cycles.figures(Run(tmp_path)))["limit_cycle_envelopes"].axes
    assert [text.get_text() for text in axes.texts] == ["leaves the mode's range, stopped", "ends"]


def test_study_holds_the_errors_of_its_table(tmp_path):
    rows = ["sweep,harmonics,samples,tolerance,wall_s,omega_error,zeta_error,zeta_error_estimate,reference"]
    rows += ["harmonics,1,256,1e-10,0.1,1e-2,0.4,0.3,0", "harmonics,3,256,1e-10,0.15,1e-3,0.04,0.2,0"]
    rows += ["harmonics,7,256,1e-10,0.2,0,0,0.1,1"]
    (tmp_path / "study.csv").write_text("\n".join(rows))
    left, right = study.draw(Run(tmp_path).table("study")).axes
    shown = [sorted(map(tuple, axes.lines[0].get_xydata().tolist())) for axes in (left, right)]
    assert sorted(shown) == sorted([[(0.1, 1e-2), (0.15, 1e-3)], [(0.1, 0.4), (0.15, 0.04)]])
