"""Friction in a plane: the uncoupled law in space whose second tangent is held, to the last digit; and from a case."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from models.core_models import chain, dense, derivative, unknowns, whole
from tolerances import LAST_DIGITS, REPEATED, ROUNDING, SOLVED

import fretwave as fw

PARAMETERS = {"normal_stiffness": 8.0, "tangential_stiffness": 5.0, "friction_coefficient": 0.4, "normal_load": 1.0}


def problem_of(comm, law, method="CNM", orders=(0, 1, 2), samples=64):
    """Three masses with two dofs each; a pair at two of them, along both."""
    rows = np.eye(6)[[0, 1, 4, 5]]
    if law != "coulomb_2d":
        rows = np.insert(rows, [2, 4], np.zeros(6), axis=0)
    contact = fw.Contact(law, rows, PARAMETERS)
    model = fw.Model(np.eye(6), chain(6, ground=1.0), 0.02 * np.eye(6), [contact], comm)
    return fw.NonlinearMode(model, fw.Harmonics(orders, samples), method, 1, fw.linear_modes(model, 1)[0])


def random_point(problem, seed=0):
    rng = np.random.default_rng(seed)
    q = 0.4 * rng.standard_normal(problem.model.n_dof * problem.harmonics.block_size)
    return np.concatenate([q, [0.05, 1.1, -0.2]])


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_law_in_space_with_one_tangent_held(comm, seed):
    plane, space = (problem_of(comm, law) for law in ("coulomb_2d", "coulomb_3d_uncoupled"))
    y, dy = random_point(plane, seed), random_point(plane, seed + 10)
    for act in (
        lambda p: whole(p.residual(unknowns(p, y))),
        lambda p: whole(p.jacobian_product(unknowns(p, y), unknowns(p, dy))),
        lambda p: dense(p.jacobian(unknowns(p, y))),
    ):
        np.testing.assert_allclose(act(plane), act(space), rtol=0, atol=LAST_DIGITS)
    one, other = (p.diagnostics(unknowns(p, y)) for p in (plane, space))
    assert one["slip"] > 0 and one["open"] > 0
    assert one == pytest.approx(other, rel=ROUNDING)


def test_derivatives(comm):
    problem = problem_of(comm, "coulomb_2d")
    y = random_point(problem, 3)

    def residual(at):
        return whole(problem.residual(unknowns(problem, at)))

    expected = np.column_stack([derivative(residual, y, e) for e in np.eye(len(y))])
    J = dense(problem.jacobian(unknowns(problem, y)))
    assert np.allclose(J, expected, rtol=0, atol=REPEATED * np.abs(expected).max())


@pytest.mark.ranks(1)
def test_a_branch_is_that_of_the_law_in_space(comm):
    """Whatever the number of samples: neither law is sampled."""

    def branch(law, samples):
        found = fw.follow(problem_of(comm, law, samples=samples), 0.02, 0.51, report_at=[0.1, 0.5], errors=False)
        return np.array([[found[k][name] for name in ("omega", "zeta")] for k in found.met("report")])

    exact = branch("coulomb_2d", 6)
    for law, samples in (("coulomb_2d", 64), ("coulomb_3d", 6), ("coulomb_3d", 64)):
        assert exact == pytest.approx(branch(law, samples), abs=SOLVED)


def test_sliders_of_a_pair_in_a_plane(comm):
    """K x + kt (x - w) = P along the tangent."""
    contact = fw.Contact("coulomb_2d", [[0.0, 0.0], [0.0, 1.0]], PARAMETERS, "pad")
    with fw.Model(np.eye(2), 2 * np.eye(2), None, [contact], comm) as model:
        rest = fw.static_preload(model, [0.0, 0.3], sliders={"pad": [[0.02]]})
    assert rest.displacement[1] == pytest.approx((0.3 + 5 * 0.02) / 7, rel=ROUNDING)
    assert rest.sliders["pad"] == pytest.approx(0.02) and rest.sliders["pad"].shape == (1, 1)


def test_worn_depth_is_gap(comm):
    info = fw.laws()["coulomb_2d"]
    assert (info.components, info.normal, info.wears, info.memory) == (2, 0, True, True)


CASE = """
[model]
dofs = ["n", "t", "d"]
M = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
K = [[4.0, 0.0, 0.0], [0.0, 4.0, -1.0], [0.0, -1.0, 3.0]]

[[contact]]
name = "pad"
law = "coulomb_2d"
pairs = ["n"]
tangents = [["d", "t"]]
normal_stiffness = 8.0
tangential_stiffness = 5.0
friction_coefficient = 0.4
normal_load = 1.0

[[contact]]
name = "duffing"
law = "cubic_spring"
pairs = ["d"]
cubic_stiffness = 0.5

[[contact]]
name = "stop"
law = "unilateral_spring"
pairs = [["t", "n"]]
normal_stiffness = 2.0
gap = 0.3

[preload]
pair_loads = true

[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
samples = 64
normalise = "t"
amplitude = [0.02, 0.58]
report_at = [0.56]
"""


@pytest.mark.ranks(1)
def test_a_case_names_pairs_in_a_plane_stops_and_cubic_springs(comm, launch, tmp_path):
    """The command line's branch is the script's."""
    (tmp_path / "case.toml").write_text(CASE)
    done = launch(1, "-m", "fretwave", "run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr + done.stdout
    with (tmp_path / "run" / "mode.csv").open() as file:
        row = next(row for row in csv.DictReader(file) if row["event"] == "report")
    n, t, d = np.eye(3)
    contacts = [
        fw.Contact("coulomb_2d", [n, t - d], PARAMETERS, "pad"),
        fw.Contact("cubic_spring", [d], {"cubic_stiffness": 0.5}, "duffing"),
        fw.Contact("unilateral_spring", [n - t], {"normal_stiffness": 2.0, "gap": 0.3}, "stop"),
    ]
    K = np.array([[4.0, 0, 0], [0, 4, -1], [0, -1, 3]])
    model = fw.Model(np.eye(3), K, None, contacts, comm)
    harmonics = fw.Harmonics([0, 1, 2, 3], 64)
    mode = fw.NonlinearMode(model, harmonics, dof=1, start=fw.linear_modes(model, 1)[0], rest=fw.balanced(model))
    branch = fw.follow(mode, 0.02, 0.58, report_at=[0.56])
    own = branch[branch.met("report")[0]]
    assert own["slip"] > 0
    for name in ("omega", "zeta", "slip", "open"):
        assert own[name] == pytest.approx(float(row[name]), rel=SOLVED)


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    "old, new, words",
    [
        ('tangents = [["d", "t"]]\n', "", "give the key `tangents`"),
        ('tangents = [["d", "t"]]', 'tangents = ["t", "d"]', "do not match the pairs"),
        ('tangents = [["d", "t"]]', 'tangents = ["x"]', "unknown dof 'x'"),
        ('law = "coulomb_2d"', 'law = "coulomb_3d"', "come with a model"),
        ('pairs = ["n"]\n', "", "pairs"),
    ],
)
def test_pairs_that_do_not_fit_are_refused(launch, tmp_path, old, new, words):
    assert old in CASE
    (tmp_path / "case.toml").write_text(CASE.replace(old, new, 1))
    done = launch(1, "-m", "fretwave", "check", str(tmp_path / "case.toml"))
    assert done.returncode == 2 and words in done.stderr and "fix:" in done.stderr, done.stderr
