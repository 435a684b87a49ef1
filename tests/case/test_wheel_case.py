"""Whole wheels from case files: tuned ones against one sector, mistuned ones against dense matrices, bad input."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.linalg
from models.core_models import dense, unknowns, whole
from models.cyclic_models import BLADE_1, BLADE_2, MASSES, NEIGHBOUR, blisk_stiffness
from mpi4py import MPI
from petsc4py import PETSc
from tolerances import LAST_DIGITS, REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.analyses.parts.context import AnalysisContext
from fretwave.analyses.parts.wheel_start import start_of
from fretwave.case.build import build_model
from fretwave.case.load import load_case
from fretwave.case.wheel import deviations_of, on_wheel
from fretwave.console import Console
from fretwave.errors import CaseErrors
from fretwave.post.wave_content import participation
from fretwave.run.order import RunOptions
from fretwave.run.runner import run_case

N = 6
STIFFNESS = np.zeros((4, 4))
STIFFNESS[:3, :3] = blisk_stiffness(0, N)
STIFFNESS[np.ix_([0, 3], [0, 3])] += NEIGHBOUR * np.array([[1, -1], [-1, 1]])
BLADE = np.array([[BLADE_1, -BLADE_1, 0], [-BLADE_1, BLADE_1 + BLADE_2, -BLADE_2], [0, -BLADE_2, BLADE_2]])
#: Six sectors of the lumped blisk; tips rub on the casing.
BUILDER = f"""
import numpy as np
from fretwave import Pairs, Structure

def build():
    blade = np.zeros((4, 4))
    blade[:3, :3] = {BLADE.tolist()}
    casing = Pairs(np.array([[0, 0, 1.0, 0]]), 1, {{"tangential_stiffness": 1e5, "friction_limit": 2.0}})
    return Structure(np.diag([*{MASSES}, 0.0]), {STIFFNESS.tolist()},
                      dofs={{"disk": 0, "blade": 1, "tip": 2, "next": 3}}, pairs={{"casing": casing}},
                      sectors={N}, low=np.array([0]), high=np.array([3]), parts={{"blade": blade}})
"""
MODE = """
[[analysis]]
name = "{name}"
type = "mode"
linear_mode = 1
normalise = "tip"
harmonics = 3
samples = 240
amplitude = [1e-5, 1e-3]
report_at = [3e-5, 2e-4]
{keys}
"""
TEXT = """
[model]
builder = "model.py"

[[contact]]
name = "casing"
law = "jenkins"
"""
WHEEL = "wheel = true\nnodal_diameter = 2"
MISTUNED = 'wheel = true\nnodal_diameter = 2\nmistuning = { of = "blade", standard_deviation = 0.02, seed = 3 }'

#: Of a mistuned mode: only a short way into slip, where the largest blade alone slips.
SHORT = ("mode.amplitude=[1e-5,4.5e-5]", "mode.report_at=[2.5e-5,4e-5]")


def case_file(folder, **analyses):
    """A case with these mode analyses, each given by its keys."""
    (folder / "model.py").write_text(BUILDER, encoding="utf-8")
    path = folder / "case.toml"
    path.write_text(TEXT + "".join(MODE.format(name=k, keys=v) for k, v in analyses.items()), encoding="utf-8")
    return path


def run(comm, folder, *overrides, **analyses):
    """Run the case on all ranks of `comm`; tables of its analyses and the run folder."""
    folder = Path(comm.bcast(str(folder)))
    path = case_file(folder, **analyses) if comm.rank == 0 else folder / "case.toml"
    comm.barrier()
    out = folder / f"ranks_{comm.size}"
    assert run_case(path, RunOptions(out, list(overrides), plots=False), comm) == 0
    comm.barrier()
    return {name: table(out / f"{name}.csv") for name in analyses}, out


def table(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([r[key] if key == "event" else float(r[key]) for r in rows]) for key in rows[0]}


def at_reports(columns, key):
    return columns[key][columns["event"] == "report"]


def tuned(comm, folder, keys):
    """The case with one mode analysis, and this analysis, on every rank."""
    case = comm.bcast(load_case(case_file(folder, mode=keys)) if comm.rank == 0 else None)
    return case, case.analyses["mode"]


def sector_stiffness(diameters):
    """Of a wave, with stuck tips."""
    return blisk_stiffness(diameters, N) + np.diag([0, 0, 1e5])


def dense_wheel(deviations):
    """Frequencies [rad/s] and shapes of the stuck wheel, assembled sector by sector without the package."""
    K = np.kron(np.eye(N), sector_stiffness(0) + np.diag([2 * NEIGHBOUR, 0, 0]))
    for j in range(N):
        K[3 * j : 3 * j + 3, 3 * j : 3 * j + 3] += deviations[j] * BLADE
        for other in ((j - 1) % N, (j + 1) % N):
            K[3 * j, 3 * other] -= NEIGHBOUR
    square, shapes = scipy.linalg.eigh(K, np.kron(np.eye(N), np.diag(MASSES)))
    return np.sqrt(square), shapes


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("keys", [WHEEL, WHEEL.replace("2", "-2"), WHEEL + "\nsector = 4"], ids=["on", "back", "other"])
def test_a_tuned_wheel_begins_where_one_sector_does(comm, tmp_path, keys):
    """In slip, without a way of its own: Newton has nothing left to do there."""
    keys_of = {"sector": "nodal_diameter = 2", "wheel": keys}
    short = [f"{name}.{key}" for name in keys_of for key in ("amplitude=[2e-4,1e-3]", "report_at=[5e-4]")]
    found, out = run(comm, tmp_path, *short, **keys_of)
    first = {name: {key: values[0] for key, values in rows.items()} for name, rows in found.items()}
    assert first["wheel"]["newton"] <= 1 and first["wheel"]["slip"] > 0.2
    for key in ("amplitude", "omega", "beta"):
        assert first["wheel"][key] == pytest.approx(first["sector"][key], rel=SOLVED)
    if comm.rank == 0:
        assert "on one sector the mode was followed" in (out / "run.log").read_text()


@pytest.mark.ranks(1, 2, 3, 4)
def test_tuned_wheel_follows_its_sector(comm, tmp_path):
    """omega and beta to 1e-8 on any number of ranks, forward and backward; the unfolding vanishes."""
    found, out = run(comm, tmp_path, sector="nodal_diameter = 2", wheel=WHEEL, backward=WHEEL.replace("2", "-2"))
    omega = found["sector"]["omega"][0]
    for name in ("wheel", "backward"):
        for key in ("omega", "beta"):
            assert at_reports(found[name], key) == pytest.approx(at_reports(found["sector"], key), abs=REPEATED * omega)
        assert len(at_reports(found[name], "omega")) == 2 and found[name]["unfolding"].max() < ROUNDING
        for key in ("participation", "diameters_share", "amplification"):
            assert found[name][key][0] == pytest.approx(1.0, abs=SOLVED)
    assert set(found["wheel"]["diameters"]) == {2} and set(found["backward"]["diameters"]) == {-2}
    assert max(found["wheel"]["zeta"]) > 1e-3 and min(found["wheel"]["stick"]) < 0.5
    record = json.loads((out / "run.json").read_text())["analyses"]["wheel"]["wheel"]
    assert record["largest_unfolding"] == found["wheel"]["unfolding"].max() and record["normalise"] == "tip@0"


@pytest.mark.ranks(1)
def test_every_point_of_the_wheel_lies_on_the_branch_of_its_sector(comm, tmp_path):
    """At every point: the sector's branch is taken at the wheel's amplitudes."""
    wheel = run(comm, tmp_path, wheel=WHEEL)[0]["wheel"]
    inside = [float(a) for a in np.unique(wheel["amplitude"][1:-1])]
    sector = run(comm, tmp_path, f"sector.report_at={inside}", sector="nodal_diameter = 2")[0]["sector"]
    for a, omega, beta in zip(*(wheel[key] for key in ("amplitude", "omega", "beta"))):
        apart = np.maximum(np.abs(sector["omega"] - omega), np.abs(sector["beta"] - beta)) / omega
        assert apart[np.isclose(sector["amplitude"], a, rtol=ROUNDING)].min() < REPEATED


@pytest.mark.ranks(1)
def test_standing_wave_is_free_of_its_unfolding(comm, tmp_path):
    """A sector that is its own mirror image: by symmetry a wave with its crest on a sector stands."""
    found, out = run(comm, tmp_path, standing=WHEEL + '\nwave = "standing"\nsector = 1')
    standing, waves = found["standing"], table(out / "standing_diameters.csv")
    assert standing["unfolding"].max() < 1e-11 and max(standing["zeta"]) > 1e-3
    assert set(standing["largest_sector"]) == {1}  # and 4, as large
    assert standing["participation"][0] == pytest.approx(2 / 3, rel=SOLVED)
    assert standing["amplification"][0] == pytest.approx(np.sqrt(2), rel=SOLVED)
    forward, backward = (waves["share"][waves["nodal_diameter"] == k] for k in (2, -2))
    assert forward == pytest.approx(backward, rel=SOLVED) and forward.min() > 0.49


@pytest.mark.ranks(2, 3, 4)
def test_mistuned_branch_is_the_same_on_any_number_of_ranks(comm, tmp_path):
    found = run(comm, tmp_path, *SHORT, mode=MISTUNED)[0]["mode"]
    alone = run(MPI.COMM_SELF, tmp_path, *SHORT, mode=MISTUNED)[0]["mode"] if comm.rank == 0 else None
    alone = comm.bcast(alone)
    assert at_reports(alone, "omega").size == 2 and max(alone["zeta"]) > 1e-3
    for key in ("omega", "beta"):
        assert at_reports(found, key) == pytest.approx(at_reports(alone, key), abs=REPEATED * alone["omega"][0])
    for key in ("amplification", "participation", "diameters_share"):
        assert at_reports(found, key) == pytest.approx(at_reports(alone, key), rel=1e-7)


@pytest.mark.parametrize("fits", [True, False])
def test_mistuned_branch_starts_from_the_mode_most_like_the_wave(comm, tmp_path, monkeypatch, fits):
    """Linear limit: a dense eigenproblem assembled apart; the share of each of its modes in the tuned pair.

    Where a factor of the wheel does not fit its modes are those in all the tuned waves, of 3 dofs all there are.
    """
    monkeypatch.setattr("fretwave.model.modes.factor_fits", lambda model: fits or model.n_dof == 3)
    found, out = run(comm, tmp_path, *SHORT, mode=MISTUNED)
    case = on_wheel(*tuned(comm, tmp_path, MISTUNED))
    omega, shapes = dense_wheel(case.wheel.deviations)
    own = scipy.linalg.eigh(sector_stiffness(2), np.diag(MASSES))[1][:, 0]
    pair = np.kron(np.exp(-4j * np.pi * np.arange(N) / N), own) / np.sqrt(N)
    chosen = int(np.argmax(np.abs(pair.conj() @ np.kron(np.eye(N), np.diag(MASSES)) @ shapes)))
    assert found["mode"]["omega"][0] == pytest.approx(omega[chosen], rel=TIGHT)
    assert found["mode"]["stick"][0] == 1
    with h5py.File(out / "results.h5", "r") as file:
        group = file["mode"]
        q, place = group["coefficients"][0][:, 0], [t.decode() for t in group["dof"]].index(group.attrs["normalise"])
    assert q == pytest.approx(1e-5 * shapes[:, chosen] / shapes[place, chosen], abs=ROUNDING)
    blades = np.abs(shapes[2::3, chosen])
    assert place == 3 * np.argmax(blades) + 2
    assert found["mode"]["participation"][0] == pytest.approx(participation(blades), rel=REPEATED)
    tip = abs(own[2]) / np.sqrt(N)
    assert found["mode"]["amplification"][0] == pytest.approx(blades.max() / tip, rel=REPEATED)


@pytest.mark.ranks(1)
def test_branch_keeps_its_orientation_past_kinks(comm, tmp_path):
    """A second blade begins to slip beside its resonance: a kink that turns the branch by more than a right angle.

    On a piecewise smooth path the determinant of the Jacobian over the tangent keeps its sign (Allgower and Georg,
    Numerical Continuation Methods, 1990, chapter 15); here the branch turns back at 4.05e-5 m and on at 3.08e-5 m.
    """
    case, analysis = tuned(comm, tmp_path, MISTUNED)
    case = on_wheel(case, analysis)
    with build_model(case, (), comm) as model:
        console = Console(False, lambda line: None)
        start = start_of(AnalysisContext(model, case, analysis, comm, tmp_path, console))
        problem = fw.NonlinearMode(model, fw.Harmonics([1, 3], 240), "CNM", start.dof, start.mode, "kink_")
        PETSc.Options()["kink_route"] = "direct"
        branch = fw.Continuation(problem, problem.initial(1e-5), (9e-6, 6e-5), fw.StepControl(max_points=80))
        points = [p for p in branch if not p.event]  # those located inside a step have no orientation
        signs = {np.sign(np.linalg.det(np.vstack([dense(problem.jacobian(p.y)), whole(p.tangent)]))) for p in points}
        tangents = [whole(p.tangent) / np.linalg.norm(whole(p.tangent)) for p in points]
    assert branch.converged and len(signs) == 1
    amplitudes = np.array([p.parameter for p in points])
    assert (np.diff(amplitudes) < 0).any() and amplitudes[-1] == amplitudes.max()
    assert min(a @ b for a, b in zip(tangents, tangents[1:])) < -0.1


@pytest.mark.ranks(1)
def test_modes_of_a_mistuned_wheel_by_number(comm, tmp_path):
    keys = MISTUNED.replace("nodal_diameter = 2\n", "")
    numbered = {f"m{k}": keys.replace("wheel = true", f"wheel = true\nlinear_mode = {k}") for k in (1, 4, 9)}
    text = case_file(tmp_path, **numbered).read_text().replace("linear_mode = 1\nnormalise", "normalise")
    (tmp_path / "case.toml").write_text(text)
    short = [f"{name}.{key}" for name in numbered for key in ("amplitude=[1e-5,2e-5]", "report_at=[]")]
    assert run_case(tmp_path / "case.toml", RunOptions(tmp_path / "out", short, plots=False), comm) == 0
    expected = dense_wheel(deviations_of(load_case(tmp_path / "case.toml").analyses["m1"].mistuning, N))[0]
    for name in numbered:
        assert table(tmp_path / "out" / f"{name}.csv")["omega"][0] == pytest.approx(
            expected[int(name[1:]) - 1], rel=SOLVED
        )


@pytest.mark.ranks(1)
def test_mistuned_modes_tend_to_the_tuned_ones(comm, tmp_path):
    """The frequency linearly in the deviation, the part of the shape outside the tuned pair quadratically."""
    case, _ = tuned(comm, tmp_path, WHEEL)
    omega, share = [], []
    reference = np.sqrt(scipy.linalg.eigh(sector_stiffness(2), np.diag(MASSES))[0][0])
    for scale in (1e-4, 1e-5, 1e-6):
        short = ["mode.amplitude=[1e-5,1.1e-5]", "mode.report_at=[]"]
        keys = f"mode.mistuning.standard_deviation={scale}"
        found = run(comm, tmp_path, *short, keys, mode=MISTUNED)[0]["mode"]
        omega.append(abs(found["omega"][0] / reference - 1))
        share.append(1 - 2 * found["diameters_share"][0])
    assert omega[0] / omega[1] == pytest.approx(10, rel=0.05) and omega[1] / omega[2] == pytest.approx(10, rel=0.01)
    assert share[0] / share[1] == pytest.approx(100, rel=0.2) and share[1] / share[2] == pytest.approx(100, rel=0.02)
    assert case.wheel is None


@pytest.mark.ranks(1)
def test_stiffness_of_a_mistuned_wheel(comm, tmp_path):
    """sum_j (1 + delta_j) T_j^T K T_j: a sector's tie to the next one deviates with the sector."""
    delta = [0.1, -0.2, 0.3, 0.0, 0.05, -0.1]
    keys = f"wheel = true\nnodal_diameter = 2\nmistuning = {{ deviations = {delta} }}"
    case = on_wheel(*tuned(comm, tmp_path, keys))
    expected = np.zeros((3 * N, 3 * N))
    for j, d in enumerate(delta):
        places = [3 * j, 3 * j + 1, 3 * j + 2, 3 * ((j + 1) % N)]
        expected[np.ix_(places, places)] += (1 + d) * STIFFNESS
    assert np.allclose(case.K.toarray(), expected, rtol=LAST_DIGITS, atol=1e-6)
    assert case.dofs[3:6] == ["disk@1", "blade@1", "tip@1"] and case.places("tip") == list(range(2, 18, 3))
    damper = type("D", (), {"dof": "tip", "c": 2.0})
    assert case.damping_with([damper]).diagonal().tolist() == [0, 0, 2.0] * N


@pytest.mark.ranks(1)
def test_pictures_show_the_tables(comm, tmp_path):
    """Bars of sectors and waves are the numbers of the two tables; a mode that localises gets a second picture."""
    from fretwave.plots import plot_run
    from fretwave.plots.wheel import draw_sectors
    from fretwave.results.reader import Run

    _, out = run(comm, tmp_path, *SHORT, mode=MISTUNED, tuned=WHEEL)
    names = {path.stem for path in plot_run(out, ["wheel"])}
    assert names == {"mode_sectors", "mode_localisation", "tuned_sectors"}
    figure = draw_sectors(Run(out).analyses["mode"])
    sectors, waves = (table(out / f"mode_{kind}.csv") for kind in ("sectors", "diameters"))
    left, right = (figure.axes[k].patches for k in (0, 1))
    first = sectors["sector_amplitude"][sectors["point"] == 0]
    heights = np.array([bar.get_height() for bar in left])
    assert heights / heights.max() == pytest.approx(first / first.max(), rel=SOLVED)
    assert heights.max() == pytest.approx(table(out / "mode.csv")["amplification"][0], rel=SOLVED)
    shares = waves["share"][waves["point"] == 0]
    assert [bar.get_height() for bar in right] == pytest.approx(list(shares), abs=ROUNDING)


#: (keys of the analysis, what is said)
WRONG = {
    "part": (MISTUNED.replace('"blade"', '"blad"'), r"is no part of the stiffness(?s:.*)did you mean"),
    "count": (
        "wheel = true\nnodal_diameter = 1\nmistuning = { deviations = [0.1, 0.2] }",
        r"has 2 numbers(?s:.*)6 num",
    ),
    "both": (MISTUNED.replace("seed = 3", "deviations = [0, 0, 0, 0, 0, 0]"), "is given beside deviations"),
    "neither": ("wheel = true\nnodal_diameter = 1\nmistuning = { seed = 2 }", "says no deviations"),
    "no wheel": (MISTUNED.replace("wheel = true\n", ""), "needs the whole wheel"),
    "sector": (WHEEL + "\nsector = 6", r"does not exist(?s:.*)0 to 5"),
    "sector alone": ("nodal_diameter = 1\nsector = 2", "needs the whole wheel"),
    "standing sector": ('nodal_diameter = 1\nwave = "standing"', "needs the whole wheel"),
    "stands anyway": ('wheel = true\nnodal_diameter = 3\nwave = "standing"', "cannot be told apart"),
    "backward standing": ('wheel = true\nnodal_diameter = -1\nwave = "standing"', "cannot be told apart"),
    "standing mistuned": (MISTUNED + '\nwave = "standing"', "is of a tuned wheel"),
    "no diameters": ("wheel = true", "says no nodal diameter"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_wheel_is_said(tmp_path, wrong):
    keys, message = wrong
    with pytest.raises(CaseErrors, match=message):
        load_case(case_file(tmp_path, mode=keys))


@pytest.mark.ranks(1)
def test_a_whole_structure_is_no_wheel(tmp_path):
    path = case_file(tmp_path, mode="wheel = true")
    model = tmp_path / "model.py"
    model.write_text(model.read_text().replace(f"sectors={N}, low=np.array([0]), high=np.array([3]), ", ""))
    with pytest.raises(CaseErrors, match="is of no sector of a wheel"):
        load_case(path)


@pytest.mark.ranks(1)
def test_committed_wheel_lies_on_the_branch_of_its_sector(comm, tmp_path):
    """On the lumped blisk, at every point from stick to slip: the sector solved from sector 0 of the wheel."""
    path = Path(__file__).parents[2] / "cases" / "blisk_lumped" / "case.toml"
    options = RunOptions(tmp_path, ["mode_wheel.amplitude=[1e-4,3e-3]"], ["mode_wheel"], quick=True, plots=False)
    assert run_case(path, options, comm) == 0
    wheel, case = table(tmp_path / "mode_wheel.csv"), load_case(path)
    with h5py.File(tmp_path / "results.h5", "r") as file:
        coefficients = file["mode_wheel"]["coefficients"][:, : len(case.dofs)]
    with build_model(case, (), comm, nodal_diameter=4) as model:
        stuck = fw.linear_modes(model, 3)[2]
        problem = fw.NonlinearMode(model, fw.Harmonics([1], 480), "CNM", 0, stuck)
        columns = (wheel[key] for key in ("amplitude", "omega", "beta", "event"))
        for a, omega, beta, event, Q in zip(*columns, coefficients):
            y = np.concatenate([Q.ravel() / a, [beta / stuck.omega, omega / stuck.omega, np.log(a)]])
            start = unknowns(problem, y)
            assert problem.residual(start).norm() < 1e-10
            if "fold" in event:  # singular at this amplitude: rounding leads onto the other leg or not
                continue
            branch = fw.Continuation(problem, start, (0.5 * a, 2 * a))
            point = next(iter(branch))
            state, slope = problem.state(point.y), min(1.0, abs(whole(point.tangent)[-1]))  # 0 at a fold
            assert state["amplitude"] == pytest.approx(a, rel=ROUNDING)
            assert state["omega"] == pytest.approx(omega, rel=REPEATED / slope)
            assert state["beta"] == pytest.approx(beta, abs=REPEATED * omega / slope)
    assert len(coefficients) > 20 and wheel["unfolding"].max() < 1e-11 and max(wheel["zeta"]) > 5e-3
