"""A rank that fails between collective calls fails on all ranks with the same words; singular blocks fail a step.

The long form, 40 faults in runs of the command line, is cases/robustness/faults.py.
"""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import TanhLaw, chain, whole
from petsc4py import PETSc
from tolerances import REPEATED

import fretwave as fw
from fretwave import _core
from fretwave.errors import FretwaveError

pytestmark = pytest.mark.ranks(1, 2, 3)

LOCAL = ["contact force", "summary", "contact samples", "settle", "wear", "wearing", "contact tangents"]
PAIRS = {"normal_stiffness": 50.0, "tangential_stiffness": 30.0, "friction_coefficient": 0.3, "normal_load": 1.0}


def model_of(comm, contacts=None, n=9):
    B = np.eye(n)
    contacts = contacts or [fw.Contact("coulomb_3d", B, PAIRS)]
    return fw.Model(np.eye(n), chain(n, 100.0), 0.02 * chain(n), contacts, comm)


def mode_of(model, prefix="faulty_"):
    linear = fw.linear_modes(model, 1, "free")[0]
    return fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], 32), "EPMC", 0, linear, prefix)


def arm(comm, place, kind, rank=-1, count=1):
    """On the last rank, unless another one is named."""
    if comm.rank == rank % comm.size:
        _core.arm_fault(place, kind, count)


@pytest.fixture(autouse=True)
def unarmed():
    yield
    _core.arm_fault("", "error", 0)


def everything(problem):
    """Passes every place at which a problem's ranks work by themselves."""
    y = problem.initial(0.5)
    depth = [np.zeros(len(problem.model.pairs_of(0))).tolist()]
    problem.residual(y)
    problem.diagnostics(y)
    problem.contact_period(y)
    problem.core.settle(y)
    problem.core.wear(depth)
    problem.core.wearing(y)
    problem.jacobian(y)


@pytest.mark.parametrize("kind", ["error", "input", "memory"])
@pytest.mark.parametrize("place", LOCAL)
def test_a_failure_of_one_rank_is_raised_by_all(comm, place, kind):
    """The same type and words on every rank; the problem serves on afterwards."""
    problem = mode_of(model_of(comm))
    arm(comm, place, kind)
    expected = fw.InputError if kind == "input" else (Exception if comm.size == 1 else FretwaveError)
    with pytest.raises(expected) as caught:
        everything(problem)
    said = comm.allgather((type(caught.value).__name__, str(caught.value)))
    assert len(set(said)) == 1, said
    if kind == "error":
        assert "injected fault" in said[0][1]
    if comm.size > 1 and kind != "input":
        assert f"rank {comm.size - 1}" in said[0][1]
    everything(problem)


@pytest.mark.parametrize("wrong", [0, 1])
def test_a_law_in_python_that_raises_on_one_rank_is_raised_by_all(comm, wrong):
    """Before: that rank alone left, and where Python catches the error, the others waited for ever."""

    class Broken(TanhLaw):
        def force(self, u, v):
            if comm.rank == wrong % comm.size:
                raise ZeroDivisionError("division by a gap")
            return super().force(u, v)

    problem = mode_of(model_of(comm, [fw.Contact(Broken(1.0, 1.0), np.eye(9))]))
    with pytest.raises(Exception, match="division by a gap") as caught:
        problem.residual(problem.initial(0.5))
    names = comm.allgather(type(caught.value).__name__)
    assert set(names) == {"ZeroDivisionError" if comm.size == 1 else "FretwaveError"}
    if comm.size > 1:
        assert f"rank {wrong % comm.size}" in str(caught.value)


def newton_of(problem, y):
    newton = _core.Newton(problem.core, problem.prefix)
    row = problem.core.unknowns()
    begin, end = row.getOwnershipRange()
    row.set(0.0)
    if end == row.getSize() and end > begin:
        row.getArray()[-1] = 1.0
    value = problem.model.comm.bcast(y.getArray()[-1] if end > begin else 0.0, root=problem.model.comm.size - 1)
    newton.system.close(row, value)
    return newton


def solved_alike(comm, newton, start):
    """Whether Newton converges from the start, with one outcome and reason on all ranks, and where to."""
    y = start.copy()
    found = newton.solve(y)
    assert len(set(comm.allgather((found[0], found[4])))) == 1
    return found[0], y


@pytest.mark.parametrize(
    "blocks, place", [("dense", "harmonic block"), ("sparse", "sparse block"), ("sparse", "condensed system")]
)
def test_a_singular_block_on_one_rank_fails_a_step_not_the_run(comm, blocks, place):
    """No exception, the same answer on every rank: the right one, for the preconditioner is made again."""
    options = PETSc.Options("faulty_")
    options["route"], options["blocks"] = "krylov", blocks
    try:
        problem = mode_of(model_of(comm))
        start = problem.initial(0.5)
        newton = newton_of(problem, start)
        undisturbed = start.copy()
        assert newton.solve(undisturbed)[0]
        arm(comm, place, "value", rank=0)
        found, y = solved_alike(comm, newton_of(problem, start), start)
        assert found and np.abs(whole(y) - whole(undisturbed)).max() < REPEATED
    finally:
        del options["route"], options["blocks"]


def test_a_force_that_is_no_number_on_one_rank_fails_no_more_than_the_step(comm):
    """A number that comes out wrong once is as if nothing had been, in this solve or in the next."""
    problem = mode_of(model_of(comm))
    start = problem.initial(0.5)
    newton = newton_of(problem, start)
    undisturbed = start.copy()
    assert newton.solve(undisturbed)[0]
    arm(comm, "contact force", "value", rank=0)
    found, y = solved_alike(comm, newton, start)
    if not found:
        found, y = solved_alike(comm, newton, start)
    assert found and np.abs(whole(y) - whole(undisturbed)).max() < REPEATED


@pytest.mark.ranks(2, 3)
def test_rows_of_b_that_fit_the_law_on_all_ranks_but_one(comm):
    """Before: that rank alone refused, and the others went on into the next collective call."""
    model = model_of(comm)
    B = PETSc.Mat().createAIJ(
        ((3 if comm.rank == 0 else 0, PETSc.DETERMINE), (model.distribute(np.eye(9)).shape[0], 9))
    )
    B.setUp()
    B.assemble()
    law = _core.make_law(
        "coulomb_3d", {**{k: [v] * (comm.rank < 2) for k, v in PAIRS.items()}, "gap": [0.0] * (comm.rank < 2)}
    )
    mat = PETSc.Mat().createAIJ(((model.distribute(np.eye(9)).shape[0], 9),) * 2)
    mat.setUp()
    mat.assemble()
    with pytest.raises(fw.InputError, match="does not fit"):
        _core.Model([(mat, 0, 0)], [("late", [(B, 0)], law, [])])
