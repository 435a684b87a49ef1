"""Structured hexahedra, elastic matrices and contact surfaces (fretwave.fe) against exact solutions."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh, spsolve
from tolerances import LAST_DIGITS, ROUNDING, TIGHT

from fretwave import fe
from fretwave.errors import InputError
from fretwave.fe.cache import cached, model_key

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")

STEEL = fe.Material(youngs_modulus=210e9, poisson_ratio=0.3, density=7800.0)
#: No lateral contraction: a bar in three dimensions is then the bar of the textbook.
CORK = fe.Material(youngs_modulus=1e9, poisson_ratio=0.0, density=1000.0)


def box(lengths, cells, order=2, material=STEEL):
    """Mesh, M and K of a box with one corner at the origin."""
    mesh = fe.join([fe.Block("box", cells, lambda u: u * lengths)], order)
    return mesh, *fe.assemble(mesh, material)


def bent(u):
    """A smooth map that bends every edge."""
    x, y, z = u.T
    return np.column_stack([x + 0.1 * y * z, y * (1 + 0.2 * x**2), z + 0.1 * np.sin(x) + 0.05 * x * y])


def bent_pair(order):
    """Two blocks joined at x = 1, the second one starting from another corner of its cube."""
    turned = fe.Block("b", (2, 3, 2), lambda u: bent(np.column_stack([1 + u[:, 1], 1 - u[:, 0], u[:, 2]])))
    return fe.join([fe.Block("a", (3, 2, 2), bent), turned], order)


def frequencies(M, K, held, count=1):
    """Lowest frequencies [rad/s] with some dofs held."""
    free = np.setdiff1d(np.arange(M.shape[0]), held)
    values = eigsh(K[free][:, free].tocsc(), k=count, M=M[free][:, free].tocsc(), sigma=0.0, return_eigenvectors=False)
    return np.sqrt(np.sort(values))


def bar_error(order, n):
    """Relative error of the third axial frequency of a bar held at x = 0, n elements."""
    mesh, M, K = box([1.0, 0.2, 0.2], (n, 1, 1), order, CORK)
    lateral = np.concatenate([np.arange(1, mesh.n_dof, 3), np.arange(2, mesh.n_dof, 3)])
    held = np.union1d(lateral, 3 * np.flatnonzero(mesh.nodes[:, 0] < 1e-9))
    exact = 2.5 * np.pi * np.sqrt(CORK.youngs_modulus / CORK.density)
    return frequencies(M, K, held, 3)[2] / exact - 1


@pytest.mark.parametrize("order", [1, 2])
def test_patch_of_constant_strain_is_exact(order):
    mesh = bent_pair(order)
    _, K = fe.assemble(mesh, STEEL)
    gradient = np.array([[1.0, 0.3, -0.2], [0.1, -0.5, 0.4], [0.7, 0.2, 0.6]])
    exact = (mesh.nodes @ gradient.T).ravel()
    outside = np.unique(mesh.boundary_faces)
    held = (3 * outside[:, None] + np.arange(3)).ravel()
    inside = np.setdiff1d(np.arange(mesh.n_dof), held)
    assert len(inside) > 0
    found = spsolve(K[inside][:, inside].tocsc(), -K[inside][:, held] @ exact[held])
    assert abs(found - exact[inside]).max() < TIGHT * abs(exact).max()
    strain = (gradient + gradient.T) / 2
    first, shear = STEEL.lame
    energy = first * np.trace(strain) ** 2 + 2 * shear * (strain**2).sum()
    assert exact @ (K @ exact) == pytest.approx(energy * mesh.volume, rel=1e-11)


@pytest.mark.parametrize("order", [1, 2])
def test_bar_frequency_converges_from_above_with_twice_the_order(order):
    errors = [bar_error(order, n) for n in (8, 16)]
    assert 0 < errors[1] < errors[0] < 0.05
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * order, abs=0.15)


def beam_deviation(height, order=2, n=16):
    """First bending frequency of a cantilever of unit length against Euler's and Bernoulli's, minus one."""
    mesh, M, K = box([1.0, height, height], (n, 1, 1), order, CORK)
    clamp = np.flatnonzero(mesh.nodes[:, 0] < 1e-9)
    found = frequencies(M, K, (3 * clamp[:, None] + np.arange(3)).ravel())[0]
    return found / (1.8751040687**2 * height * np.sqrt(CORK.youngs_modulus / CORK.density / 12)) - 1


def test_beam_tends_to_the_slender_beam_with_the_square_of_its_thickness():
    deviations = [beam_deviation(height) for height in (0.1, 0.05)]
    assert -0.012 < deviations[0] < deviations[1] < 0  # shear and rotary inertia soften
    assert np.log2(deviations[0] / deviations[1]) == pytest.approx(2, abs=0.12)
    assert beam_deviation(0.05, order=1) > 0.3  # trilinear elements lock: the cases use quadratic ones


@pytest.mark.parametrize("order", [1, 2])
def test_mass_symmetry_and_rigid_motions(order):
    mesh = bent_pair(order)
    M, K = fe.assemble(mesh, STEEL)
    report = fe.check_matrices(mesh, STEEL, M, K)
    assert report.mass_error < 1e-13
    assert report.asymmetry < LAST_DIGITS
    assert report.rigid_residual < 1e-13
    energies = np.linalg.eigvalsh(K.toarray()) / abs(K).max()
    assert (abs(energies) < ROUNDING).sum() == 6 and energies[6] > 1e-9


def test_volume_of_a_curved_block_converges_to_the_cylinder():
    def sector(u):
        r, angle = 1 + u[:, 0], np.pi / 2 * u[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), u[:, 2]])

    errors = [abs(fe.join([fe.Block("s", (2, n, 1), sector)]).volume / (0.75 * np.pi) - 1) for n in (3, 6)]
    assert errors[1] < 2e-5 and np.log2(errors[0] / errors[1]) > 3.8


@pytest.mark.parametrize("order", [1, 2])
def test_joined_blocks_share_their_nodes(order):
    mesh = bent_pair(order)
    a, b = (np.array(mesh.lattice[name].shape) for name in "ab")
    assert len(mesh.nodes) == a.prod() + b.prod() - a[1] * a[2]
    distance = np.linalg.norm(mesh.nodes[:, None] - mesh.nodes, axis=-1) + np.eye(len(mesh.nodes))
    assert distance.min() > 0.1 / order
    assert len(mesh.boundary_faces) == 2 * (3 * 2 + 3 * 2 + 2 * 2) + 2 * (2 * 3 + 3 * 2 + 2 * 2) - 2 * 2 * 2
    assert sorted(np.unique(mesh.vtk_cells)) == list(range(len(mesh.nodes)))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("ratio", [2, 3])
def test_blocks_that_touch_without_sharing_nodes_are_refused(order, ratio):
    blocks = [fe.Block("a", (1, 2, 1), lambda u: u), fe.Block("b", (1, 2 * ratio, 1), lambda u: u + [1, 0, 0])]
    with pytest.raises(InputError, match="touch without sharing their nodes") as caught:
        fe.join(blocks, order)
    assert "(1, " in caught.value.where and "fix:" in caught.value.render()


def test_folded_and_distorted_elements_are_named():
    mirrored = fe.join([fe.Block("good", (1, 1, 1), lambda u: u), fe.Block("bad", (2, 1, 1), lambda u: [3, 0, 0] - u)])
    with pytest.raises(InputError, match="folded") as caught:
        mirrored.check_quality()
    assert "block 'bad'" in caught.value.where
    flat = fe.join([fe.Block("thin", (1, 1, 1), lambda u: u * np.column_stack([1 + 0 * u[:, :2], 0.01 + u[:, 0]]))])
    assert flat.quality().ratio == pytest.approx(0.01 / 1.01)
    with pytest.raises(InputError, match="badly distorted"):
        flat.check_quality()
    assert fe.join([fe.Block("b", (2, 2, 2), lambda u: u * [1, 9, 5])]).quality().ratio == pytest.approx(1)


def test_nodal_areas_are_simpsons_rule_on_a_plane_and_sum_to_the_surface():
    mesh, *_ = box([2.0, 1.0, 1.0], (1, 1, 1))
    areas = fe.nodal_areas(mesh, mesh.block_faces("box", 2, 1))[mesh.block_side("box", 2, 1)]
    assert areas == pytest.approx(2.0 * np.outer([1, 4, 1], [1, 4, 1]) / 36)
    assert fe.nodal_areas(mesh, mesh.boundary_faces).sum() == pytest.approx(10.0)
    top = mesh.faces_where(lambda x: x[:, 2] > 1 - 1e-9)
    assert len(top) == 1 and mesh.nearest((2, 1, 1)) in top


def test_centrifugal_load_pulls_the_mass_centre_and_has_no_component_along_the_axis():
    mesh, M, _ = box([0.2, 0.1, 0.3], (2, 1, 2))
    load = fe.centrifugal_load(M, mesh.nodes, 100.0, (0, 0, -1.0), (2, 0, 0)).reshape(-1, 3)
    mass = STEEL.density * 0.2 * 0.1 * 0.3
    assert load.sum(axis=0) == pytest.approx(mass * 100.0**2 * np.array([0.0, 0.05, 1.15]))
    assert abs(load[:, 0]).max() == 0


@pytest.mark.parametrize("average", [False, True])
@pytest.mark.parametrize("order", [1, 2])
def test_contact_patch_and_the_rows_of_b(order, average):
    mesh = fe.join([fe.Block("b", (4, 6, 2), bent)], order)
    patch = fe.contact_patch(mesh, "b", 0, 1, (3, 1), average)
    frames = fe.tangent_frames(patch.normals, (0, 0, 1))
    assert np.einsum("nij,nkj->nik", frames, frames) == pytest.approx(
        np.broadcast_to(np.eye(3), (3, 3, 3)), abs=LAST_DIGITS
    )
    assert np.linalg.det(frames) == pytest.approx(1.0)
    assert (patch.normals[:, 0] > 0.5).all()
    assert patch.areas.sum() == pytest.approx(fe.nodal_areas(mesh, mesh.block_faces("b", 0, 1)).sum())
    B = fe.relative_rows(patch.weights, frames)
    assert B.shape == (9, mesh.n_dof)
    move = np.array([0.3, -1.0, 2.0])
    assert (B @ np.tile(move, len(mesh.nodes))).reshape(3, 3) == pytest.approx(frames @ move)
    assert (B @ mesh.nodes.ravel()).reshape(3, 3) == pytest.approx(
        np.einsum("nij,nj->ni", frames, patch.weights @ mesh.nodes)
    )
    if not average:
        assert np.diff(B.indptr).max() <= 3 and patch.points == pytest.approx(mesh.nodes[patch.nodes])


def test_contact_points_lie_at_the_centres_of_their_cells():
    mesh, *_ = box([6.0, 4.0, 1.0], (6, 4, 1))
    patch = fe.contact_patch(mesh, "box", 2, 1, (3, 4))
    x, y = np.meshgrid([1, 3, 5], [0.5, 1.5, 2.5, 3.5], indexing="ij")
    assert patch.points == pytest.approx(np.column_stack([x.ravel(), y.ravel(), np.ones(12)]))
    assert patch.normals == pytest.approx(np.tile([0, 0, 1], (12, 1)))
    assert patch.areas == pytest.approx(np.full(12, 2.0))


def test_input_errors_say_what_to_do():
    mesh, *_ = box([1.0, 1.0, 1.0], (2, 2, 1))
    for call, words in [
        (lambda: fe.contact_patch(mesh, "box", 2, 1, (3, 2)), "contact grid does not fit"),
        (lambda: mesh.block_faces("lid", 0, 0), "no such block"),
        (lambda: fe.join([], 2), "cannot be joined"),
        (lambda: fe.join([fe.Block("b", (1, 1, 0), bent)]), "has no cells"),
        (lambda: fe.tangent_frames(np.eye(3), (1, 0, 0)), "parallel to the first tangent"),
        (lambda: fe.Material(1e9, 0.5, 1000.0), "not physical"),
        (lambda: fe.centrifugal_load(sp.identity(3), np.zeros((1, 3)), 1.0, (0, 0, 0), (0, 0, 0)), "no direction"),
    ]:
        with pytest.raises(InputError, match=words) as caught:
            call()
        assert caught.value.fix


def test_missing_scikit_fem_is_reported_with_its_installation(monkeypatch):
    mesh = fe.join([fe.Block("b", (1, 1, 1), lambda u: u)])
    monkeypatch.setitem(sys.modules, "skfem", None)
    with pytest.raises(InputError, match="needs scikit-fem") as caught:
        fe.assemble(mesh, STEEL)
    assert "fix:      pip install scikit-fem" in caught.value.render()


def test_cached_models_come_back_whole(tmp_path: Path):
    values = {"K": sp.random(5, 4, 0.5, format="csr", random_state=1), "n": 3, "x": np.arange(4.0), "name": "a"}
    file = tmp_path / "deep" / "model.npz"
    cached(file, lambda: values)
    again = cached(file, lambda: pytest.fail("built twice"))
    assert (again["K"] != values["K"]).nnz == 0 and again["K"].shape == (5, 4)
    assert (again["n"], again["name"]) == (3, "a") and (again["x"] == values["x"]).all()
    assert [path.name for path in file.parent.iterdir()] == ["model.npz"]
    assert model_key({"a": 1}, []) != model_key({"a": 2}, []) != model_key({"a": 2}, [Path(__file__)])
