"""A case whose amplitude is of a dof, of weighted dofs, or of a linear mode's coordinate: one curve over each."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from tolerances import ROUNDING, SOLVED

from fretwave.case.load import load_case
from fretwave.commands.show import show_run
from fretwave.errors import CaseErrors, InputError
from fretwave.plots import backbone, trajectories
from fretwave.results.reader import Run
from fretwave.run.order import RunOptions
from fretwave.run.runner import run_case

M, K = np.diag([1.0, 2.0, 0.5]), [[5.0, -2.0, 0.0], [-2.0, 6.0, -3.0], [0.0, -3.0, 4.0]]
#: Three masses, the middle one on a Jenkins element; what an amplitude is of: of `KINDS`.
TEXT = f"""
[model]
dofs = ["a", "b", "c"]
M = {M.tolist()}
K = {K}

[[contact]]
law = "jenkins"
pairs = ["b"]
tangential_stiffness = 2.0
friction_limit = 1.0
"""
#: The phase of what is named is zero: over another, samples lie elsewhere in the period and alias by N_t^-2.
ALIASED = 1e-6
KINDS = {"dof": '"c"', "row": '{ dofs = ["c", "a"], weights = [1.0, -0.5] }', "coordinate": "{ mode = 2 }"}
MODE = """
[[analysis]]
name = "{name}"
type = "mode"
linear_mode = {number}
normalise = {normalise}
harmonics = 3
samples = 4096
amplitude = [0.1, 12.0]
report_at = {report_at}
"""
FORCED = """
[[analysis]]
name = "forced"
type = "forced"
backbone = "coordinate"
force = { a = 1.0 }
levels = [0.1]
frequency = [0.2, 0.5]
observe = { mode = 2 }
harmonics = 3
samples = 96
"""
WHEEL = """
[model]
dofs = ["mass", "tip", "next"]
M = [[1.0, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.0]]
K = [[1.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.0, 0.0, 0.0]]
sectors = 6
low = ["mass"]
high = ["next"]

[[contact]]
law = "jenkins"
pairs = [["mass", "next"]]
tangential_stiffness = 1.0
friction_limit = 1.0
"""


def mode(name: str, normalise: str, report_at: object = (), number: int = 2, more: str = "") -> str:
    return MODE.format(name=name, normalise=normalise, report_at=list(report_at), number=number) + more


@pytest.fixture
def run(shared_tmp, comm):
    """The results of a case."""

    def make(text: str, folder: str = "run") -> Run:
        path = shared_tmp / "case.toml"
        if comm.rank == 0:
            path.write_text(text, encoding="utf-8")
        comm.barrier()
        assert run_case(path, RunOptions(out=shared_tmp / folder, plots=False), comm) == 0
        return Run(shared_tmp / folder)

    return make


def fundamental(analysis, points) -> np.ndarray:
    """Complex amplitudes (points, n_dof)."""
    Q, labels = analysis.coefficients(points), analysis.labels
    return Q[:, :, labels.index("1c")] - 1j * Q[:, :, labels.index("1s")]


def test_one_curve_over_a_dof_a_row_and_a_coordinate(run):
    """At the amplitudes of the dof that reported points of the others have, its own branch has omega and zeta."""
    at = [0.6, 4.0, 10.0]
    others = {name: given for name, given in KINDS.items() if name != "dof"}
    first = run(TEXT + "".join(mode(name, given, at) for name, given in others.items()), "first")
    reached = {name: np.abs(fundamental(first[name], first[name].met("report"))[:, 2]) for name in others}
    wanted = sorted(float(f"{a!r}") for found in reached.values() for a in found)
    dof = run(TEXT + mode("dof", KINDS["dof"], wanted), "second")["dof"]
    amplitude, rows = dof["amplitude"], np.array(dof.met("report"))
    for name, found in reached.items():
        points = first[name].met("report")
        assert len(points) == len(at) and (first[name]["slip"][points] > 0).any()
        same = [rows[np.argmin(np.abs(amplitude[rows] - a))] for a in found]
        np.testing.assert_allclose(amplitude[same], found, rtol=1e-9)
        np.testing.assert_allclose(first[name]["omega"][points], dof["omega"][same], rtol=ALIASED)
        np.testing.assert_allclose(first[name]["zeta"][points], dof["zeta"][same], atol=ALIASED)


def test_amplitudes_are_those_of_what_is_named(run):
    """w . q and phi^T M q, real at every point; units and names go with them."""
    found = run(TEXT + "".join(mode(name, given) for name, given in KINDS.items()))
    weights = {"dof": np.array([0.0, 0, 1]), "row": np.array([-0.5, 0, 1])}
    stuck = np.array(K) + np.diag([0.0, 2.0, 0.0])
    values, shapes = np.linalg.eigh(np.diag(np.diag(M) ** -0.5) @ stuck @ np.diag(np.diag(M) ** -0.5))
    phi = np.diag(np.diag(M) ** -0.5) @ shapes[:, 1]
    weights["coordinate"] = M @ phi * np.sign(phi @ M @ fundamental(found["coordinate"], [0])[0].real)
    units = {"dof": "m", "row": "m", "coordinate": "sqrt(kg) m"}
    for name, row in weights.items():
        analysis = found[name]
        q = fundamental(analysis, None) @ row
        np.testing.assert_allclose(q, analysis["amplitude"], rtol=SOLVED, atol=SOLVED)
        assert analysis.unit("amplitude") == units[name]
        x = np.random.default_rng(2).standard_normal((4, 3))
        np.testing.assert_allclose(np.abs(analysis.along(x)), np.abs(x @ row), rtol=SOLVED)
    assert [found[name].observed() for name in KINDS] == ["c", "c - 0.5 a", "mode 2"]
    start = found["coordinate"]
    np.testing.assert_allclose(start["omega"][0], np.sqrt(values[1]), rtol=SOLVED)
    np.testing.assert_allclose(start["energy"][0], energy(start, 0, np.array(K)), rtol=ROUNDING)


def energy(analysis, point: int, stiffness: np.ndarray) -> float:
    """Mean of kinetic and elastic energy of a point that oscillates in one harmonic."""
    q, omega0 = fundamental(analysis, [point])[0], analysis["omega0"][point]
    return float(omega0**2 * (q.conj() @ M @ q).real + (q.conj() @ stiffness @ q).real) / 4


@pytest.mark.ranks(1)
def test_units_and_names_reach_pictures_tables_and_peaks(run, shared_tmp, capsys):
    found = run(TEXT + mode("dof", KINDS["dof"]) + mode("coordinate", KINDS["coordinate"]) + FORCED)
    told = (shared_tmp / "run" / "run.log").read_text()
    assert "amplitude 12 " not in told and "a    0.1 sqrt(kg) m" in " ".join(told.split("  "))
    assert "peak a = " in told and "from coordinate" in told and "sqrt(kg) m at" in told
    drawn = dict(backbone.figures(found))
    assert set(drawn) == {"dof_backbone", "coordinate_backbone"}, "not two amplitudes on one axis"
    assert drawn["coordinate_backbone"].axes[1].get_xlabel() == "Modal amplitude of mode 2 [sqrt(kg) m]"
    assert "[m]" in trajectories.draw(found["coordinate"]).axes[0].get_xlabel()
    show_run(shared_tmp / "run")
    assert "0.1 - 12 sqrt(kg) m" in capsys.readouterr().out
    with h5py.File(shared_tmp / "run" / "results.h5") as file:
        kept = file["coordinate/amplitude_row"]
        assert kept.shape == (3,) and kept.attrs["units"] == "sqrt(kg)" and "amplitude_row" not in file["dof"]


@pytest.mark.parametrize(
    "given, waves", [('{ dofs = ["tip", "mass"], weights = [1.0, -1.0] }', 1), ("{ mode = 1 }", 3)]
)
def test_on_a_sector(run, given, waves):
    """A row in a wave that runs, a coordinate in one that stands still: the curve over the dof."""
    wave = f"nodal_diameter = {waves}\n"
    one = run(WHEEL + mode("other", given, [0.5, 3.8], 1, wave), "first")["other"]
    points = one.met("report")
    reached = np.abs(fundamental(one, points)[:, 1])
    dof = run(WHEEL + mode("dof", '"tip"', reached.tolist(), 1, wave).replace("12.0]", "40.0]"), "second")["dof"]
    same = dof.met("report")
    assert one["slip"][points].max() > 0
    np.testing.assert_allclose(dof["amplitude"][same], reached, rtol=1e-9)
    np.testing.assert_allclose(one["omega"][points], dof["omega"][same], rtol=ALIASED)
    np.testing.assert_allclose(one["zeta"][points], dof["zeta"][same], atol=ALIASED)


DECAY = '[[analysis]]\nname = "decay"\ntype = "free_decay"\nmode = "m"\namplitude = [0.5]\nperiods = 8\n'
ROW = '{ dofs = ["c", "a"], weights = [1.0, -1.0] }'
WRONG = {
    "no such dof": ('{ dofs = ["c", "d"], weights = [1.0, 1.0] }', "", "unknown dof 'd'"),
    "other length": ('{ dofs = ["c"], weights = [1.0, 2.0] }', "", "m.normalise.weights has 2 numbers"),
    "no weights": ('{ dofs = ["c"] }', "", "m.normalise has no weights"),
    "nothing": ("{}", "", "m.normalise has no dofs"),
    "twice": ('{ dofs = ["c", "c"], weights = [1.0, 2.0] }', "", "is named twice"),
    "zero": ('{ dofs = ["c"], weights = [0.0] }', "", "m.normalise.weights is zero"),
    "no such mode": ("{ mode = 4 }", "", "m.normalise.mode does not exist"),
    "mode 0": ("{ mode = 0 }", "", "m.normalise.mode has a wrong value"),
    "both": ('{ mode = 1, dofs = ["a"] }', "", "names a mode and dofs"),
    "unknown key": ("{ modes = 1 }", "", "unknown key 'modes'"),
    "a number": ("1.5", "", "m.normalise has a wrong value"),
    "in time": ("{ mode = 2 }", DECAY, "decay.mode is followed over a modal coordinate"),
    "other peaks": (ROW, FORCED.replace('"coordinate"', '"m"'), "forced.backbone is over another amplitude"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_is_refused(tmp_path: Path, name: str) -> None:
    given, more, said = WRONG[name]
    path = tmp_path / "case.toml"
    path.write_text(TEXT + mode("m", given) + more)
    with pytest.raises(CaseErrors) as caught:
        load_case(path)
    [problem] = [p for p in caught.value.problems if "time integration" not in p.what]  # which knows no Jenkins element
    assert said in problem.what and problem.where and problem.expected and problem.fix
    assert '{"' not in problem.render(), "tables as TOML writes them"


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    "given, keys, said",
    [
        ("{ mode = 1 }", "nodal_diameter = 1\n", "is a complex coordinate in a wave that runs"),
        ("{ mode = 1 }", "nodal_diameter = 3\nwheel = true\n", "is not seen in every sector of a wheel"),
        ('{ dofs = ["tip"], weights = [1.0] }', "nodal_diameter = 1\nwheel = true\n", "is not seen in every sector"),
    ],
)
def test_what_has_no_meaning_on_a_wheel_is_refused(tmp_path, given, keys, said):
    path = tmp_path / "case.toml"
    path.write_text(WHEEL + mode("m", given, (), 1, keys))
    with pytest.raises(CaseErrors) as caught:
        load_case(path)
    [problem] = caught.value.problems
    assert said in problem.what and problem.fix


@pytest.mark.parametrize("given", ["{ mode = 1 }", '{ dofs = ["a", "b"], weights = [1.0, 1.0] }'])
def test_what_the_starting_mode_does_not_move_is_refused(shared_tmp, comm, given):
    """Two equal masses out of phase, and a mode orthogonal to that which is followed; whatever the weights' size."""
    pair = '[model]\ndofs = ["a", "b"]\nM = [[1.0, 0.0], [0.0, 1.0]]\nK = [[2.0, -1.0], [-1.0, 2.0]]\n'
    path = shared_tmp / "case.toml"
    if comm.rank == 0:
        path.write_text(pair + mode("m", given))
    comm.barrier()
    with pytest.raises(InputError) as caught:
        run_case(path, RunOptions(out=shared_tmp / "run", plots=False), comm)
    assert "does not move in the starting mode" in caught.value.render() and caught.value.fix
    assert "analysis 'm'" in caught.value.render()


@pytest.mark.ranks(1)
def test_a_decay_is_seen_along_a_row(run):
    """Of one mode without contact: its own frequency in every cycle."""
    linear = TEXT.partition("[[contact]]")[0].replace("K =", "mass_damping = 0.02\nK =")
    found = run(linear + mode("m", ROW, (), 1) + DECAY)
    decay, frequency = found["decay"], found["m"]["omega"][0]
    assert decay.observed() == "c - a"
    np.testing.assert_allclose(decay["omega"], frequency, rtol=1e-6)
    np.testing.assert_allclose(decay["omega_mode"], decay["omega"], rtol=1e-6)
