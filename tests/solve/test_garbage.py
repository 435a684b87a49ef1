"""What is made is freed: PETSc keeps every vector that Python drops, and a large model's are large."""

from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
import pytest
from models.duffing import mode, response
from petsc4py import PETSc

import fretwave as fw

CASES = Path(__file__).parents[2] / "cases"
M, K = [[1.0, 0.0], [0.0, 0.02]], [[640.0, -40.0], [-40.0, 40.0]]


def followed():
    branch = fw.follow(mode(), 0.1, 4.0)
    branch.coefficients(1.5)
    branch.at(zeta=float(branch["zeta"][2]))
    response()


def as_accurate_as_asked():
    fw.follow(mode(), 0.1, 4.0, accuracy=1e-4)


def gone_on_with():
    """Of a branch that is left half way, its point is the script's."""
    problem = mode()
    y0 = problem.initial(0.1)
    first = fw.Continuation(problem, y0, (0.1, 1.0))
    y0.destroy()
    for point in first:
        snapshot = first.snapshot()
        point.destroy()
        if point.index == 3:
            break
    first.destroy()
    second = fw.Continuation.restore(problem, snapshot, (0.1, 1.0))
    for point in second:
        point.destroy()
    second.destroy()


def model():
    contact = fw.Contact(
        "coulomb_2d",
        [[0.0, 1.0], [1.0, 0.0]],
        {"tangential_stiffness": 100.0, "normal_stiffness": 100.0, "friction_coefficient": 0.3},
        name="contact",
    )
    return fw.Model(M, K, contacts=[contact])


def at_rest():
    fw.static_preload(model(), [5.0, 2.0])
    fw.static_preload(model(), [5.0, 2.0], sliders={"contact": np.array([[1e-3]])})


def unheld():
    contact = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 1.0, "friction_limit": 1.0})
    with pytest.raises(fw.NotConverged):
        fw.static_preload(fw.Model([[1.0]], [[0.0]], contacts=[contact]), [2.0])


def worn():
    one = model()
    rest = fw.static_preload(one, [5.0, 2.0])
    problem = fw.NonlinearMode(one, fw.choose_harmonics(one, 3, 64, "all"), rest=rest)
    branch = fw.follow(problem, 1e-3, 1e-1)
    fw.wear(branch, 5e-2, 1e-6, {"contact": [1.0]}, 1e3)


@pytest.mark.ranks(1, 2, 4)
@pytest.mark.parametrize("work", [followed, as_accurate_as_asked, gone_on_with, at_rest, unheld, worn])
def test_nothing_is_left_to_petsc(capfd, comm, work):
    """Its garbage list after a script's work; freed first is what other tests left."""
    kept = PETSc.Vec().createMPI(1, comm=comm)  # PETSc's own communicator must outlive what is freed
    gc.collect()
    PETSc.garbage_cleanup(comm)
    work()
    gc.collect()
    capfd.readouterr()
    PETSc.garbage_view(comm)
    comm.barrier()
    text = capfd.readouterr().out
    kept.destroy()
    assert comm.rank or "Vec" not in text and "Total entries" in text, text


RUN = """
import sys
from petsc4py import PETSc
from fretwave.commands.main import main
only = ["--only", sys.argv[3]] if sys.argv[3] else []
code = main(["run", sys.argv[1], "--quick", "--no-plots", "--out", sys.argv[2], *only])
PETSc.garbage_view()
sys.exit(code)
"""


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    "ranks, case, only", [(2, "two_dof", "forced"), (1, "blisk_lumped", ""), (1, "blade_root", "wear")]
)
def test_a_run_leaves_nothing_to_petsc(tmp_path, launch, ranks, case, only):
    """Modes, responses, flutter, wear, on sectors and wheels."""
    done = launch(ranks, "-c", RUN, str(CASES / case / "case.toml"), str(tmp_path / "out"), only, timeout=200)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Total entries: 0") == ranks, done.stdout[-2000:]


ALONE = """
import sys
from mpi4py import MPI
from petsc4py import PETSc
from fretwave.mpi.destroyable import Owned

class Meets:
    def destroy(self):
        MPI.COMM_WORLD.barrier()

with Owned() as own:
    own(Meets())
    if MPI.COMM_WORLD.rank == 0:
        raise MemoryError("of one rank alone")
    MPI.COMM_WORLD.recv(source=0)
"""


@pytest.mark.ranks(1)
def test_an_exception_of_one_rank_does_not_wait_for_the_others(launch):
    """What is freed is freed together: a rank that waits there would keep its reason from the others."""
    done = launch(2, "-c", "from fretwave.mpi.guard import install\ninstall()" + ALONE, timeout=30)
    assert done.returncode != 0 and "not enough memory" in done.stderr, done.stderr
