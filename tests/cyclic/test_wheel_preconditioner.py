"""What preconditions whole wheels: modes of their waves, families of modes solved for together, or inverses."""

from __future__ import annotations

import numpy as np
import pytest
from models.cyclic_models import MASSES, NEIGHBOUR, blisk_stiffness
from petsc4py import PETSc
from test_wheel import REPORTS, SECTORS, mode_of, rubbing_blisk
from tolerances import ROUNDING

import fretwave as fw

RAYLEIGH = 1e-7 * blisk_stiffness(0) + 2.0 * np.diag(MASSES)  #: [N s/m]
DASHPOT = 300.0 * np.array([[0, 0, 0], [0, 1, -1], [0, -1, 1.0]])  #: between the masses of a blade


def rubbing(damping) -> fw.Sector:
    """Blades of two masses, whose rims rub on the ground."""
    rim = fw.Contact("jenkins", [[1.0, 0, 0]], {"tangential_stiffness": 5e5, "friction_limit": 2.0}, "rim")
    tie = NEIGHBOUR * np.diag([1.0, 0.0, 0.0])
    K = {0: blisk_stiffness(0) + 2 * tie, 1: -tie, -1: -tie}
    return fw.Sector(np.diag(MASSES), K, SECTORS, damping, [rim])


def followed(problem):
    """States where the branch reports, how it was solved, and GMRES a Newton step."""
    branch = fw.Continuation(problem, problem.initial(1e-5), (1e-5, 1e-2), report_at=REPORTS)
    points = list(branch)
    assert branch.converged, branch.reason
    states = [problem.state(p.y) for p in points if p.event == "report"]
    return states, branch.route, sum(p.linear for p in points) / sum(p.newton for p in points)


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize(("damping", "kind"), [(None, "modes"), (RAYLEIGH, "modes"), (DASHPOT, "inverses")])
def test_waves_have_modes_unless_damping_couples_them(comm, damping, kind):
    """Both kinds find the branch of the direct route, on a mistuned wheel from stick to slip, in few iterations."""
    rng = np.random.default_rng(3)
    sector = rubbing(damping)
    changes = {"K": [0.02 * e * np.asarray(sector.K[0]) for e in rng.standard_normal(SECTORS)]}
    found = {}
    for route in ("direct", "krylov"):
        PETSc.Options()[f"{route}_route"] = route
        with sector.wheel(comm, changes) as wheel:
            found[route] = followed(mode_of(wheel, "CNM", f"{route}_"))
    assert len(found["krylov"][0]) == len(REPORTS)
    for expected, state in zip(found["direct"][0], found["krylov"][0]):
        assert state["omega"] == pytest.approx(expected["omega"], rel=ROUNDING)
        assert state["beta"] == pytest.approx(expected["beta"], abs=ROUNDING * expected["omega"])
    assert f"by their {kind}" in found["krylov"][1]
    assert found["krylov"][2] < 15


@pytest.mark.ranks(1, 2, 3)
def test_families_of_modes_are_solved_for_together(comm):
    """Little mistuning moves 24 dense modes as much as they differ: 13 iterations a step where waves are apart."""
    PETSc.Options()["families_route"] = "krylov"
    sector = rubbing_blisk(24)
    changes = {"K": [0.005 * e * np.asarray(sector.K[0]) for e in np.random.default_rng(3).standard_normal(24)]}
    steps, iterations = 0, 0
    with sector.wheel(comm, changes) as wheel:
        problem = mode_of(wheel, "CNM", "families_")
        branch = fw.Continuation(problem, problem.initial(1e-5), (1e-5, 2e-4))
        for point in branch:
            steps, iterations = steps + point.newton, iterations + point.linear
    assert branch.reason == "stop value reached"
    assert iterations < 9 * steps
