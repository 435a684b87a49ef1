"""What the stiffness of a fine mesh leaves of its first bending, ten decades lower."""

from __future__ import annotations

import numpy as np
import pytest
from petsc4py import PETSc
from tolerances import SOLVED, TIGHT

import fretwave as fw

pytestmark = pytest.mark.ranks(1, 2, 3)

N, STIFF = 32, 1e10
EVEN = np.full((N, N), 1 / N)
#: 1 N/m along the motion of all dofs alike, 1e10 N/m across: all entries are exact in double precision.
K = STIFF * (np.eye(N) - EVEN) + EVEN


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
@pytest.mark.parametrize("route", ["direct", "krylov"])
def test_frequencies_have_the_digits_that_the_stiffness_loses(comm, route: str, method: str) -> None:
    """omega = 1 from a start that is off by 1e-6 everywhere; by sums as they come Newton does not arrive."""
    PETSc.Options()["split_route"] = route
    rough = 1 + 1e-6 * np.random.default_rng(3).standard_normal(N)
    contact = fw.Contact(
        "jenkins", np.eye(1, N) - np.eye(1, N, 1), {"tangential_stiffness": 1.0, "friction_limit": 1.0}
    )
    with fw.Model(np.eye(N), K, contacts=[contact], comm=comm) as model:
        start = fw.LinearMode(1 + 1e-6, 0.0, rough, np.zeros(N))
        problem = fw.NonlinearMode(model, fw.Harmonics([1, 3, 5], 16), method, N - 1, start, "split_")
        branch = fw.Continuation(problem, problem.initial(0.1), (0.1, 1.0))
        omega = [problem.state(p.y)["omega"] for p in branch]
    assert branch.converged and len(omega) > 2
    assert abs(omega[0] - 1) < SOLVED
    assert np.abs(np.array(omega[1:]) - 1).max() < TIGHT
