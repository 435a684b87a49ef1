"""What -route and -blocks ask for is taken, or refused in words; a wheel that does not repeat falls back to blocks."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import options, unknowns, whole
from models.cyclic_models import rich_sector
from petsc4py import PETSc
from tolerances import REPEATED

import fretwave as fw
from fretwave import _core
from fretwave.errors import PetscError

SECTORS, UNIT = 6, 2
SLIDER = {"tangential_stiffness": 3.0, "friction_limit": 0.4}


def asked(**values):
    """PETSc options of the prefix blocks_."""
    return options(**{f"blocks_{name}": value for name, value in values.items()})


def wheel(comm, rubbing=range(SECTORS), dof_of=lambda sector: 0):
    """Six sectors of two dofs; those that rub have one slider each, on a dof of their own."""
    n = SECTORS * UNIT
    K = np.kron(np.eye(SECTORS), [[3.0, -1.0], [-1.0, 2.0]])
    for j in range(SECTORS):
        here, there = UNIT * j, UNIT * ((j + 1) % SECTORS)
        K[np.ix_([here, there], [here, there])] += 0.3 * np.array([[1, -1], [-1, 1]])
    B = np.zeros((len(rubbing), n))
    for row, sector in enumerate(rubbing):
        B[row, UNIT * sector + dof_of(sector)] = 1.0
    return fw.Model(np.eye(n), K, 0.01 * K, [fw.Contact("jenkins", B, SLIDER)], comm, unit=UNIT)


def mode_of(model, avoid=None):
    start = fw.LinearMode(1.3, 0.0, np.ones(model.n_dof), np.zeros(model.n_dof))
    return fw.NonlinearMode(model, fw.Harmonics([1, 3], 32), "EPMC", 0, start, "blocks_", avoid)


def newton_of(problem):
    return _core.Newton(problem.core, problem.prefix)


@pytest.mark.parametrize(
    "rubbing, dof_of",
    [
        ([0, 1, 2], lambda sector: 0),  # a number of pairs that the sectors cannot share
        ([0, 0, 1, 1, 2, 2], lambda sector: 0),  # as many as sectors, but two in each of three
        (range(SECTORS), lambda sector: sector % 2),  # one in each, on another dof in every second
    ],
)
def test_a_wheel_whose_contact_does_not_repeat_falls_back(comm, rubbing, dof_of):
    """Before: an error that took the wheel for bad input. The solution is that of the direct route."""
    found = {}
    for route in ("direct", "krylov"):
        with asked(route=route):
            problem = mode_of(wheel(comm, rubbing, dof_of))
            newton = newton_of(problem)
            if route == "krylov":
                assert "contact not the same in all sectors: no fwwheel" in newton.route
            y = problem.initial(0.4)
            row = unknowns(problem, np.eye(1, len(whole(y)), len(whole(y)) - 1)[0])
            newton.system.close(row, np.log(0.4))
            assert newton.solve(y)[0]
            found[route] = whole(y)
    assert np.allclose(found["krylov"], found["direct"], rtol=0, atol=REPEATED)


def test_a_wheel_that_repeats_is_dealt_with_by_its_waves(comm):
    with asked(route="krylov"):
        assert f"{SECTORS} nodal diameters" in newton_of(mode_of(wheel(comm))).route


@pytest.mark.parametrize("blocks, words", [("dense", "dense blocks of 12 dofs"), ("sparse", "sparse factors")])
def test_blocks_asked_for_are_taken_on_a_wheel_too(comm, blocks, words):
    """Before: ignored."""
    with asked(route="krylov", blocks=blocks):
        assert words in newton_of(mode_of(wheel(comm))).route


@pytest.mark.parametrize("blocks", ["dense", "sparse"])
def test_blocks_that_an_unfolded_wheel_has_not_are_refused(comm, blocks):
    avoid = np.kron(np.exp(1j * np.arange(SECTORS)), [1.0, 0.5])
    with asked(route="krylov", blocks=blocks), pytest.raises(fw.InputError, match="(?s)option blocks.*unfolded"):
        newton_of(mode_of(wheel(comm), avoid))


def test_sparse_blocks_of_a_contact_that_reaches_the_next_sector_are_refused(comm):
    """Before: dense ones were made without a word."""
    problem = mode_of(rich_sector().model(2, comm))
    with asked(route="krylov", blocks="sparse"), pytest.raises(fw.InputError, match="reaches the next sector"):
        newton_of(problem)


def solved(problem):
    """At amplitude 0.4, and Newton's solver."""
    newton, y = newton_of(problem), problem.initial(0.4)
    newton.system.close(unknowns(problem, np.eye(1, len(whole(y)), len(whole(y)) - 1)[0]), np.log(0.4))
    assert newton.solve(y)[0]
    return whole(y), newton


@pytest.mark.parametrize("kind", ["fwwheel", "fwcondensed", "fwblocks", "none"])
def test_a_preconditioner_is_a_type_of_petscs(comm, kind, tmp_path):
    """Chosen by -pc_type, said by PCView; the solution is that of the direct route."""
    with asked(route="direct"):
        expected, _ = solved(mode_of(wheel(comm)))
    with asked(route="krylov", pc_type=kind):
        found, newton = solved(mode_of(wheel(comm)))
    assert np.allclose(found, expected, rtol=0, atol=REPEATED)
    pc = newton.snes.getKSP().getPC()
    assert pc.getType() == kind
    viewer = PETSc.Viewer().createASCII(str(tmp_path / "pc.txt"), comm=comm)
    pc.view(viewer)
    viewer.destroy()
    if comm.rank == 0 and kind != "none":
        said = newton.route.partition("), ")[2]
        assert said and said in (tmp_path / "pc.txt").read_text()


def test_a_lag_of_newtons_does_not_keep_what_is_stale(comm):
    """Before: PCSetUp did nothing under SNES' lag, and a fallback was applied that was never made."""
    with asked(route="direct"):
        expected, _ = solved(mode_of(wheel(comm)))
    for lag in (2, -2):
        with asked(route="krylov", snes_lag_preconditioner=lag):
            assert np.allclose(solved(mode_of(wheel(comm)))[0], expected, rtol=0, atol=REPEATED)


def test_a_solver_may_outlive_what_made_it(comm, tmp_path):
    with asked(route="krylov"):
        problem = mode_of(wheel(comm))
        newton = newton_of(problem)
    snes = newton.snes
    del newton, problem
    viewer = PETSc.Viewer().createASCII(str(tmp_path / "snes.txt"), comm=comm)
    snes.view(viewer)
    viewer.destroy()


def test_our_types_stand_alone_on_the_krylov_route(comm):
    with (
        asked(route="direct", pc_type="fwblocks"),
        pytest.raises(fw.InputError, match="the direct route takes no fwblocks"),
    ):
        newton_of(mode_of(wheel(comm)))
    with asked(route="krylov", pc_type="composite", pc_composite_pcs="fwblocks,none"), pytest.raises(PetscError):
        solved(mode_of(wheel(comm)))


def test_a_type_that_is_not_for_the_problem_is_refused(comm):
    for kind, model, why in (
        ("fwwheel", rich_sector().model(2, comm), "no whole wheel"),
        ("fwcondensed", rich_sector().model(2, comm), "reaches the next sector"),
        ("fwbasis", wheel(comm), "without a basis of stuck pairs"),
    ):
        with asked(route="krylov", pc_type=kind), pytest.raises(fw.InputError, match=f"option pc_type.*{why}"):
            newton_of(mode_of(model))


def test_a_mode_to_avoid_without_inertia_is_refused(comm):
    with pytest.raises(fw.InputError, match="no inertia"):
        mode_of(wheel(comm), np.zeros(SECTORS * UNIT, dtype=complex))


def test_counts_that_32_bit_petsc_does_not_hold_are_refused(comm):
    """A model of few dofs and as many harmonics as no memory holds stays small: the refusal comes first."""
    if np.dtype(PETSc.IntType).itemsize > 4:
        pytest.skip("this PETSc counts in 64 bits")
    n = 120_000
    K = PETSc.Mat().createAIJ((n, n), nnz=1, comm=comm)
    K.setUp()
    begin, end = K.getOwnershipRange()
    for row in range(begin, end):
        K.setValue(row, row, 1.0)
    K.assemble()
    model = fw.Model(K, K)
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    with pytest.raises(fw.InputError, match="more unknowns than this build of PETSc can count"):
        fw.NonlinearMode(model, fw.Harmonics(range(10_001), 20_004), "EPMC", 0, start)
