"""A branch for every value of a parameter, or for all combinations of several."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..errors import FretwaveError, InputError
from ..kinds import of_their_kinds
from ..mpi import groups
from .branch import Branch

if TYPE_CHECKING:
    from mpi4py import MPI


class Sweep:
    """Branches over a grid of values, as `fretwave.sweep` returns them.

    Attributes
    ----------
    over : dict
        The values of each parameter, in the order of the grid's dimensions.
    branches : list of Branch or FretwaveError
        The last parameter runs fastest. A value whose branch could not be made has the error in its place.
    """

    def __init__(self, over: dict[str, list[Any]], branches: Sequence[Branch | FretwaveError]) -> None:
        self.over, self.branches = over, list(branches)

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of values."""
        return tuple(len(values) for values in self.over.values())

    def __len__(self) -> int:
        return len(self.branches)

    def __getitem__(self, number: int) -> Branch:
        """A branch by its number in the grid.

        Raises
        ------
        FretwaveError
            The one in which it ended.
        """
        found = self.branches[number]
        if isinstance(found, FretwaveError):
            raise found
        return found

    def __iter__(self) -> Iterator[tuple[dict[str, Any], Branch]]:
        """Values by parameter and the branch, in the order of the grid."""
        for number, values in enumerate(product(*self.over.values())):
            yield dict(zip(self.over, values)), self[number]

    def each(self, number: Callable[[Branch], float]) -> Array:
        """A number of every branch, in the shape of the grid; nan where there is no branch."""
        found = [np.nan if isinstance(one, FretwaveError) else float(number(one)) for one in self.branches]
        return np.array(found).reshape(self.shape)

    def __repr__(self) -> str:
        over = ", ".join(f"{name} {values[0]} to {values[-1]} ({len(values)})" for name, values in self.over.items())
        lost = sum(isinstance(one, FretwaveError) for one in self.branches)
        return f"Sweep({len(self)} branches over {over}{f', {lost} failed' if lost else ''})"


@of_their_kinds
def sweep(work: Callable[..., Branch], *, comm: MPI.Intracomm | None = None, **over: Sequence[Any]) -> Sweep:
    """Follow a branch for every value of a parameter, or for all combinations of several. Collective.

    Parameters
    ----------
    work : callable
        Makes the branch of some values, given by name; with `comm` also `comm`, on which its model lives.
    comm : MPI communicator, optional
        Its ranks share the branches in groups; without it each is followed by all ranks, one after the other.
    **over
        Values by parameter, one at least of each.

    Returns
    -------
    Sweep
        On every rank. The branches are without their unknowns where groups have followed them.

    Raises
    ------
    InputError
        A parameter has no values, or there is none.

    Examples
    --------
    The largest damping of a sliding mass does not ask how large its limit is:

    >>> import fretwave as fw
    >>> def mode(limit):
    ...     slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 5.0, "friction_limit": limit})
    ...     model = fw.Model([[1.0]], [[40.0]], contacts=[slider])
    ...     problem = fw.NonlinearMode(model, fw.choose_harmonics(model, 1))
    ...     return fw.follow(problem, 0.1 * limit, 2.0 * limit)
    >>> fw.sweep(mode, limit=[1.0, 3.0]).each(lambda branch: branch["zeta"].max()).round(4)
    array([0.0187, 0.0187])
    """
    grid = {name: list(values) for name, values in over.items()}
    if not grid or not all(grid.values()):
        raise InputError("a sweep has nothing to go through", None, grid, "values of one parameter", "limit=[1.0, 2.0]")
    tasks = [dict(zip(grid, values)) for values in product(*grid.values())]
    if comm is None:
        return Sweep(grid, [_attempt(work, task) for task in tasks])
    return Sweep(grid, groups.run(comm, tasks, lambda task, group: work(**task, comm=group)))


def _attempt(work: Callable[..., Branch], task: dict[str, Any]) -> Branch | FretwaveError:
    try:
        return work(**task)
    except FretwaveError as error:
        return error
