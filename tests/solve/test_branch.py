"""A branch as an object: read by the cubic through its points, against closed forms; kept, drawn, and left clean."""

from __future__ import annotations

import doctest
import re
from importlib import import_module
from pathlib import Path

import h5py
import numpy as np
import pytest
from models.core_models import dense, mode_problem, oscillator, whole
from models.duffing import C, G, K, mode, response, steps, stiffness
from tolerances import ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.columns import FORCED, MODE
from fretwave.solve.hermite import Cubic
from fretwave.solve.trace import cubic_of


def test_every_column_of_a_reading_is_the_closed_form():
    branch = fw.follow(mode(), 0.1, 4.0, steps=steps(0.05))
    a = np.array([0.1, 0.37, 1.234, 2.9, 4.0])
    found = branch.at(a)
    omega0 = np.sqrt(stiffness(a))
    np.testing.assert_allclose(found["amplitude"], a, rtol=ROUNDING)
    np.testing.assert_allclose(found["beta"], C / 2, rtol=1e-7)
    np.testing.assert_allclose(found["omega0"], omega0, rtol=1e-6)
    np.testing.assert_allclose(found["omega"], np.sqrt(stiffness(a) - C**2 / 4), rtol=1e-6)
    np.testing.assert_allclose(found["zeta"], C / 2 / omega0, rtol=1e-6)


def test_reading_gets_better_by_the_fourth_power_of_the_step_and_a_straight_line_by_the_second():
    cubic, straight = [], []
    for length in (0.2, 0.1, 0.05):
        branch = fw.follow(mode(), 0.5, 4.0, steps=steps(length))
        curve = branch.curve(7)
        cubic.append(np.abs(curve["omega0"] - np.sqrt(stiffness(curve["amplitude"]))).max())
        line = np.interp(curve["amplitude"], branch["amplitude"], branch["omega0"])
        straight.append(np.abs(line - np.sqrt(stiffness(curve["amplitude"]))).max())
    assert (np.log2(np.array(cubic[:-1]) / cubic[1:]) > 3.5).all()
    assert (np.log2(np.array(straight[:-1]) / straight[1:]) < 2.5).all()
    assert cubic[-1] < 1e-3 * straight[-1]


@pytest.mark.ranks(1)
def test_columns_that_a_script_changes_are_its_own(tmp_path):
    """``percent = branch["zeta"]; percent *= 100`` made the saved table and pictures of it a hundred times larger."""
    branch = fw.follow(mode(), 0.5, 1.0, steps=steps(0.2))
    there = {"branch": branch, "reading": branch.at([0.6, 0.8])}
    for name, table in there.items():
        before, percent = table["zeta"], table["zeta"]
        percent *= 100.0
        np.testing.assert_array_equal(table["zeta"], before, name)
    branch.save(tmp_path / "branch.h5")
    np.testing.assert_allclose(fw.Branch.load(tmp_path / "branch.h5")["zeta"], C / 2 / branch["omega0"], rtol=1e-6)


def test_all_responses_at_a_frequency_are_found_where_the_branch_folds():
    """((k + 3/4 g a^2 - w^2)^2 + (c w)^2) a^2 = F^2: three amplitudes between the folds."""
    F, omega = 0.1, 2.25
    branch = fw.follow(response(F), 1.8, 3.2, steps=steps(0.06))
    folds = branch["omega"][branch.met("fold")]
    assert len(folds) == 2 and folds.min() < omega < folds.max()
    square = np.roots([(0.75 * G) ** 2, 1.5 * G * (K - omega**2), (K - omega**2) ** 2 + (C * omega) ** 2, -(F**2)])
    expected = np.sort(np.sqrt(square.real))
    np.testing.assert_allclose(np.sort(branch.at(omega)["amplitude"]), expected, rtol=1e-5)
    assert len(branch.at(1.9)) == 1 and len(branch.at(4.0)) == 0


def test_both_frequencies_of_an_amplitude_are_found():
    """w^2 of the quadratic in it, below and above the resonance; the phase jumps by no crossing there."""
    F, a = 0.02, 0.3
    branch = fw.follow(response(F), 1.8, 2.3, steps=steps(0.05))
    b = C**2 - 2 * stiffness(a)
    expected = np.sort(np.sqrt(np.roots([1.0, b, stiffness(a) ** 2 - (F / a) ** 2])))
    found = branch.at(amplitude=a)
    np.testing.assert_allclose(np.sort(found["omega"]), expected, rtol=1e-6)
    phase = np.arctan2(-C * found["omega"], stiffness(a) - found["omega"] ** 2)
    np.testing.assert_allclose(found["phase"], phase, atol=1e-4)
    assert len(branch.at(phase=-np.pi / 2)) == 1 and len(branch.at(phase=np.pi)) == 0


def test_unknowns_between_points_nearly_solve_the_equations(two_dof, comm):
    """They lie as far from the branch as step control allows, and mean what the table says."""
    problem = mode_problem(oscillator(two_dof, comm), range(1, 22, 2), 512, start="stuck")
    branch = fw.follow(problem, 0.02, 3.0)
    for row in branch.at([0.05, 0.134, 0.3, 2.0]):
        y = branch.unknowns(row["place"])
        state = problem.state(y)
        assert all(state[name] == pytest.approx(row[name], rel=ROUNDING) for name in state)
        assert np.linalg.norm(whole(problem.residual(y))) < 2e-3
        y.destroy()
    last = branch.coefficients(len(branch) - 1)
    assert (last is None) == (comm.rank > 0)
    assert last is None or last[0, 0] == pytest.approx(3.0, rel=SOLVED)
    folds = branch["amplitude"][branch.met("fold")]
    assert len(folds) == 2
    assert [len(branch.at(a)) for a in (0.9 * folds.min(), folds.mean(), 1.1 * folds.max())] == [1, 3, 1]


def test_cubic_is_ten_times_nearer_to_points_solved_between_than_the_chord(two_dof, comm):
    """The paper's oscillator at default steps, folds included; errors of zeta as shares of its peak: 0.2 %, 2.2 %."""
    problem = mode_problem(oscillator(two_dof, comm), range(1, 22, 2), 512, start="stuck")
    branch = fw.follow(problem, 0.02, 3.0, unknowns=False)
    middle = {name: branch.curve(2)[name][1::2] for name in ("amplitude", "zeta")}
    solved = fw.follow(problem, 0.02, 3.0, report_at=middle["amplitude"], unknowns=False)
    reported = {a: solved["zeta"][np.isclose(solved["amplitude"], a, rtol=SOLVED)] for a in middle["amplitude"]}
    cubic, chord = [], []
    for k, (a, zeta) in enumerate(zip(middle["amplitude"], middle["zeta"])):
        truth = min(reported[a], key=lambda found, zeta=zeta: abs(found - zeta))
        (a0, a1), (zeta0, zeta1) = branch["amplitude"][k : k + 2], branch["zeta"][k : k + 2]
        cubic.append(abs(zeta - truth))
        chord.append(abs(zeta0 + (zeta1 - zeta0) * (a - a0) / (a1 - a0) - truth))
    peak = branch["zeta"].max()
    assert max(cubic) < 3e-3 * peak
    assert max(chord) > 1e-2 * peak and max(chord) > 8 * max(cubic)


def test_table_is_that_of_a_run_on_every_rank(comm):
    told = []
    branch = fw.follow(mode("EPMC"), 0.1, 2.0, report_at=[0.5, 1.0], tell=told.append)
    assert branch.names == list(MODE) and len(branch) == len(told) and branch[3].items() <= told[3].items()
    assert [event.name for event in branch.events] == ["start", "report", "report", "stop"]
    np.testing.assert_allclose(branch["amplitude"][branch.met("report")], [0.5, 1.0], rtol=ROUNDING)
    assert branch.converged and branch.reason == "stop value reached" and branch.missed == []
    assert comm.allgather(branch["omega"].tobytes()) == comm.size * [branch["omega"].tobytes()]
    assert "stop value reached" in repr(branch) and "frequency_hz" in repr(branch)
    assert fw.follow(response(), 1.8, 1.9).names == list(FORCED)


def test_downwards_and_from_given_unknowns():
    problem = mode()
    down = fw.follow(problem, 2.0, 0.5)
    assert down["amplitude"][0] == pytest.approx(2.0) and down["amplitude"][-1] == pytest.approx(0.5)
    y = down.unknowns(3)
    up = fw.follow(problem, y, (0.5, 4.0))
    assert up["amplitude"][0] == pytest.approx(down["amplitude"][3], rel=ROUNDING)
    y.destroy()


def test_branch_that_breaks_off_is_kept_and_says_so():
    branch = fw.follow(mode(), 0.1, 4.0, steps=fw.StepControl(max_points=4))
    assert not branch.converged and branch.reason and 1 < len(branch) <= 6
    assert "before its end" in repr(branch)


def test_what_cannot_be_read_is_refused_in_words():
    branch = fw.follow(mode(), 0.1, 0.5, unknowns=False)
    for bad in ({}, {"slip": 0.5}, {"zeta": 0.1, "amplitude": 0.2}):
        with pytest.raises(fw.InputError, match="cannot be read"):
            branch.at(**bad)
    with pytest.raises(fw.InputError, match="no unknowns"):
        branch.unknowns(1)
    with pytest.raises(KeyError, match="zeta"):
        branch["damping"]
    problem = mode()
    kept = fw.follow(problem, 0.1, 0.5)
    problem.destroy()
    with pytest.raises(fw.InputError, match="destroyed"):
        kept.coefficients(1)
    with pytest.raises(fw.InputError, match="empty"):
        fw.follow(mode(), 0.5, 0.5)


@pytest.fixture(scope="module")
def branch():
    return fw.follow(mode(), 0.1, 0.5)


READINGS = [
    *(
        lambda branch, value=value: branch.at(value)
        for value in (np.inf, -np.inf, np.nan, "a", 1j, [0.2, None], [[1, 2], [3]])
    ),
    *(lambda branch, n=n: branch.curve(n) for n in (0, -1, 1.5, "8", None)),
    *(
        lambda branch, place=place: branch.unknowns(place)
        for place in ("1", None, [1], np.nan, np.ma.masked, np.array(["1"]))
    ),
    *(lambda branch, row=row: branch[row] for row in (slice(1, 3), [1, 2], 1.0, None)),
]


@pytest.mark.parametrize("number", range(len(READINGS)))
def test_places_that_no_branch_has_are_refused(branch, number):
    """Both ends were told as where it is infinite, and no part of a step drew nothing; the rest were NumPy's errors."""
    with pytest.raises(fw.InputError):
        READINGS[number](branch)


KINDS = {
    "float32": np.float32(0.25),
    "array": np.array(0.25),
    "list": [0.25],
    "matrix": np.array([[0.25]]),
    "tuple": (0.25,),
}


@pytest.mark.parametrize("value", KINDS.values(), ids=KINDS.keys())
def test_a_value_may_be_of_any_kind(branch, value):
    assert branch.at(value)["zeta"].tolist() == branch.at(0.25)["zeta"].tolist() != []


@pytest.mark.parametrize("kind", [np.float32, np.longdouble, np.array, lambda place: np.array([place])])
def test_a_place_may_be_one_in_an_array(branch, kind):
    """As `at` gives them."""
    one, other = branch.unknowns(kind(0.5)), branch.unknowns(0.5)
    assert np.array_equal(one.array, other.array)
    one.destroy(), other.destroy()


@pytest.mark.parametrize("given", [{"start": "a"}, {"start": None}, {"accuracy": "1e-3"}, {"observe": [0]}], ids=repr)
def test_what_cannot_be_followed_is_refused_in_words(given):
    with pytest.raises(fw.InputError):
        fw.follow(**{"problem": mode(), "start": 0.1, "stop": 0.5, **given})


def test_saved_branch_reads_as_before(shared_tmp, comm):
    branch = fw.follow(response(), 1.8, 3.2)
    branch.save(shared_tmp / "branch.h5")
    loaded = fw.Branch.load(shared_tmp / "branch.h5")
    for name in branch.names:
        np.testing.assert_array_equal(loaded[name], branch[name])
    assert (loaded.events, loaded.reason, loaded.converged) == (branch.events, branch.reason, branch.converged)
    np.testing.assert_array_equal(loaded.at(2.25)["amplitude"], branch.at(2.25)["amplitude"])
    with pytest.raises(fw.InputError, match="no unknowns"):
        loaded.unknowns(0)
    with pytest.raises(fw.InputError, match="no branch to read"):
        fw.Branch.load(shared_tmp / "nothing.h5")
    branch.to_csv(shared_tmp / "branch.csv")
    comm.barrier()
    again = np.genfromtxt(shared_tmp / "branch.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    np.testing.assert_array_equal(again["amplitude"], branch["amplitude"])


@pytest.mark.ranks(1)
def test_file_is_as_netcdf_wants_it(tmp_path):
    """Every dimension of every variable is a variable of its own in the same group, of that length."""
    branch = fw.follow(mode(), 0.1, 2.0)
    branch.save(tmp_path / "branch.h5")
    with h5py.File(tmp_path / "branch.h5") as file:
        for name, variable in file.items():
            if h5py.h5ds.is_scale(variable.id):
                continue
            scales = [axis[0] for axis in variable.dims]
            assert [scale.name.strip("/") in file for scale in scales] == variable.ndim * [True], name
            assert tuple(len(scale) for scale in scales) == variable.shape, name
            assert variable.attrs["long_name"]
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(tmp_path / "branch.h5", engine="h5netcdf") as found:
        np.testing.assert_array_equal(found["zeta"], branch["zeta"])
    assert branch.to_xarray()["omega"].attrs["units"] == "rad/s"


@pytest.mark.ranks(1)
@pytest.mark.parametrize("problem, ends", [(mode, (0.5, 4.0)), (response, (1.8, 3.2))])
def test_picture_runs_through_the_closed_form_between_the_points(problem, ends):
    branch = fw.follow(problem(), *ends, steps=steps(0.1))
    upper, lower = branch.plot().axes
    x, y = upper.lines[0].get_xydata().T
    assert len(x) > 5 * len(branch)
    if problem is mode:
        np.testing.assert_allclose(2 * np.pi * y, np.sqrt(stiffness(x) - C**2 / 4), rtol=1e-5)
        np.testing.assert_array_equal(lower.lines[1].get_xydata(), np.c_[branch["amplitude"], branch["zeta"]])
    else:
        w = 2 * np.pi * x
        assert np.abs(((stiffness(y) - w**2) ** 2 + (C * w) ** 2) * y**2 / 0.1**2 - 1).max() < 0.05


def test_continuation_hands_out_its_points_once():
    problem = mode()
    continuation = fw.Continuation(problem, problem.initial(0.1), (0.1, 1.0))
    first = next(iter(continuation))
    rest = list(continuation)
    assert [p.index for p in rest] == list(range(first.index + 1, rest[-1].index + 1))
    assert rest[-1].event == "stop" and list(continuation) == []
    continuation.destroy()
    assert list(continuation) == [] and "destroyed" in repr(continuation)


def test_points_freed_at_once_harm_no_branch_that_breaks_off():
    """At its end a branch looks back at its last point, to say what may help."""
    problem = mode()
    continuation = fw.Continuation(problem, problem.initial(0.1), (0.1, 4.0), fw.StepControl(max_points=3))
    for point in continuation:
        point.y.destroy()
        point.tangent.destroy()
    assert not continuation.converged and continuation.reason


@pytest.mark.parametrize("points", [0, 1])
def test_branch_of_no_point_or_one_is_kept_drawn_and_read(shared_tmp, comm, points):
    whole_branch = fw.follow(mode(), 0.1, 0.5)
    values = {name: whole_branch[name][:points] for name in MODE}
    z = whole_branch.curves.values[:points]
    curves = Cubic(z, z[:0], z[:0]) if points else cubic_of([])
    branch = fw.Branch(whole_branch.columns, values, whole_branch.meaning, curves, False, "why", comm=comm)
    branch.save(shared_tmp / "branch.h5")
    loaded = fw.Branch.load(shared_tmp / "branch.h5")
    assert len(loaded) == points == len(loaded.curve()) and loaded.reason == "why" and "why" in repr(loaded)
    (legend,) = branch.plot().legends
    assert "stopped short: why" in [text.get_text() for text in legend.get_texts()]
    if points:
        assert len(loaded.at(float(values["amplitude"][0]))) == 1 and len(loaded.at(0.3)) == 0
    else:
        with pytest.raises(fw.InputError, match="no points"):
            loaded.at(0.3)


def test_residual_and_jacobian_fill_what_is_given(two_dof, comm):
    """As SNES calls them: the same numbers, in the caller's Vec and Mat."""
    problem = mode_problem(oscillator(two_dof, comm), range(1, 6, 2), 64, start="stuck")
    with_stick, with_slip = problem.initial(0.02), problem.initial(1.0)
    r, J, dr = problem.residual(with_stick), problem.jacobian(with_stick), problem.residual(with_stick)
    assert problem.residual(with_slip, r) is r and problem.jacobian(with_slip, J) is J
    assert problem.jacobian_product(with_slip, with_stick, dr) is dr
    np.testing.assert_array_equal(whole(r), whole(problem.residual(with_slip)))
    np.testing.assert_array_equal(dense(J), dense(problem.jacobian(with_slip)))
    np.testing.assert_allclose(whole(dr), dense(J) @ whole(with_stick), rtol=TIGHT, atol=ROUNDING)


@pytest.mark.ranks(1)
def test_script_of_the_readme_runs_and_leaves_no_vec(tmp_path, launch):
    """Its blocks as they stand; at their end y, r and J are all that is the script's to free."""
    text = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    left = "\ny.destroy(), r.destroy(), J.destroy()\nfrom petsc4py import PETSc\nPETSc.garbage_view()\n"
    done = launch(1, "-c", "\n".join(blocks) + left, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("0.134  ") >= 3 and "Total entries: 0" in done.stdout
    assert (tmp_path / "backbone.png").exists() and (tmp_path / "backbone.h5").exists()


@pytest.mark.ranks(1)
@pytest.mark.parametrize("module", ["hb.states", "solve.table", "solve.follow", "solve.sweep", "cyclic.wheel_shape"])
def test_examples_of_the_docstrings(module):
    with np.printoptions(legacy=False):  # packages of other codes' files change how NumPy prints
        found = doctest.testmod(import_module(f"fretwave.{module}"), optionflags=doctest.ELLIPSIS)
    assert found.attempted > 0 and found.failed == 0
