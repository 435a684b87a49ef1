"""A model in a process of its own: pickled on one rank with its laws and its state at rest, refused on several."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from mpi4py import MPI
from tolerances import LAST_DIGITS

import fretwave as fw
from fretwave.errors import InputError


class Friction(fw.PythonLaw):
    odd = True

    def __init__(self, limit: float) -> None:
        self.limit = limit

    def force(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return self.limit * np.tanh(v / 0.05)


COMPILED = ("regularised_coulomb", {"friction_limit": 5.0, "regularisation_velocity": 0.05})
K = np.array([[640.0, -40.0], [-40.0, 40.0]])
M = np.diag([1.0, 0.02])


def damping(model: fw.Model) -> float:
    """Of a mode where it slips."""
    with fw.NonlinearMode(model, fw.choose_harmonics(model, 3, 64), dof=0) as mode:
        return float(fw.follow(mode, 0.2, 0.25, errors=False)["zeta"][-1])


@pytest.mark.ranks(1)
@pytest.mark.parametrize("law", ["compiled", "python"])
@pytest.mark.parametrize(
    "again", [lambda model: pickle.loads(pickle.dumps(model)), copy.deepcopy], ids=["pickle", "copy"]
)
def test_what_comes_back_moves_as_the_model_does(law: str, again) -> None:
    contact = fw.Contact(COMPILED[0], [[0.0, 1.0]], COMPILED[1]) if law == "compiled" else None
    contact = contact or fw.Contact(Friction(5.0), [[0.0, 1.0]])
    with fw.Model(M, K, 1e-4 * K, [contact], units="mm-t-s") as model, again(model) as other:
        assert other.units == model.units and other.n_dof == 2
        assert damping(other) == pytest.approx(damping(model), rel=LAST_DIGITS)


@pytest.mark.ranks(1)
def test_a_sector_comes_back_in_its_wave() -> None:
    """x_{j+1} = x_j e^{-i theta}: K_0 - 2 k cos(theta) of a ring of masses."""
    ring = {0: [[3.0]], 1: [[-1.0]], -1: [[-1.0]]}
    with fw.Model([[1.0]], {k: np.array(A) for k, A in ring.items()}, sectors=6, nodal_diameter=2) as model:
        other = pickle.loads(pickle.dumps(model))
    with other:
        omega = fw.linear_modes(other, 1)[0].omega
    assert omega == pytest.approx(np.sqrt(3 - 2 * np.cos(2 * np.pi * 2 / 6)), rel=LAST_DIGITS)


@pytest.mark.ranks(1)
def test_the_state_at_rest_comes_with_it() -> None:
    """An open gap of one of two stops: only the closed one stiffens the modes about that state."""
    stops = {"normal_stiffness": 100.0, "tangential_stiffness": 10.0, "friction_coefficient": 0.3, "normal_load": 0.0}
    contact = fw.Contact("coulomb_2d", np.eye(4), stops)
    with fw.Model(np.eye(4), np.eye(4), None, [contact]) as model:
        fw.static_preload(model, np.array([1.0, 0.0, -1.0, 0.0]))
        with pickle.loads(pickle.dumps(model)) as other:
            found = [mode.omega for mode in fw.linear_modes(other, 4)]
            assert other.at_rest is not None and model.at_rest is not None
            np.testing.assert_array_equal(other.at_rest.displacement, model.at_rest.displacement)
    np.testing.assert_allclose(found, np.sqrt([1.0, 1.0, 11.0, 101.0]), rtol=1e-12)


@pytest.mark.ranks(2)
def test_several_ranks_are_told() -> None:
    with fw.Model(M, K) as model, pytest.raises(InputError, match="cannot be pickled"):
        pickle.dumps(model)
    with fw.Model(M, K, comm=MPI.COMM_SELF) as alone, pickle.loads(pickle.dumps(alone)) as other:
        assert other.comm.size == 1
