"""A body that friction alone holds: once all of its contacts slip through the period nothing holds its mean."""

from __future__ import annotations

import numpy as np
import pytest
from petsc4py import PETSc
from tolerances import TIGHT

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

M = np.diag([1.0, 0.5, 0.05])
K = np.array([[640.0, -40.0, 0.0], [-40.0, 40.0, 0.0], [0.0, 0.0, 0.0]])
SLIDERS = {"tangential_stiffness": [40.0, 15.0], "friction_limit": [2.0, 0.7]}
#: The third mass lies between the second and the ground.
BETWEEN = np.array([[0.0, 1.0, -1.0], [0.0, 0.0, 1.0]])


def mode(orders: list[int], unit: float = 1.0) -> fw.NonlinearMode:
    """In a unit of force that is another."""
    given = {name: [unit * value for value in values] for name, values in SLIDERS.items()}
    model = fw.Model(unit * M, unit * K, None, [fw.Contact("jenkins", BETWEEN, given)])
    return fw.NonlinearMode(model, fw.Harmonics(list(orders), 256), "CNM", 0)


@pytest.mark.parametrize("route", ["direct", "krylov"])
@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_even_harmonics_change_nothing(route: str, unit: float) -> None:
    """The motion is odd: with the mean and even harmonics it is the same. Without a hold the branch ended at a = 0.028,
    where the body began to slide."""
    options = PETSc.Options()
    options["mode_route"] = route
    try:
        found = [fw.follow(mode(orders, unit), 0.01, 3.0, report_at=[0.1, 1.0]) for orders in ([1, 3, 5], range(6))]
    finally:
        options.delValue("mode_route")
    for branch in found:
        assert branch.converged, branch.reason
        assert branch["slip"].max() > 0.9 and len(branch["slip"]) < 120
    for name in ("omega", "zeta"):
        odd, all_orders = (branch[name][branch.met("report")] for branch in found)
        assert all_orders == pytest.approx(odd, rel=TIGHT)
    odd, all_orders = (branch["zeta_error"][branch.met("report")] for branch in found)
    assert all_orders == pytest.approx(odd, rel=1e-2)  # to which they are solved
