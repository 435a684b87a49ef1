"""Damping by mode against its definition: ratios of the modes, of every wave, and of the wheel put together."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from models.core_models import chain
from tolerances import ROUNDING, TIGHT

import fretwave as fw
from fretwave.model import modal_damping as module
from fretwave.model.contact import in_limit
from fretwave.model.sectors import around, by_sector, in_wave

pytestmark = pytest.mark.ranks(1)

M = np.diag([2.0, 1.0, 0.5, 1.5])
K = chain(4, 30.0, 1.0)
#: Normal and tangent of one pair on the first two dofs.
FACE = fw.Contact(
    "coulomb_2d",
    np.eye(4)[:2],
    {"normal_stiffness": 40.0, "tangential_stiffness": 9.0, "friction_coefficient": 0.3},
    "face",
)
SPRINGS = {"stuck": np.diag([40.0, 9.0, 0, 0]), "sliding": np.diag([40.0, 0, 0, 0]), "free": np.zeros((4, 4))}


def in_modes(C: np.ndarray, M: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phi^H C Phi in the modes of K and M of unit modal mass, and their frequencies."""
    square, shapes = scipy.linalg.eigh(K, M)
    return shapes.conj().T @ C @ shapes, np.sqrt(np.maximum(square, 0.0))


def expected(zeta: np.ndarray | float, omega: np.ndarray) -> np.ndarray:
    return np.diag(2 * np.broadcast_to(zeta, omega.shape) * omega)


@pytest.mark.parametrize("limit", SPRINGS)
@pytest.mark.parametrize(
    "ratios, zeta", [(0.01, 0.01), ([0.02, 0.0, 0.03], [0.02, 0.0, 0.03, 0.0]), ({3: 0.004}, [0.0, 0.0, 0.004, 0.0])]
)
def test_every_mode_of_the_limit_has_its_ratio_and_no_other_is_damped(limit, ratios, zeta):
    (C,) = fw.modal_damping(M, K, ratios, in_limit([FACE], limit)).values()
    found, omega = in_modes(C.toarray(), M, K + SPRINGS[limit])
    assert np.abs(found - expected(zeta, omega)).max() < ROUNDING * omega.max()
    assert (C != C.T).nnz == 0


def test_contact_without_any_give_is_held_in_the_modes():
    """Dof 0 does not move: nothing damps it, and the others have their ratio as a model of three dofs."""
    rigid = fw.Contact(
        "regularised_coulomb", np.eye(4)[:1], {"friction_limit": 5.0, "regularisation_velocity": 0.05}, "rubs"
    )
    C = fw.modal_damping(M, K, 0.01, [rigid])[0].toarray()
    found, omega = in_modes(C[1:, 1:], M[1:, 1:], K[1:, 1:])
    assert np.abs(found - expected(0.01, omega)).max() < ROUNDING * omega.max()
    assert np.abs(C[0]).max() < ROUNDING * np.abs(C).max()


def test_rigid_motions_are_not_damped_and_massless_dofs_follow():
    free = np.diag([1.0, 2.0, 2.0, 1.0]) * 30.0 - 30.0 * (np.eye(4, k=1) + np.eye(4, k=-1))
    C = fw.modal_damping(M, free, 0.02)[0].toarray()
    found, omega = in_modes(C, M, free)
    assert np.abs(found[1:, 1:] - expected(0.02, omega[1:])).max() < TIGHT * omega.max()
    assert np.abs(C @ np.ones(4)).max() < TIGHT * np.abs(C).max()
    light = M.copy()
    light[3, 3] = 0.0
    C = fw.modal_damping(light, K, 0.02)[0].toarray()
    condensed = K[:3, :3] - np.outer(K[:3, 3], K[3, :3]) / K[3, 3]
    found, omega = in_modes(C[:3, :3], M[:3, :3], condensed)
    assert np.abs(found - expected(0.02, omega)).max() < ROUNDING * omega.max() and not C[3].any()


def test_units_of_single_dofs_do_not_matter():
    """A dof in other units: C in the units of its row and column."""
    scale = np.diag([1.0, 1e6, 1e-5, 1.0])
    C, scaled = (fw.modal_damping(S @ M @ S, S @ K @ S, 0.01)[0].toarray() for S in (np.eye(4), scale))
    assert np.abs(scaled / np.outer(np.diag(scale), np.diag(scale)) - C).max() < TIGHT * np.abs(C).max()


def sector(N: int) -> tuple[dict, dict, fw.Contact]:
    """Two masses a sector, coupled by both, and a slider between the second and the next sector's first."""
    coupling = np.array([[3.0, 1.0], [0.5, 2.0]])
    stiffness = {0: np.array([[40.0, -8.0], [-8.0, 25.0]]), 1: -coupling, -1: -coupling.T}
    mass = {0: np.array([[2.0, 0.1], [0.1, 1.0]]), 1: 0.05 * np.eye(2), -1: 0.05 * np.eye(2)}
    maps = {0: sp.csr_matrix([[0.0, 1.0]]), 1: sp.csr_matrix([[-1.0, 0.0]])}
    slider = fw.Contact("jenkins", maps, {"tangential_stiffness": 6.0, "friction_limit": 1.0}, "shroud")
    return mass, stiffness, slider


def stuck_wheel(mass: dict, stiffness: dict, slider: fw.Contact, N: int) -> tuple[np.ndarray, np.ndarray]:
    B = around(slider.B, N)
    return around(mass, N).toarray(), (around(stiffness, N) + 6.0 * B.T @ B).toarray()


@pytest.mark.parametrize("N", [2, 3, 5, 8])
def test_the_wheel_of_the_terms_is_damped_as_the_wheel_itself(N):
    """All modes with one ratio: C of the block-circulant wheel is that of its own modes, whichever they are."""
    mass, stiffness, slider = sector(N)
    if N == 2:  # the sector ahead is the one behind
        mass, stiffness = ({0: A[0], 1: A[1] + A[-1]} for A in (mass, stiffness))
    terms = fw.modal_damping(mass, stiffness, 0.01, [slider], N)
    found, omega = in_modes(around(terms, N).toarray(), *stuck_wheel(mass, stiffness, slider, N))
    assert np.abs(found - expected(0.01, omega)).max() < ROUNDING * omega.max()


@pytest.mark.parametrize("diameters", [0, 1, 3, -2, 4])
def test_every_wave_has_the_ratios_of_its_own_modes(diameters):
    N, (mass, stiffness, slider) = 8, sector(8)
    terms = fw.modal_damping(mass, stiffness, [0.0, 0.03], [slider], N)
    theta = 2 * np.pi * diameters / N
    B = sum(np.exp(-1j * k * theta) * A.toarray() for k, A in by_sector(slider.B).items())
    C, mass_, stiffness_ = (in_wave(A, np.eye(2), theta) for A in (terms, mass, stiffness))
    found, omega = in_modes(C, mass_, stiffness_ + 6.0 * B.conj().T @ B)
    assert np.abs(found - expected([0.0, 0.03], omega)).max() < ROUNDING * omega.max()


def test_terms_that_are_nothing_are_left_out():
    """Frequencies that no wave changes: every sector is damped for itself."""
    terms = fw.modal_damping(M, K, 0.01, sectors=12)
    assert list(terms) == [0]
    assert np.abs(terms[0] - fw.modal_damping(M, K, 0.01)[0]).max() < ROUNDING


def test_modes_of_one_frequency_have_one_ratio():
    equal, one = np.eye(3), np.diag([4.0, 9.0, 9.0])
    with pytest.raises(fw.InputError, match="two damping ratios") as caught:
        fw.modal_damping(equal, one, [0.01, 0.02, 0.03])
    assert "modes 2 and 3" in str(caught.value)
    C = fw.modal_damping(equal, one, [0.01, 0.02, 0.02])[0].toarray()
    assert np.abs(C - np.diag([0.04, 0.12, 0.12])).max() < ROUNDING


def test_a_mode_that_is_not_there_and_a_model_too_large_are_refused(monkeypatch):
    with pytest.raises(fw.InputError, match="mode 5"):
        fw.modal_damping(M, K, {5: 0.01})
    monkeypatch.setattr(module, "LARGEST", 15)
    with pytest.raises(fw.InputError, match="at most 3"):
        fw.modal_damping(M, K, 0.01)
