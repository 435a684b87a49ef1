"""A body that friction alone holds: once all of its contacts slip through the period nothing holds its mean."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import options
from petsc4py import PETSc
from tolerances import TIGHT

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

M = np.diag([1.0, 0.5, 0.05])
K = np.array([[640.0, -40.0, 0.0], [-40.0, 40.0, 0.0], [0.0, 0.0, 0.0]])
SLIDERS = {"tangential_stiffness": [40.0, 15.0], "friction_limit": [2.0, 0.7]}
#: The third mass lies between the second and the ground.
BETWEEN = np.array([[0.0, 1.0, -1.0], [0.0, 0.0, 1.0]])


def mode(orders: list[int], unit: float) -> fw.NonlinearMode:
    """In a unit of force that is another."""
    given = {name: [unit * value for value in values] for name, values in SLIDERS.items()}
    model = fw.Model(unit * M, unit * K, None, [fw.Contact("jenkins", BETWEEN, given)])
    return fw.NonlinearMode(model, fw.Harmonics(orders, 256), "CNM", 0)


def with_even_harmonics(problem: fw.NonlinearMode, odd: PETSc.Vec) -> PETSc.Vec:
    """Unknowns of orders 1, 3, 5 among those of 0 to 5."""
    out, values = problem.initial(0.01), odd.getArray()
    blocks = np.zeros((len(M), 11))
    blocks[:, [1, 2, 5, 6, 9, 10]] = values[: 6 * len(M)].reshape(len(M), 6)
    out.setArray(np.concatenate([blocks.ravel(), values[6 * len(M) :]]))
    return out


@pytest.mark.parametrize("route", ["direct", "krylov"])
@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_holding_the_mean_leaves_errors_as_they_are(route: str, unit: float) -> None:
    """The motion is odd: with the mean, which nothing holds, and even harmonics it has the same errors.

    What a singular system does to them otherwise, cases/robustness/ranks.py sees (lap_joint).
    """
    odd, full = mode([1, 3, 5], unit), mode(list(range(6)), unit)
    with options(mode_error_route=route, mode_error_tangent_ksp_rtol=1e-10):
        for point in fw.Continuation(odd, odd.initial(0.01), (0.01, 3.0)):
            if point.parameter > 0.3:
                break
        y, tangent = (with_even_harmonics(full, v) for v in (point.y, point.tangent))
        assert full.residual(y).norm() < TIGHT
        found, expected = full.errors(y, tangent), odd.errors(point.y, point.tangent)
    assert expected["zeta_error"] > 1e-6
    for name in ("omega_error", "zeta_error"):
        assert found[name] == pytest.approx(expected[name], rel=1e-6), name
