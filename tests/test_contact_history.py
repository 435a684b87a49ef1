"""Status, gap and work of contact pairs from samples of a period, against the laws themselves."""

from __future__ import annotations

import numpy as np
import pytest

import fretwave as fw
from fretwave.contact_history import OPEN, SLIP, STICK, ContactHistory

pytestmark = pytest.mark.ranks(1)


@pytest.mark.parametrize("law", ["regularised_coulomb", "jenkins"])
def test_status_of_a_law_is_its_own(two_dof, comm, law: str) -> None:
    """Shares as the law counts them, work as it integrates: for EPMC's periodic motion the same integral."""
    parameters = {
        "regularised_coulomb": {"friction_limit": 5.0, "regularisation_velocity": 0.05},
        "jenkins": {"friction_limit": 5.0, "tangential_stiffness": 40.0},
    }[law]
    contact = fw.Contact(law, B=[[0.0, 1.0]], parameters=parameters)
    model = fw.Model(two_dof.M, two_dof.K, contacts=[contact], comm=comm)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(range(1, 16, 2), 2048), method="EPMC", dof=0, start=start)
    *_, last = fw.Continuation(problem, problem.initial(0.02), (0.02, 0.15 if law == "regularised_coulomb" else 0.4))
    told = problem.diagnostics(last.y)
    history = ContactHistory(law, parameters, **problem.contact_period(last.y)[0])
    for status, word in ((STICK, "stick"), (SLIP, "slip"), (OPEN, "open")):
        assert history.share(status).mean() == pytest.approx(told[word], abs=1e-14)
    assert 0.05 < told["slip"] < 0.95
    # Jenkins' own sum over its slips is of first order in the sample distance.
    assert history.work.sum() == pytest.approx(told["work"], rel=1e-10 if law == "regularised_coulomb" else 1e-2)


def test_gap_is_what_is_missing_to_contact() -> None:
    """u_n sweeps through contact: N = max(0, N0 + kn (u_n - g)), the gap is g - N0 / kn - u_n where it is open."""
    u = np.zeros((64, 3, 2))
    u[:, 0] = 1e-3 * np.cos(2 * np.pi * np.arange(64) / 64)[:, None]
    kn, load, gap = np.array([2e4, 1e4]), 5.0, np.array([1e-4, 0.0])
    f = np.zeros_like(u)
    f[:, 0] = np.maximum(0.0, load + kn * (u[:, 0] - gap))
    given = {"normal_stiffness": kn, "normal_load": load, "gap": gap, "friction_coefficient": 0.3}
    history = ContactHistory("coulomb_3d", given, u, np.zeros_like(u), f)
    missing = gap - load / kn - u[:, 0]
    assert history.gap == pytest.approx(np.maximum(missing, 0.0), abs=1e-18)
    assert np.array_equal(history.status == OPEN, missing >= 0) and not np.any(history.status == SLIP)
    assert np.abs(history.work).max() < 1e-12 * load * 1e-3


def test_uncoupled_tangents_slip_one_by_one() -> None:
    f = np.array([[[10.0], [3.0], [2.9]], [[10.0], [2.0], [2.5]]])
    history = {
        law: ContactHistory(law, {"friction_coefficient": 0.3}, 0 * f, 0 * f, f)
        for law in ("coulomb_3d", "coulomb_3d_uncoupled", "own")
    }
    assert history["coulomb_3d"].status.ravel().tolist() == [SLIP, SLIP]
    assert history["coulomb_3d_uncoupled"].status.ravel().tolist() == [SLIP, STICK]
    assert history["own"].status is None
