"""What the files of a view have of every step: the displacement, and numbers of the branch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Union

import numpy as np

from ..arrays import Indices
from .choice import Choice
from .motion import Shape
from .vtkhdf import GridFile

Write = Callable[[int, Shape, Union[slice, Indices]], None]


def motion_field(grid: GridFile, scale: float) -> Write:
    """Writes the true displacement of a part, and the one from rest enlarged for the eye."""
    steps = np.arange(grid.steps)
    true, warp = grid.field("displacement", 3, steps), grid.field("warp", 3, steps, "f4")

    def write(part: int, shape: Shape, chosen: slice | Indices) -> None:
        for step, x in enumerate(shape.displacements(chosen)):
            true(step, part, x)
            warp(step, part, scale * (x - shape.rest[chosen]))

    return write


def motion_alone(grid: GridFile) -> Write:
    """Writes the displacement of a part from rest, in single precision."""
    moved = grid.field("motion", 3, np.arange(grid.steps), "f4")

    def write(part: int, shape: Shape, chosen: slice | Indices) -> None:
        for step, x in enumerate(shape.displacements(chosen)):
            moved(step, part, x - shape.rest[chosen])

    return write


def write_states(grid: GridFile, choice: Choice) -> None:
    """Columns of the branch, and the phase."""
    for name, values in choice.states.items():
        grid.field_data(name, values[choice.point_of_step])
    grid.field_data("phase", np.tile(choice.phases, len(choice.points)))
