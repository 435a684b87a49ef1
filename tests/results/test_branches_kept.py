"""What a run keeps of its branches is the cubic that a script has: read between the points, against closed forms."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from models.duffing import C, mode, response, steps, stiffness
from models.kept_branches import write_branches
from tolerances import ROUNDING, SOLVED

import fretwave as fw
from fretwave.analyses.parts.branch import points_of, record
from fretwave.columns import MODE
from fretwave.results.results import AnalysisWriter

AMPLITUDES = [0.1, 0.37, 1.234, 2.9, 4.0]


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_mode_is_read_as_the_closed_form(shared_tmp, comm, method):
    found = write_branches(shared_tmp, comm, "mode", [mode(method)], (0.1, 4.0), method=method).at(AMPLITUDES)
    omega0 = np.sqrt(stiffness(AMPLITUDES))
    np.testing.assert_allclose(found["amplitude"], AMPLITUDES, rtol=ROUNDING)
    np.testing.assert_allclose(found["omega0"], omega0, rtol=1e-6)
    np.testing.assert_allclose(found["zeta"], C / 2 / omega0, rtol=1e-6)


@pytest.mark.parametrize("rows", [1, 7, 20])
def test_interrupted_branch_keeps_the_same_cubic(shared_tmp, comm, rows):
    """Behind the first point, and in the middle; the step over the interruption is no straight line."""
    whole = write_branches(shared_tmp / "whole", comm, "mode", [mode()], (0.1, 4.0), 0.2)
    halves = write_branches(shared_tmp / "halves", comm, "mode", [mode()], (0.1, 4.0), 0.2, rows)
    np.testing.assert_allclose(halves.curve()["omega"], whole.curve()["omega"], rtol=SOLVED)
    assert len(whole) > 16 and not np.isnan(halves.slopes[1:]).any()


def test_script_and_run_read_the_same(shared_tmp, comm):
    problem = response()
    branch = fw.follow(problem, 1.8, 3.2, steps=steps(0.06))
    kept = write_branches(shared_tmp, comm, "forced", [problem], (1.8, 3.2), 0.06)
    for read in (lambda b: b.at(2.25), lambda b: b.at(amplitude=0.3), lambda b: b.curve(5)):
        mine, its = read(branch), read(kept)
        assert sorted(mine.names) == sorted(its.names) and len(mine) == len(its) > 1
        for name in mine.names:
            np.testing.assert_allclose(its[name], mine[name], rtol=SOLVED, atol=ROUNDING)


def test_levels_of_a_response_are_branches_of_their_own(shared_tmp, comm):
    """No line runs from the end of one to the start of the next; each is read where it is met."""
    F, levels = 0.02, (1.0, 2.0)
    kept = write_branches(shared_tmp, comm, "forced", [response(F, level) for level in levels], (1.8, 2.3))
    found = kept.at(1.9)
    assert found["level"].tolist() == list(levels)
    a = found["amplitude"]
    left = np.sqrt((stiffness(a) - 1.9**2) ** 2 + (C * 1.9) ** 2) * a
    np.testing.assert_allclose(left, F * np.array(levels), rtol=1e-6)
    curve = kept.curve(4)
    starts = np.flatnonzero(np.diff(curve["level"]))
    assert len(starts) == 1 and curve["place"][starts[0] + 1] == np.flatnonzero(kept["level"] == 2.0)[0]
    assert curve["omega"][starts[0]] == pytest.approx(2.3) and curve["omega"][starts[0] + 1] == pytest.approx(1.8)


@pytest.mark.ranks(1)
def test_results_without_slopes_are_read_by_chords(shared_tmp, comm):
    kept = write_branches(shared_tmp, comm, "mode", [mode()], (0.1, 4.0), 0.2)
    with h5py.File(shared_tmp / "results.h5", "r+") as file:
        del file["mode/slopes"]
    old = fw.open_run(shared_tmp)["mode"]
    assert old.slopes is None and len(old.curve()) == len(old)
    (found,) = old.at(0.5)
    x = np.interp(0.5, kept["amplitude"], kept["omega0"])
    assert found["omega0"] == pytest.approx(x, rel=ROUNDING) and abs(x - np.sqrt(stiffness(0.5))) > 1e-5


@pytest.mark.ranks(1)
def test_straight_lines_do_not_follow_rounding(tmp_path, comm):
    """An undamped mode's damping of 1e-17 has no shape: its lines are those of one without."""
    straight = write_branches(tmp_path, comm, "mode", [mode(damping=0.0)], (0.1, 4.0), 0.2).straight()
    with h5py.File(tmp_path / "results.h5", "r+") as file:
        slopes = file["mode/slopes"]
        slopes[:, :, 0] += 1e-17 * np.random.default_rng(1).standard_normal(slopes.shape[:2])
    rounded = fw.open_run(tmp_path)["mode"].straight()
    assert rounded["place"].tolist() == straight["place"].tolist()


@pytest.mark.ranks(1)
def test_an_unfinished_branch_is_read_from_its_journal(tmp_path, comm):
    problem = mode()
    writer = AnalysisWriter(tmp_path, "mode", MODE, {"type": "mode", "method": "CNM"})
    branch = fw.Continuation(problem, problem.initial(0.1), (0.1, 4.0), steps(0.05))
    for point in points_of(branch):
        record(writer, problem, point, None, {})
        if point.parameter > 1.0:
            break
    (found,) = fw.open_run(tmp_path)["mode"].at(0.37)
    assert found["omega0"] == pytest.approx(np.sqrt(stiffness(0.37)), rel=1e-6)
    writer.abandon()


@pytest.mark.ranks(1)
def test_slopes_are_scalars_alone_and_their_axes_have_names(shared_tmp, comm):
    write_branches(shared_tmp, comm, "mode", [mode()], (0.1, 4.0))
    with h5py.File(shared_tmp / "results.h5") as file:
        slopes = file["mode/slopes"]
        assert slopes.shape == (len(file["mode/point"]), 2, 3)
        assert [axis[0].name for axis in slopes.dims] == ["/mode/point", "/mode/end", "/mode/scalar"]
        assert [text.decode() for text in file["mode/scalar"][()]] == ["beta", "w", "log_amplitude"]


@pytest.mark.ranks(1)
def test_what_follows_no_branch_says_so(tmp_path):
    writer = AnalysisWriter(tmp_path, "static", ("point", "amplitude", "event"), {"type": "static"})
    writer.append({"point": 0, "amplitude": 1.0, "event": ""})
    writer.close("done", "")
    with pytest.raises(fw.InputError, match="no branch"):
        fw.open_run(tmp_path)["static"].at(1.0)


@pytest.mark.ranks(1)
def test_step_with_a_corner_is_drawn_straight(comm):
    """A slider at rest and slipping: between two points the frequency leaves no more than they span."""
    slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 5.0, "friction_limit": 1.0})
    model = fw.Model([[1.0]], [[4.0]], contacts=[slider])
    branch = fw.follow(fw.NonlinearMode(model, fw.choose_harmonics(model, 1)), 0.1, 4.0)
    curve = branch.curve()
    assert curve["omega"].max() <= 3.0 * (1 + 1e-9) and (np.diff(curve["amplitude"]) > 0).all()


@pytest.mark.parametrize("noise", [1e-14, 2e-11])
def test_rounding_bends_no_line(shared_tmp, comm, noise):
    """A frequency and a damping that do not change: as many lines whatever Newton leaves of them, as on other ranks."""
    model = fw.Model([[1.0]], [[4.0]])
    kept = write_branches(
        shared_tmp, comm, "mode", [fw.NonlinearMode(model, fw.Harmonics([1], 16), "EPMC")], (0.1, 4.0)
    )
    _, curve = kept._curves[0]
    assert curve.cubic is not None
    random = np.random.default_rng(1)
    for part in (curve.cubic.values, curve.cubic.begin, curve.cubic.end):
        part += noise * random.normal(size=part.shape)
    assert len(curve.straight(1e-3)) <= 2 * len(kept)
