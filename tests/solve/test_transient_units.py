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
