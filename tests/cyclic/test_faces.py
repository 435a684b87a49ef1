"""A sector cut out of a wheel: matching faces, the turned frames of 3-D sectors, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from models.core_models import friction
from models.cyclic_models import lumped_blisk
from tolerances import SOLVED

import fretwave as fw
from fretwave.cyclic.faces import rotation

SECTORS = 5
#: Angles, radii and heights of the nodes: low face, inside, high face.
ANGLES, RADII, HEIGHTS = (0.0, 0.4, 1.0), (1.0, 1.5), (0.0, 0.3)


def wedge(axis: str = "z"):
    """Nodes (12, 3) of a sector about an axis, and the nodes of its low and high face, the high one in disorder."""
    grid = np.array([(f, r, h) for f in ANGLES for r in RADII for h in HEIGHTS])
    angle = 2 * np.pi / SECTORS * grid[:, 0]
    local = np.column_stack([grid[:, 1] * np.cos(angle), grid[:, 1] * np.sin(angle), grid[:, 2]])
    xyz = np.roll(local, "xyz".index(axis) + 1, axis=1)  # axis z stays where it is
    return xyz, np.arange(4), np.array([10, 8, 11, 9])


def dofs(nodes) -> np.ndarray:
    return (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()


def random_sector(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Symmetric positive definite M, K on 36 dofs without any symmetry in space."""
    rng = np.random.default_rng(seed)
    A, B = rng.standard_normal((2, 36, 36))
    return np.eye(36) + 0.1 * A @ A.T / 36, B @ B.T + 5 * np.eye(36)


def assembled_wheel(M, K, low, high, axis):
    """The wheel in one fixed Cartesian frame, assembled as finite elements are: sector j turned by j 2 pi / N."""
    inner = np.setdiff1d(np.arange(12), high)
    number = {(j, node): j * len(inner) + i for j in range(SECTORS) for i, node in enumerate(inner)}
    n = 3 * len(number)
    whole_M, whole_K = np.zeros((n, n)), np.zeros((n, n))
    partner = dict(zip(high, low))
    for j in range(SECTORS):
        turn = np.kron(np.eye(12), rotation(2 * np.pi * j / SECTORS, axis))
        nodes = [number[((j + 1) % SECTORS, partner[k]) if k in partner else (j, k)] for k in range(12)]
        where = np.ix_(dofs(nodes), dofs(nodes))
        whole_M[where] += turn @ M @ turn.T
        whole_K[where] += turn @ K @ turn.T
    return whole_M, whole_K


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_waves_of_a_turned_sector_are_the_modes_of_the_assembled_wheel(comm, axis):
    xyz, low, high = wedge(axis)
    low, high = fw.match_faces(xyz, low, high, SECTORS, axis)
    M, K = random_sector(1)
    expected = np.sqrt(scipy.linalg.eigvalsh(*assembled_wheel(M, K, low, high, axis)[::-1]))
    sector = fw.Sector.from_faces(M, K, dofs(low), dofs(high), SECTORS, axis=axis)
    found = []
    for nodal_diameter in range(SECTORS):
        with sector.model(nodal_diameter, comm) as model:
            found += [mode.omega for mode in fw.linear_modes(model, 24)]
    assert sorted(found) == pytest.approx(list(expected), rel=SOLVED)


def test_matching_finds_the_turned_partner():
    xyz, low, high = wedge()
    low, high = fw.match_faces(xyz, low, high, SECTORS)
    assert np.allclose(xyz[high], xyz[low] @ rotation(2 * np.pi / SECTORS).T)


def test_motion_of_both_faces_is_that_of_neighbours(comm):
    """expand: the high face moves like the low one of the next sector, turned with it."""
    xyz, low, high = wedge()
    low, high = fw.match_faces(xyz, low, high, SECTORS)
    sector = fw.Sector.from_faces(*random_sector(2), dofs(low), dofs(high), SECTORS, axis="z")
    q = np.random.default_rng(0).standard_normal((sector.n_dof, 2)) @ [1, 1j]
    full = sector.expand(q, 2).reshape(-1, 3)
    kept = np.setdiff1d(np.arange(12), high)
    assert np.array_equal(full[kept].ravel(), q)
    turned = np.exp(-4j * np.pi / SECTORS) * full[low] @ rotation(2 * np.pi / SECTORS).T
    assert np.allclose(full[high], turned)


def test_contact_on_the_high_face_reaches_the_next_sector():
    """B on the sector's own dofs, given before the faces are tied."""
    xyz, low, high = wedge()
    low, high = fw.match_faces(xyz, low, high, SECTORS)
    B = np.zeros((1, 36))
    B[0, [3 * high[1] + 2, 14]] = 1.0, -1.0
    sector = fw.Sector.from_faces(*random_sector(2), dofs(low), dofs(high), SECTORS, contacts=[friction(B)], axis="z")
    rows = {k: part.toarray() for k, part in sector.contacts[0].B.items()}
    assert sorted(rows) == [0, 1]
    assert np.flatnonzero(rows[0]).tolist() == [14] and rows[0][0, 14] == -1.0
    assert np.flatnonzero(rows[1]).tolist() == [3 * low[1] + 2] and rows[1][0, 3 * low[1] + 2] == 1.0


def refused(pattern, function, *arguments, **options):
    with pytest.raises(fw.InputError, match=f"(?s){pattern}"):
        function(*arguments, **options)


@pytest.mark.ranks(1)
def test_unmatched_nodes_are_named():
    xyz, low, high = wedge()
    xyz[10] += [0, 0, 0.01]
    refused(
        r"do not match.*low face: 2 .*high face: 10 \(.*1 of 4 low and 1 of 4 high", fw.match_faces, xyz, low, high, 5
    )
    refused("do not match.*4 of 4 low", fw.match_faces, wedge()[0], low, high, 6)
    refused("do not match.*4 of 4 low", fw.match_faces, wedge()[0], high, low, 5)


@pytest.mark.ranks(1)
def test_nodes_on_the_axis_are_named():
    xyz, low, high = wedge()
    xyz[0] = 0
    refused("lie on the axis.*low face: 0", fw.match_faces, xyz, low, high, 5)


@pytest.mark.ranks(1)
def test_wrong_faces_are_refused():
    M, K = random_sector(3)
    make = fw.Sector.from_faces
    refused("do not match.*2 low and 1 high", make, M, K, [0, 1], [2], 5)
    refused("do not match.*dof 36", make, M, K, [0, 1], [2, 36], 5)
    refused("do not match.*dof 1 stands 2 times", make, M, K, [0, 1], [1, 2], 5)
    refused("do not match.*three Cartesian", make, M, K, [0, 1], [3, 4], 5, axis="z")
    refused("unknown axis", make, M, K, [0, 1, 2], [3, 4, 5], 5, axis="r")
    refused("not whole numbers", make, M, K, [0.5], [3], 5)


@pytest.mark.ranks(1)
def test_one_sided_coupling_is_refused():
    refused("one-sided.*no counterpart", fw.Sector, [[1.0]], {0: [[2.0]], 1: [[-1.0]]}, 5)
    refused("one-sided.*not zero", fw.Sector, [[1.0]], {0: [[2.0]], 1: [[-1.0]], -1: [[-0.5]]}, 5)
    refused("K of the sector itself is not symmetric.*0.25 of the largest", fw.Sector, np.eye(2), [[4, 1], [2, 4]], 5)
    refused("M of the sector itself is not symmetric", fw.Sector, [[4, 1], [2, 4]], np.eye(2), 5)
    refused("two sectors or more", fw.Sector, [[1.0]], [[2.0]], 1)
    refused("own sector's matrix", fw.Sector, [[1.0]], {1: [[2.0]]}, 5)


@pytest.mark.ranks(1)
def test_a_wave_is_not_integrated_in_time(comm):
    with lumped_blisk().model(4, comm) as model:
        refused("no equations in time.*wheel", fw.Transient, model)
