"""From the coordinates of a run's reduction to all dofs.

By the basis that the run keeps; a basis too large for that is made again from the case, and is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..case.load import Case
from ..errors import InputError
from ..model.sectors import Parts
from ..results.basis_file import NAME, marks_of, read_basis
from ..texts import display
from .choice import Choice
from .geometry import geometry

Expand = Callable[[npt.ArrayLike], Array]

#: Relative difference of a frequency that rounding explains.
SAME = 1e-6


class Expansion(Protocol):
    """What is used of a reduction, made again or kept."""

    @property
    def size(self) -> int: ...

    @property
    def n_interface(self) -> int: ...

    @property
    def highest_component_hz(self) -> float: ...

    @property
    def ties(self) -> Parts: ...

    @property
    def loads(self) -> Mapping[str, Array]: ...

    def expand(self, x_r: npt.ArrayLike, /) -> Array: ...

    def beyond(self, names: Sequence[str]) -> Array: ...


@dataclass(frozen=True)
class MadeAgain:
    """The reduction of a run, from its case, with the model's loads."""

    reduction: Any
    loads: Mapping[str, Array]
    size: int
    n_interface: int
    highest_component_hz: float
    ties: Parts

    def expand(self, x_r: npt.ArrayLike, /) -> Array:
        """Motion of all dofs."""
        return np.asarray(self.reduction.expand(x_r))

    def beyond(self, names: Sequence[str]) -> Array:
        """Static displacement under these loads together that no coordinate has."""
        return np.asarray(self.reduction.beyond(np.sum([self.loads[name] for name in names], axis=0)))


def expansion_of(case: Case, choice: Choice, folder: Path, around: int, stack: ExitStack) -> Expansion:
    """Of the run in a folder; what is made again lives as long as the stack.

    Raises
    ------
    InputError
        The model is not that of the run, or its basis is not kept and there is neither MPI nor PETSc.
    """
    kept = read_basis(folder / NAME)
    if kept is not None:
        _check_model(case, kept.model)
    basis = _made_again(case, choice.component_modes, stack) if kept is None else kept
    _check_same(case, choice, basis, around)
    return basis


def _made_again(case: Case, modes: int | None, stack: ExitStack) -> Expansion:
    """Of a run that does not keep the basis of its reduction, on as many component modes as it has taken."""
    try:
        from mpi4py import MPI

        from ..case.reduce import reduction_of
        from ..cyclic.reduction import SectorReduction
    except ImportError as error:
        raise InputError(
            "the motion of a reduced model cannot be shown here",
            display(case.path),
            f"no {error.name or 'solver'}, and no {NAME} in the folder of the run",
            "mpi4py and PETSc: the reduction is made again to reach the nodes that the run does not keep",
            "view it where the case was run; `fretwave show` and `fretwave plot` need neither",
        ) from None
    reduction = reduction_of(case, MPI.COMM_SELF, modes)
    stack.callback(reduction.destroy)
    hz, loads = reduction.highest_component_hz, (case.structure.cut or case.structure).loads
    if isinstance(reduction, SectorReduction):
        return MadeAgain(reduction, loads, reduction.size, reduction.n_interface, hz, reduction.sector().ties)
    return MadeAgain(reduction, loads, reduction.size, 0, hz, {})


def beyond_basis(basis: Expansion, loads: Sequence[str]) -> tuple[Array, str]:
    """Static displacement that no coordinate has, and a note on what is not known of it: of an older run all."""
    known = [name for name in loads if name in basis.loads]
    left = [name for name in loads if name not in basis.loads]
    note = (
        f"note: the displacement at rest under {', '.join(left)} is that of the component modes alone: an earlier"
        " version made the run; run it again for the exact one"
    )
    return basis.beyond(known) if known else np.zeros(1), note if left else ""


def of_tuned_sector(case: Case, choice: Choice, beyond: Array) -> str:
    """A note on a mistuned wheel: its sectors have what no coordinate has of the static displacement as tuned ones."""
    mistuned = choice.wheel and case.analyses[choice.name].whole_wheel()[1] is not None
    if not mistuned or not np.any(beyond):
        return ""
    return (
        "note: of the displacement at rest, what no component mode has is that of the tuned sector: relative errors of"
        " the size of the sectors' deviations; without [reduction] it is exact"
    )


def without_rest(case: Case, choice: Choice) -> str:
    """A note on a driven wheel about a preload whose state at rest an earlier version did not keep; else nothing."""
    analysis = case.analyses[choice.name]
    preload = case.preload_of(analysis)
    if choice.loaded or not choice.wheel or analysis.type != "forced" or preload is None or not preload.loads:
        return ""
    return (
        f"note: the displacement at rest under {', '.join(preload.loads)} is not kept: an earlier version made the run;"
        " it counts as motion, and lacks what no component mode has; run it again for the exact one"
    )


def _check_model(case: Case, then: Array) -> None:
    """The model is that which was reduced: its motion is the run's own, its nodes are the case's."""
    now = marks_of(geometry(case))
    if not np.allclose(now, then, rtol=SAME, atol=0):
        unit = case.units("force/length")
        found, expected = (f"{m[0]:.0f} dofs, sum of |K| {m[1]:.9g} {unit}" for m in (now, then))
        raise InputError(
            "the model is no longer that of the run",
            display(case.path),
            found,
            f"{expected}, as in the run",
            "run it again",
        )


def _check_same(case: Case, choice: Choice, basis: Expansion, around: int) -> None:
    """The last component mode tells whether this is the run's model: a builder may read what a case cannot tell."""
    size = (basis.size - basis.n_interface) * (around if choice.wheel else 1)
    then, now = choice.highest_component_hz, basis.highest_component_hz
    if size != len(choice.rest) or abs(now - then) > SAME * then:
        found = f"{size} coordinates, highest component mode {now:.9g} Hz"
        expected = f"{len(choice.rest)} coordinates, {then:.9g} Hz, as in the run"
        raise InputError("the model is no longer that of the run", display(case.path), found, expected, "run it again")
