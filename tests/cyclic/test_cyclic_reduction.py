"""Reduction of a sector: waves that are kept exactly, bounds from above, motions expanded, the stated error."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from models.cyclic_models import lumped_blisk
from tolerances import ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.cyclic.faces import rotation
from fretwave.cyclic.reduction import reduce_sector
from fretwave.cyclic.waves import WaveError
from fretwave.errors import InputError
from fretwave.model.sectors import ties

pytest.importorskip("skfem")

from models.built_sector import build  # noqa: E402

#: Rounding of frequencies: of K against its lowest eigenvalue.
ROUNDED = 1e-9


def pads(built) -> fw.Contact:
    given = built.pairs["pads"]
    return fw.Contact("coulomb_3d", given.B, {**given.parameters, "friction_coefficient": 0.3}, "pads")


def reduced(built, comm, **options):
    options.setdefault("keep", [built.dofs["tip"]])
    arguments = (built.M, built.K, built.low, built.high, built.sectors)
    return reduce_sector(*arguments, contacts=[pads(built)], axis="z", comm=comm, **options)


def unreduced(built) -> fw.Sector:
    arguments = (built.M, built.K, built.low, built.high, built.sectors)
    return fw.Sector.from_faces(*arguments, contacts=[pads(built)], axis="z")


@pytest.fixture(scope="module")
def built():
    return build()


def inner_dofs(built) -> int:
    kept = np.union1d(np.unique(built.pairs["pads"].B.indices), [built.dofs["tip"]])
    return built.M.shape[0] - len(np.union1d(kept, np.concatenate([built.low, built.high])))


@pytest.mark.parametrize("nodal_diameter", [0, 1, -2, 3])
def test_nothing_is_lost_with_whole_faces_and_all_component_modes(built, comm, nodal_diameter):
    with reduced(built, comm, modes=inner_dofs(built)) as reduction:
        small = reduction.sector()
    with unreduced(built).model(nodal_diameter, comm) as a, small.model(nodal_diameter, comm) as b:
        for state in ("stuck", "free"):
            found, wanted = ([m.omega for m in fw.linear_modes(model, 6, state)] for model in (b, a))
            assert found == pytest.approx(wanted, rel=ROUNDED)


def test_waves_that_gave_interface_modes_are_kept(built, comm):
    """With all component modes exactly, as the faces move in their own shapes; others are bounded from above."""
    options = dict(interface_diameters=[2], interface_waves=4, interface_tolerance=1e-9, modes=inner_dofs(built))
    with reduced(built, comm, **options) as reduction:
        assert reduction.n_interface == 16 < len(built.low)
        used, other = reduction.error([2, 1], count=4)[::2]
        assert used.gave_interface_modes and not other.gave_interface_modes
        assert np.abs(used.relative).max() < ROUNDED
        assert other.relative.min() > -ROUNDED and 1e-6 < other.largest < 0.1


def test_rigid_waves_have_no_error():
    """A line of these alone said that they are exact."""
    hz, errors = np.array([0.0, 0.0, 50.0]), np.array([np.nan, np.nan, 1e-3])
    assert WaveError(0, "free", None, hz, hz, errors).line() == (
        "0 nodal diameters, free: 50 to 50 Hz are off by 1.0e-03 (first) to 1.0e-03 (worst),"
        " 2 at 0 Hz, rigid or unstable, left out"
    )
    line = WaveError(0, "free", None, hz[:2], hz[:2], errors[:2]).line()
    assert line.endswith(": no frequency is compared, 2 at 0 Hz, rigid or unstable, left out")


def test_errors_fall_with_component_modes_and_are_not_negative(built, comm):
    found = []
    for modes in (0, 4, 12, 24):
        with reduced(built, comm, interface_diameters=[1, 2], interface_waves=4, modes=modes) as reduction:
            found.append([error.relative for error in reduction.error([1, 2, 3], 3)])
    errors = np.array(found)
    assert errors.min() > -ROUNDED and np.diff(errors, axis=0).max() < ROUNDED
    assert np.all(errors[-1].max(axis=1) < 0.05 * errors[0].max(axis=1)) and errors[0].max() > 1e-3


def test_the_stated_error_is_that_of_the_waves(built, comm):
    """Sliding: all pairs closed by their normal springs, without tangential force."""
    with reduced(built, comm, interface_diameters=[2], interface_waves=3, modes=5) as reduction:
        stated = reduction.error(count=3)
        assert [(e.nodal_diameter, e.state) for e in stated] == [(d, s) for d in (2, 0) for s in ("stuck", "sliding")]
        normal = pads(built).B[::3]
        K = built.K + 2e8 * normal.T @ normal
        sliding = fw.Sector.from_faces(built.M, K, built.low, built.high, built.sectors, axis="z")
        with sliding.model(2, comm) as model, unreduced(built).model(2, comm) as stuck:
            wanted = [[m.frequency_hz for m in fw.linear_modes(s, 3, "stuck")] for s in (stuck, model)]
        for error, full in zip(stated[:2], wanted):
            assert error.full_hz == pytest.approx(full, rel=ROUNDED)
            assert error.relative == pytest.approx(error.reduced_hz / full - 1, abs=ROUNDED)
    assert "2 nodal diameters, stuck (gave interface modes)" in stated[0].line()


@pytest.mark.parametrize("faces", [{}, {"interface_diameters": [2], "interface_waves": 4, "interface_tolerance": 1e-9}])
def test_expanded_waves_solve_the_unreduced_equations(built, comm, faces):
    """T^H (K - omega^2 M) T q = 0 of the tied sector, and the high face is the low one, turned and delayed."""
    with reduced(built, comm, modes=inner_dofs(built), **faces) as reduction:
        sector = reduction.sector()
        with sector.model(2, comm) as model:
            mode = fw.linear_modes(model, 2, "free")[1]
        q = sector.expand(mode.shape + 1j * mode.imaginary, 2)
        x = reduction.expand(q.real) + 1j * reduction.expand(q.imag)
    theta = 2 * np.pi * 2 / built.sectors
    turn = rotation(2 * np.pi / built.sectors, "z")
    moved = np.exp(-1j * theta) * x[built.low].reshape(-1, 3) @ turn.T
    assert x[built.high].reshape(-1, 3) == pytest.approx(moved, rel=0, abs=ROUNDING * np.abs(x).max())
    forces = (built.K - mode.omega**2 * built.M) @ x
    ties = unreduced(built).ties
    rest = sum(np.exp(1j * k * theta) * (T.T @ forces) for k, T in ties.items())
    if not faces:
        assert np.abs(rest).max() < 1e-7 * np.abs(built.K @ x).max()
    inner = np.setdiff1d(np.arange(len(x)), np.concatenate([built.low, built.high]))
    assert np.abs(forces[inner]).max() < 1e-7 * np.abs(built.K @ x).max()


def test_kept_dofs_stand_for_themselves(comm):
    """Observation dof, contact dofs inside and on a face: coordinates of their own, in B and in expanded motions."""
    built = build(on_face=True)
    touched = np.unique(built.pairs["pads"].B.indices)
    with reduced(built, comm, interface_diameters=[2], interface_waves=4, modes=3) as reduction:
        assert reduction.n_interface == 3 + 16 and set(touched) <= set(reduction.places)
        x_r = np.random.default_rng(1).standard_normal(reduction.size)
        x = reduction.expand(x_r)
        for dof, place in reduction.places.items():
            assert x[dof] == pytest.approx(x_r[place], rel=ROUNDING)
        assert reduction.contacts[0].B[0] @ x_r == pytest.approx(pads(built).B @ x, rel=TIGHT, abs=ROUNDING)
        load = built.loads["weight"]
        assert reduction.project(load) @ x_r == pytest.approx(load @ x, rel=TIGHT)


@pytest.mark.ranks(1, 2, 3)
def test_the_reduction_does_not_depend_on_the_number_of_ranks(built, comm):
    """Signs and rotations of interface modes included: against the same made by every rank for itself."""
    options = dict(interface_diameters=[1, 2], interface_waves=3, modes=8)
    from mpi4py import MPI

    with reduced(built, comm, **options) as shared, reduced(built, MPI.COMM_SELF, **options) as own:
        assert shared.n_interface == own.n_interface
        for found, wanted in ((shared.K, own.K), (shared.M, own.M)):
            assert found == pytest.approx(wanted, rel=0, abs=TIGHT * np.abs(wanted).max())


def test_a_lumped_sector_without_axis(comm):
    """The chain's disk is its face: nothing is lost when the blade's dofs are all component modes."""
    one, tie = lumped_blisk(), 5e7
    K = np.zeros((4, 4))
    K[:3, :3] = np.asarray(one.K[0]) + 2 * np.asarray(one.K[1])
    K[np.ix_([0, 3], [0, 3])] += tie * np.array([[1, -1], [-1, 1]])
    M = np.diag([*np.diag(one.M), 0.0])
    with reduce_sector(M, K, [0], [3], 24, keep=[0, 3], modes=2, comm=comm) as reduction:
        assert reduction.places == {0: 0, 3: 1} and reduction.size == 4
        with reduction.sector().model(4, comm) as a, one.model(4, comm) as b:
            found, wanted = ([m.omega for m in fw.linear_modes(model, 3)] for model in (a, b))
        assert found == pytest.approx(wanted, rel=TIGHT)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("diameters", [[], [4], [-1, 7]])
def test_waves_that_do_not_exist_are_refused(built, comm, diameters):
    with pytest.raises(InputError, match="no such waves"):
        reduced(built, comm, interface_diameters=diameters)


def test_damping_is_reduced_alike(built, comm):
    C = sp.csr_matrix(1e-6 * built.K + 2.0 * built.M)
    with reduced(built, comm, C=C, modes=4) as reduction:
        wanted = 1e-6 * reduction.K + 2.0 * reduction.M
        assert pytest.approx(wanted, rel=0, abs=SOLVED * np.abs(wanted).max()) == reduction.C


@pytest.mark.ranks(1)
@pytest.mark.parametrize("nodal_diameter", [0, 1, -2])
def test_what_is_omitted_of_a_sector_in_a_wave_is_what_its_frequencies_miss(built, nodal_diameter):
    """With all other component modes the dynamic stiffness is singular at the unreduced wave's frequencies."""
    with unreduced(built).model(nodal_diameter) as full:
        omega = fw.linear_modes(full, 4, "free")[3].omega
    turn, half = 2 * np.pi * nodal_diameter / built.sectors, (inner_dofs(built) + 1) // 2
    for modes, far in ((2, 1e-3), (half, 1e-5)):
        with reduced(built, None, modes=modes) as r:
            T = ties(r.low, r.high, r.size, r.sectors, None)
            omitted, K, M = r.omitted.tied(T), r.K, r.M
        wave = sum(np.exp(-1j * k * turn) * part.toarray() for k, part in T.items())
        Z = wave.conj().T @ (K - omega**2 * M) @ wave
        s, unit = 1j * omega, np.eye(len(Z), dtype=complex)
        forces = np.column_stack([omitted.forces(s, s * s, x, turn) for x in unit])
        lost, left = (
            np.abs(np.linalg.eigvals(np.linalg.solve(wave.conj().T @ M @ wave, A))).min() for A in (Z, Z + forces)
        )
        assert lost > far * omega**2
        assert left < ROUNDED * omega**2 if modes == half else left < 0.2 * lost


@pytest.mark.ranks(1)
def test_nothing_is_known_of_faces_that_are_reduced(built):
    with reduced(built, None, modes=2, interface_diameters=[0, 2]) as r:
        assert not r.omitted.known
