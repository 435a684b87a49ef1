"""Time integration knows no unit: powers of two scale every number of it exactly, so that the same steps are taken."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import REPEATED

import fretwave as fw

UNITS = [
    (2.0**-40, 1.0, 1.0),
    (1.0, 2.0**-60, 1.0),
    (1.0, 1.0, 2.0**10),
    (1.0, 1.0, 2.0**-20),
    (2.0**9, 2.0**-50, 2.0**20),
]
REST = [0.0, 0.0]


def run_in(comm, two_dof, length, mass, time, eps, start, force=None):
    """The oscillator with a friction damper, its motion in the test's own units."""
    stiffness, N, velocity = mass / time**2, mass * length / time**2, length / time
    parameters = {"friction_limit": 5.0 * N, "regularisation_velocity": eps * velocity}
    damper = fw.Contact("regularised_coulomb", two_dof.B, parameters)
    model = fw.Model(mass * two_dof.M, stiffness * two_dof.K, 0.002 * time * stiffness * two_dof.K, [damper], comm)
    excitation = {} if force is None else {1: N * np.asarray(force)}
    x0, v0 = length * np.asarray(start[0]), velocity * np.asarray(start[1])
    run = fw.Transient(model, excitation, 1.0, 24.0 / time).run(x0, v0, 0.5 * time, time / 128, 1e-5)
    return run, np.asarray(run["x"]) / length


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    "eps, start, force",
    [
        (0.05, ([0.3, 0.1], REST), None),
        (0.05, (REST, [1.0, 2.0]), None),
        (0.05, (REST, REST), [9.0, 0.0]),
        (1e-7, (REST, [1.0, 2.0]), None),
        (1e-7, (REST, REST), [9.0, 0.0]),
    ],
    ids=["displaced", "pushed", "from rest", "pushed, stiff", "from rest, stiff"],
)
def test_units_change_no_step(comm, two_dof, eps, start, force):
    """Explicit, and implicit where the damper is too stiff for that."""
    run, x = run_in(comm, two_dof, 1.0, 1.0, 1.0, eps, start, force)
    assert run["finished"] and run["implicit"] == (eps < 1e-3)
    for units in UNITS:
        other, its = run_in(comm, two_dof, *units, eps, start, force)
        assert other["finished"] and other["steps"] == run["steps"]
        assert np.allclose(its, x, rtol=0, atol=REPEATED * np.abs(x).max())


@pytest.mark.ranks(1, 2)
def test_a_mass_of_few_units_is_no_zero(comm, two_dof):
    """Of 1e-17: the closed form of a free oscillator, whose frequency is that of any mass."""
    mass = 1e-17
    model = fw.Model([[mass]], [[25.0 * mass]], comm=comm)
    run = fw.Transient(model).run([1.0], [0.0], 2.0, 0.1, 1e-10)
    assert run["x"][:, 0] == pytest.approx(np.cos(5.0 * run["t"]), abs=1e-8)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("swing", [1e-2, 1e-4])
def test_a_static_displacement_takes_no_digits(comm, swing):
    """A swing about it, by the closed form: x = x_s (1 + swing cos w t)."""
    w, period = 2 * np.pi * 100.0, 0.01
    model = fw.Model([[1.0]], [[w**2]], comm=comm)
    run = fw.Transient(model, {0: np.array([w**2])}, omega=1.0).run(
        [1.0 + swing], [0.0], 10 * period, period / 64, 1e-7
    )
    assert run["x"][:, 0] - 1.0 == pytest.approx(swing * np.cos(w * run["t"]), abs=2e-4 * swing)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("start", ["rest", "displaced"])
def test_how_often_it_is_sampled_changes_no_digit(comm, start):
    """At the same 20 times, which are a sample each or every 640th one."""
    model = fw.Model([[1.0]], [[1.0]], [[0.02]], comm=comm)
    runs = []
    for parts in (1, 640):
        transient = fw.Transient(model, {1: np.array([1j])}, omega=0.7)  # from rest without a force at t = 0
        run = transient.run([float(start == "displaced")], [0.0], 20 * 2 * np.pi, 2 * np.pi / parts, 1e-6)
        runs.append(np.asarray(run["x"])[::parts, 0])
    assert runs[0] == pytest.approx(runs[1], abs=3e-5 * np.abs(runs[1]).max())


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("scale", [1.0, 1e-20])
def test_a_singular_mass_is_refused(comm, scale):
    mass = scale * np.array([[0.1, 0.3], [0.3, 0.9]])
    with pytest.raises(fw.InputError, match="mass matrix is singular"):
        fw.Transient(fw.Model(mass, np.eye(2), comm=comm))
    fw.Transient(fw.Model(scale * np.array([[0.1, 0.2], [0.2, 0.9]]), np.eye(2), comm=comm))
