"""Strain of solid cells: linear fields to rounding, bending by its formula, places on cells, a cantilever's strain."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from models.solid_meshes import bent, mesh
from scipy.sparse.linalg import spsolve
from tolerances import LAST_DIGITS, ROUNDING, SOLVED

from fretwave import fe
from fretwave.errors import InputError
from fretwave.fe.lagrange import gauss
from fretwave.fe.solids import MODES, PLACES, best_points, extrapolation, outside, shape_functions
from fretwave.fe.strain import COMPONENTS, along, gradients, interpolation, nodal_strain, stress_of

pytestmark = pytest.mark.ranks(1)

#: A displacement u = SLOPE x, and its strain.
SLOPE = np.array([[1.0, 0.3, -0.2], [0.7, -0.5, 0.4], [0.1, 0.6, 0.8]])
STRAIN = np.array([(SLOPE[a, b] + SLOPE[b, a]) / 2 for a, b in COMPONENTS])


@pytest.mark.parametrize("kind", PLACES)
def test_shape_functions_are_one_at_their_nodes_and_add_up_to_one(kind: str) -> None:
    values, slopes = shape_functions(kind, PLACES[kind])
    assert abs(values - np.eye(len(values))).max() < ROUNDING
    assert abs(slopes.sum(axis=2)).max() < ROUNDING
    u, h = np.array([[0.21, 0.13, 0.35]]), 1e-6
    for axis in range(3):
        step = h * np.eye(3)[axis]
        difference = (shape_functions(kind, u + step)[0] - shape_functions(kind, u - step)[0]) / (2 * h)
        assert abs(shape_functions(kind, u)[1][:, axis] - difference).max() < 1e-8


@pytest.mark.parametrize("kind", PLACES)
def test_extrapolation_keeps_what_is_constant_and_points_lie_inside(kind: str) -> None:
    assert abs(extrapolation(kind).sum(axis=1) - 1).max() < ROUNDING
    assert (outside(kind, best_points(kind)) < 0).all()
    assert abs(outside(kind, PLACES[kind])[:4]).max() < LAST_DIGITS


@pytest.mark.parametrize("kind", PLACES)
def test_a_linear_field_has_its_strain_everywhere(kind: str) -> None:
    nodes, solids = mesh(kind, (2, 2, 1), bent)
    rows = nodal_strain(nodes, solids)
    found = rows((nodes @ SLOPE.T)[..., None])[..., 0]
    assert abs(found - STRAIN).max() < ROUNDING
    rigid = np.cross([0.2, -0.5, 0.3], nodes) + [1.0, 2.0, 3.0]
    assert abs(rows(rigid[..., None])).max() < ROUNDING


def test_two_kinds_side_by_side_are_averaged_at_their_nodes() -> None:
    nodes, solids = mesh("hexahedron", (2, 1, 1))
    (cells,) = solids.values()
    first, second = ({"hexahedron": cells[k : k + 1]} for k in (0, 1))
    u = np.random.default_rng(1).normal(size=(len(nodes), 3, 1))
    both, one, other = (nodal_strain(nodes, part)(u) for part in (solids, first, second))
    shared = np.intersect1d(cells[0], cells[1])
    assert len(shared) == 4
    np.testing.assert_allclose(both[shared], (one[shared] + other[shared]) / 2, atol=ROUNDING)
    np.testing.assert_allclose(both[np.setdiff1d(cells[0], shared)], one[np.setdiff1d(cells[0], shared)])


def test_one_cell_with_incompatible_modes_bends_as_a_beam() -> None:
    """Pure bending is 8 corners and two modes of a box: sigma_xx = -E kappa z and no other stress."""
    half = np.array([1.5, 0.5, 0.25])
    corners, solids = mesh("hexahedron", (1, 1, 1), lambda u: (2 * u - 1) * half)
    x, y, z = corners.T
    kappa, nu = 1e-3, 0.3
    moved = kappa * np.column_stack([-x * z, nu * y * z, x**2 / 2 + nu * (z**2 - y**2) / 2])
    modes = np.zeros((3, 3))
    modes[:, 2] = kappa / 2 * half**2 * [-1, nu, -nu]
    cells = {MODES: np.append(solids["hexahedron"], [[8, 9, 10]], axis=1)}
    rows = nodal_strain(np.vstack([corners, np.zeros((3, 3))]), cells)
    stress = stress_of(rows(np.vstack([moved, modes])[..., None]), 210e3, nu)[..., 0]
    wanted = np.zeros((11, 6))
    wanted[:8, 0] = -210e3 * kappa * z
    assert abs(stress - wanted).max() < ROUNDING * abs(wanted).max()
    without = stress_of(nodal_strain(corners, solids)(moved[..., None]), 210e3, nu)[..., 0]
    assert abs(without - wanted[:8]).max() > 0.3 * abs(wanted).max()


def test_stress_is_hookes() -> None:
    """Uniaxial tension and pure shear."""
    E, nu = 70e3, 0.33
    strain = np.array([[1.0, -nu, -nu, 0, 0, 0], [0, 0, 0, 0.5, 0, 0]])
    stress = stress_of(strain, E, nu)
    np.testing.assert_allclose(stress[0], [E, 0, 0, 0, 0, 0], atol=LAST_DIGITS * E)
    np.testing.assert_allclose(stress[1], [0, 0, 0, E / 2 / (1 + nu), 0, 0], atol=LAST_DIGITS * E)


def test_it_is_that_of_the_hexahedra_of_fe() -> None:
    """Stress at the Gauss points of curved triquadratic cells, as `fe.stresses` has it on its own lattice."""
    lattice = fe.join([fe.Block("b", (2, 1, 1), lambda u: bent(u * [2, 1, 1]))], 2)
    x, y, z = lattice.nodes.T
    moved = np.column_stack([x * y, y * z, x**2])
    wanted = fe.stresses(lattice, fe.TITANIUM, moved.ravel())
    points = np.array(list(product(2 * gauss(2)[0] - 1, repeat=3)))
    cells = lattice.vtk_cells
    slopes = np.einsum(
        "eqan,enb->eqab", gradients("triquadratic_hexahedron", lattice.nodes[cells], points), moved[cells]
    )
    strain = np.stack([(slopes[..., a, b] + slopes[..., b, a]) / 2 for a, b in COMPONENTS], axis=-1)
    found = stress_of(strain.reshape(-1, 6), 114e9, 0.33).reshape(*strain.shape)
    for k, (a, b) in enumerate(COMPONENTS):
        assert abs(found[..., k] - wanted[..., a, b]).max() < ROUNDING * abs(wanted).max()


@pytest.mark.parametrize("kind", PLACES)
def test_a_place_is_found_in_its_cell(kind: str) -> None:
    nodes, solids = mesh(kind, (2, 2, 1), bent)
    for own in ([0.3, 0.4, 0.6], [1.7, 1.2, 1.0], [2.0, 2.0, 0.0]):
        place = bent(np.array([own]))[0]
        weights = interpolation(nodes, solids, place)
        assert weights is not None and weights.sum() == pytest.approx(1, abs=ROUNDING)
        assert abs(weights @ nodes - place).max() < SOLVED
    assert interpolation(nodes, solids, np.array([9.0, 9.0, 9.0])) is None
    assert interpolation(nodes, solids, bent(np.array([[1.0, 1.0, 1.2]]))[0]) is None


def test_a_folded_cell_is_refused() -> None:
    nodes, solids = mesh("hexahedron", (1, 1, 1))
    nodes[[0, 6]] = nodes[[6, 0]]
    with pytest.raises(InputError, match="folded"):
        nodal_strain(nodes, solids)


def test_a_cantilever_has_the_strain_of_a_beam() -> None:
    """Tip load F: strain F (L - x) z / (E I) on the surface, a fifth of the length from the clamp."""
    pytest.importorskip("skfem")
    length, width, height, force = 1.0, 0.04, 0.05, 100.0
    material = fe.Material(210e9, 0.3, 7800.0)
    block = fe.Block("beam", (20, 1, 1), lambda u: (u - [0, 0.5, 0.5]) * [length, width, height])
    lattice = fe.join([block], 2)
    _, K = fe.assemble(lattice, material)
    x, _, z = lattice.nodes.T
    load, tip = np.zeros((len(x), 3)), np.isclose(x, length)
    load[tip, 2] = force / tip.sum()
    free = np.flatnonzero(np.repeat(x > 0, 3))
    moved = np.zeros(3 * len(x))
    moved[free] = spsolve(K[free][:, free].tocsc(), load.ravel()[free])
    solids = {"triquadratic_hexahedron": lattice.vtk_cells}
    weights = interpolation(lattice.nodes, solids, np.array([0.2 * length, 0.0, height / 2]))
    gauge = nodal_strain(lattice.nodes, solids).mean(weights)
    read = along(gauge(moved.reshape(-1, 3, 1)), np.array([[1.0, 0, 0]]))[0, 0]
    wanted = -force * 0.8 * length * (height / 2) / (210e9 * width * height**3 / 12)
    assert read == pytest.approx(wanted, rel=1e-3)
    assert abs(read / wanted - 1) > SOLVED  # a lattice of its own, not the formula
