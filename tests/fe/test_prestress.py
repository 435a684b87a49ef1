"""Stress stiffening and spin softening against strings, rotating bars and beams under tension."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh, spsolve
from tolerances import LAST_DIGITS, ROUNDING, SOLVED, TIGHT

from fretwave import fe
from fretwave.errors import InputError

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")

#: No lateral contraction: a bar in three dimensions is then the bar of the textbook.
CORK = fe.Material(youngs_modulus=1e9, poisson_ratio=0.0, density=1000.0)
STEEL = fe.Material(youngs_modulus=210e9, poisson_ratio=0.3, density=7800.0)
LENGTH, WIDTH, HEIGHT = 1.0, 0.04, 0.02


def bar(cells, order=2, material=CORK):
    """Mesh, M and K of a bar along x."""
    block = fe.Block("bar", cells, lambda u: (u - [0.0, 0.5, 0.5]) * [LENGTH, WIDTH, HEIGHT])
    mesh = fe.join([block], order)
    return mesh, *fe.assemble(mesh, material)


def nodal(mesh, x=0.0, y=0.0, z=0.0):
    """A displacement field (n_dof,) of three functions of the place."""
    return np.column_stack([np.broadcast_to(part, len(mesh.nodes)) for part in (x, y, z)]).ravel()


@pytest.mark.parametrize("order", [1, 2])
def test_stress_of_a_linear_displacement_is_exact(order):
    mesh, *_ = bar((3, 1, 1), order, STEEL)
    first, shear = STEEL.lame
    x, y, _ = mesh.nodes.T
    stress = fe.stresses(mesh, STEEL, nodal(mesh, 1e-3 * x + 4e-4 * y))
    wanted = 1e-3 * np.diag([first + 2 * shear, first, first])
    wanted[0, 1] = wanted[1, 0] = 4e-4 * shear
    assert np.abs(stress - wanted).max() < SOLVED * np.abs(wanted).max()


@pytest.mark.parametrize("order", [1, 2])
def test_tension_holds_a_string(order):
    """v' K_G v = integral of P v'^2 dx: P pi^2 / (2 L) for v = sin(pi x / L), with the element's order."""
    tension, errors = 50.0, []
    for cells in (8, 16):
        mesh, *_ = bar((cells, 1, 1), order)
        x = mesh.nodes[:, 0]
        stretched = nodal(mesh, x * tension / (WIDTH * HEIGHT * CORK.youngs_modulus))
        K = fe.stress_stiffness(mesh, CORK, stretched)
        v = nodal(mesh, z=np.sin(np.pi * x / LENGTH))
        errors.append(v @ K @ v / (tension * np.pi**2 / (2 * LENGTH)) - 1)
        assert abs(K @ nodal(mesh, 1.0, 2.0, 3.0)).max() < ROUNDING * abs(K).max()
        assert abs(K - K.T).max() < LAST_DIGITS * abs(K).max()
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * order, abs=0.1)


def test_beam_under_tension_stiffens_as_eulers_beam():
    """omega^2 = (pi / L)^4 EI / (rho A) + (pi / L)^2 P / (rho A), ends held on their middle lines."""
    mesh, M, K = bar((16, 1, 2))
    x, _, z = mesh.nodes.T
    ends = (np.isclose(x, 0) | np.isclose(x, LENGTH)) & np.isclose(z, 0)
    fixed = np.zeros((len(x), 3), dtype=bool)
    fixed[ends, 2] = True
    fixed[:, 1] = True
    fixed[np.isclose(x, 0) & np.isclose(z, 0), 0] = True
    free = np.flatnonzero(~fixed.ravel())

    def square(tension):
        stretched = nodal(mesh, x * tension / (WIDTH * HEIGHT * CORK.youngs_modulus))
        whole = (K + fe.stress_stiffness(mesh, CORK, stretched))[free][:, free].tocsc()
        return float(eigsh(whole, 1, M[free][:, free], sigma=0.0)[0][0])

    tension = 100.0
    gain = (np.pi / LENGTH) ** 2 * tension / (CORK.density * WIDTH * HEIGHT)
    # The beam's own shear and rotary inertia lower the gain by about (pi h / L)^2 / 12 = 3e-4.
    assert (square(tension) - square(0.0)) / gain == pytest.approx(1.0, abs=1e-3)


def test_rotating_bar_flaps_with_the_speed_and_lags_with_none():
    """A bar hinged on the axis: omega = Omega out of the plane of rotation, 0 in it, whatever its section."""
    speed = 300.0
    mesh, M, K = bar((12, 1, 1))
    load = fe.centrifugal_load(M, mesh.nodes, speed, (0, 0, 0), (0, 0, 1))
    load[1::3] = 0.0  # the slender bar's load along itself
    x = mesh.nodes[:, 0]
    free = np.setdiff1d(np.arange(mesh.n_dof), np.flatnonzero(nodal(mesh, np.isclose(x, 0), 1.0, 1.0)))
    displacement = np.zeros(mesh.n_dof)
    displacement[free] = spsolve(K[free][:, free].tocsc(), load[free])
    stiffening = fe.stress_stiffness(mesh, CORK, displacement)
    softening = fe.spin_softening(M, speed, (0, 0, 2.0))
    flap, lag = nodal(mesh, z=x), nodal(mesh, y=x)
    assert flap @ (stiffening + softening) @ flap / (flap @ M @ flap) == pytest.approx(speed**2, rel=TIGHT)
    assert abs(lag @ (stiffening + softening) @ lag) < TIGHT * speed**2 * (lag @ M @ lag)


def test_wrong_displacement_is_refused():
    mesh, *_ = bar((2, 1, 1))
    with pytest.raises(InputError, match="does not fit the mesh"):
        fe.stress_stiffness(mesh, CORK, np.zeros(6))
