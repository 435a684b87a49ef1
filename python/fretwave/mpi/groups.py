"""Independent tasks on groups of ranks: every rank has work, no answer depends on how many there are.

::

    results = groups.run(comm, amplitudes, lambda amplitude, group: line(amplitude, group), kept=Kept(folder, digest))

A group takes the next task when it has finished its last one, so that long and short tasks mix well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union, cast
from zipfile import BadZipFile

import numpy as np

from ..errors import FretwaveError, InputError
from ..files.whole import replaced, told
from .guard import all_ranks_failed, on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI


Task = TypeVar("Task")


@dataclass(frozen=True)
class Kept:
    """Results on disk, a file for each task: ``task_0003.npz``, there as a whole or not at all.

    Results are mappings of names to arrays, numbers and texts.

    Attributes
    ----------
    folder : Path
        Made when the first result is there.
    digest : str
        Of everything else that decides the results; files with another one are not read.
    """

    folder: Path
    digest: str = ""

    def load(self, number: int) -> dict[str, Any] | None:
        """The result of a task, None when it is not there."""
        with suppress(OSError, ValueError, KeyError, BadZipFile), np.load(self.file(number)) as archive:
            values = {name: archive[name] for name in archive.files}
            if str(values.pop("_digest")) == self.digest:
                return {name: value if value.ndim else value.item() for name, value in values.items()}
        return None

    def save(self, number: int, result: Mapping[str, Any]) -> None:
        """Keep the result of a task. One rank only."""
        with told(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        with replaced(self.file(number), keep_suffix=True) as fresh:
            np.savez(fresh, _digest=self.digest, **result)

    def file(self, number: int) -> Path:
        """Where the result of a task is."""
        return self.folder / f"task_{number:04d}.npz"


def run(
    comm: MPI.Comm,
    tasks: Sequence[Task],
    work: Callable[[Task, MPI.Comm], Any],
    n_groups: int | None = None,
    kept: Kept | None = None,
) -> list[Any]:
    """Do all tasks, several at a time. Collective.

    Parameters
    ----------
    comm : MPI communicator
    tasks : sequence
        The same on every rank; each is done once.
    work : callable
        ``work(task, group)``, called on every rank of a group with the group's communicator. What it returns there
        on the first rank is the result; all results go to every rank, so large data belongs into files.
    n_groups : int, optional
        Groups of ranks, of equal sizes or one rank apart; default as many as there are ranks and tasks.
    kept : Kept, optional
        Results that are there already are not computed again, new ones are kept at once.

    Returns
    -------
    list
        The results in the order of the tasks. A task that ended in a FretwaveError on all ranks of its group has the
        error in place of a result, and the others go on.

    Raises
    ------
    InputError
        There are fewer ranks than groups asked for.
    """
    done = on_first_rank(comm, lambda: _loaded(kept, len(tasks)))
    waiting = [number for number in range(len(tasks)) if number not in done]
    count = group_count(comm.size, len(waiting), n_groups)
    group = comm.Split(comm.rank * count // comm.size, comm.rank) if count > 1 else comm
    queue = _Queue(comm if count > 1 else None)
    mine: dict[int, Any] = {}
    while (place := group.bcast(queue.take() if group.rank == 0 else None)) < len(waiting):
        number = waiting[place]
        mine[number] = _attempt(work, tasks[number], group)
        if kept is not None and group.rank == 0 and not isinstance(mine[number], FretwaveError):
            kept.save(number, mine[number])
    for found in comm.allgather(mine if group.rank == 0 else {}):
        done.update(found)
    queue.free()
    if group is not comm:
        group.Free()
    return [done[number] for number in range(len(tasks))]


def group_count(ranks: int, tasks: int, asked: int | None = None) -> int:
    """How many groups the ranks form.

    Raises
    ------
    InputError
        There are fewer ranks than groups asked for.
    """
    if asked is not None and not 1 <= asked <= ranks:
        fix = f"mpirun -n {asked}, or fewer groups" if asked > 0 else "at least 1"
        raise InputError("there cannot be so many groups of ranks", "--groups", asked, f"1 to {ranks}, the ranks", fix)
    return max(1, min(ranks if asked is None else asked, tasks))


def seen_by_all(comm: MPI.Comm, path: Path) -> bool:
    """Whether every rank sees what the first one has at a path, of the same size and age. Collective.

    Where not, groups that read there or write beside it would work on other files: there is to be one group then, of
    which the first rank alone does so.
    """
    first = comm.bcast(_size_and_age(path) if comm.rank == 0 else None)  # the others look when it has written
    return all(comm.allgather(_size_and_age(path) == first))


def _size_and_age(path: Path) -> tuple[int, int] | None:
    with suppress(OSError):
        found = path.stat()
        return found.st_size, found.st_mtime_ns
    return None


def _loaded(kept: Kept | None, count: int) -> dict[int, Any]:
    found = {number: kept.load(number) for number in range(count)} if kept is not None else {}
    return {number: result for number, result in found.items() if result is not None}


def _attempt(work: Callable[[Task, MPI.Comm], Any], task: Task, group: MPI.Comm) -> Union[Any, FretwaveError]:
    """The result of a task, or the error that it ended in on every rank; an error of some ranks alone is raised."""
    try:
        return work(task, group)
    except FretwaveError as error:
        if group.size > 1 and not all_ranks_failed(group):
            raise
        return error


class _Queue:
    """Gives 0, 1, 2, ..., each number to one caller: a counter in the memory of rank 0, who need not attend to it.

    Parameters
    ----------
    comm : MPI communicator or None
        None for a queue with one caller. Collective.
    """

    def __init__(self, comm: MPI.Comm | None) -> None:
        self._window: Any = None
        self._next = -1
        if comm is None:
            return
        from mpi4py import MPI

        self._window = MPI.Win.Allocate(8 * (comm.rank == 0), 8, comm=cast("MPI.Intracomm", comm))
        if comm.rank == 0:
            self._window.Lock(0)
            np.frombuffer(self._window.tomemory(), "i8")[:] = 0
            self._window.Unlock(0)
        comm.barrier()

    def take(self) -> int:
        """The next number."""
        if self._window is None:
            self._next += 1
            return self._next
        from mpi4py import MPI

        one, number = np.ones(1, "i8"), np.zeros(1, "i8")
        self._window.Lock(0)
        self._window.Fetch_and_op(one, number, 0, 0, MPI.SUM)
        self._window.Unlock(0)
        return int(number[0])

    def free(self) -> None:
        """Collective."""
        if self._window is not None:
            self._window.Free()
