"""Tasks on groups of ranks: each done once, in order, on all ranks, kept on disk, and failures kept apart."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from tolerances import ROUNDING

from fretwave.errors import InputError, NotConverged
from fretwave.mpi import groups

pytestmark = pytest.mark.ranks(1, 2, 3)


def solved(task: float, group: MPI.Comm) -> dict[str, object]:
    """x of task * x = (0, 1, ..., 5), distributed over the group."""
    A = PETSc.Mat().createAIJ((6, 6), nnz=1, comm=group)
    b = A.createVecs("left")
    for row in range(*A.getOwnershipRange()):
        A[row, row], b[row] = task, row
    A.assemble()
    b.assemble()
    solver, x = PETSc.KSP().create(group), A.createVecs("right")
    solver.setOperators(A)
    solver.solve(b, x)
    found = np.concatenate(group.allgather(x.getArray().copy()))
    for thing in (solver, A, b, x):
        thing.destroy()
    return {"x": found, "ranks": group.size, "word": f"{task:g}"}


@pytest.mark.parametrize("n_tasks", [0, 1, 2, 3, 7])
def test_results_are_those_of_one_rank_in_order_and_on_every_rank(comm, n_tasks):
    tasks = [1.0 + number for number in range(n_tasks)]
    found = groups.run(comm, tasks, solved)
    assert [result["word"] for result in found] == [f"{task:g}" for task in tasks]
    for task, result in zip(tasks, found):
        assert result["x"] == pytest.approx(np.arange(6) / task, rel=ROUNDING)


def test_every_task_is_done_once_and_every_rank_works(comm):
    done = []

    def work(task, group):
        done.append(task)
        if task < comm.size:
            comm.barrier()  # passed only when every rank has one of these tasks

    groups.run(comm, list(range(9)), work)
    assert sorted(task for rank in comm.allgather(done) for task in rank) == list(range(9))


@pytest.mark.parametrize(("n_tasks", "asked"), [(1, None), (2, None), (5, None), (5, 1), (5, 2)])
def test_groups_share_all_ranks(comm, n_tasks, asked):
    asked = None if asked is None else min(asked, comm.size)
    count = min(comm.size, n_tasks, asked or comm.size)

    def work(task, group):
        if task < count:
            comm.barrier()  # every group has one of these tasks
        return group.size

    found = groups.run(comm, list(range(n_tasks)), work, asked)
    assert sum(found[:count]) == comm.size
    assert max(found) - min(found) <= 1


@pytest.mark.ranks(2, 3)
def test_a_long_task_holds_up_no_other_group(comm):
    """The group of rank 0, which keeps the counter, is busy in no MPI call; the others do the rest."""
    mine = []

    def work(task, group):
        mine.append(task)
        time.sleep(1.5 if comm.rank == 0 else 0.01)

    groups.run(comm, list(range(12)), work)
    counts = comm.allgather(len(mine))
    assert counts[0] == 1
    assert sum(counts) == 12


def test_kept_results_are_not_computed_again(comm, shared_tmp: Path):
    kept, calls = groups.Kept(shared_tmp / "kept", "a digest"), []

    def work(task, group):
        calls.append(task)
        if task == 3.0 and len(tasks) == 4:
            raise NotConverged("no solution")
        return solved(task, group)

    tasks = [1.0, 2.0, 3.0, 4.0]
    first = groups.run(comm, tasks, work, kept=kept)
    assert isinstance(first[2], NotConverged)
    calls.clear()
    tasks = [*tasks, 5.0]
    second = groups.run(comm, tasks, work, kept=kept)
    assert {task for rank in comm.allgather(calls) for task in rank} == {3.0, 5.0}
    for number in (0, 1, 3):
        assert np.array_equal(first[number]["x"], second[number]["x"])
        assert first[number]["word"] == second[number]["word"]
    calls.clear()
    groups.run(comm, tasks, work, kept=groups.Kept(shared_tmp / "kept", "another"))
    assert {task for rank in comm.allgather(calls) for task in rank} == set(tasks)


def test_damaged_file_is_computed_again(comm, shared_tmp: Path):
    kept = groups.Kept(shared_tmp / "kept")
    groups.run(comm, [1.0], solved, kept=kept)
    if comm.rank == 0:
        (shared_tmp / "kept" / "task_0000.npz").write_bytes(b"PK")
    comm.barrier()
    assert groups.run(comm, [1.0], solved, kept=kept)[0]["word"] == "1"


def test_errors_of_a_task_are_kept_apart(comm):
    def work(task, group):
        group.barrier()
        if task % 2:
            raise NotConverged("no solution", measured=task)
        return task

    found = groups.run(comm, list(range(5)), work)
    assert [result if isinstance(result, int) else result.measured for result in found] == list(range(5))
    assert all(isinstance(result, NotConverged) == number % 2 for number, result in enumerate(found))


def test_more_groups_than_ranks_are_refused(comm):
    for asked in (0, comm.size + 1):
        with pytest.raises(InputError, match="groups"):
            groups.run(comm, [1, 2], lambda task, group: task, asked)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("kind", ["NotConverged", "ValueError"])
def test_error_of_one_rank_of_a_group_ends_all(launch, kind):
    """It would leave the group's other rank waiting for ever."""
    program = f"""
import sys
from mpi4py import MPI
from fretwave.mpi import groups
from fretwave.errors import NotConverged
from fretwave.mpi.guard import guarded
def work(task, group):
    if task == 1 and group.rank == 1:
        raise {kind}("boom")
    group.barrier()
def main():
    groups.run(MPI.COMM_WORLD, [0, 1, 2], work, 2)
    return 0
sys.exit(guarded(main))
"""
    done = launch(4, "-c", program, timeout=30)
    assert done.returncode == (3 if kind == "NotConverged" else 1)
    assert "boom" in done.stderr


def test_what_the_first_rank_writes_late_is_seen_by_all(shared_tmp: Path, comm: MPI.Comm) -> None:
    """Ranks that look for a file before it is there would take one disk for several, and march one after the other."""
    file = shared_tmp / "late"
    if comm.rank == 0:
        time.sleep(0.3)
        file.write_text("there")
    assert groups.seen_by_all(comm, file)
    assert groups.seen_by_all(comm, shared_tmp / "nowhere")
