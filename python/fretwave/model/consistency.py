"""Whether the parts of a structure fit each other: sizes, numbers of dofs and nodes, entries that are numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..given import masked, whole
from ..texts import nearest, shortened
from ..units import SYSTEMS
from .cells import wrong_cells
from .pairs import Pairs
from .sectors import is_by_sector

if TYPE_CHECKING:
    from .structure import Structure


def no_such_dof(name: str, known: Sequence[str]) -> InputError:
    """Of a name that is none of a structure's dofs."""
    fix = nearest(name, known) or "`dof_names` lists them"
    return InputError("there is no dof of this name", None, repr(name), shortened(", ".join(known), 60), fix)


def complaint_of(structure: Structure) -> str | None:
    """What is inconsistent in a structure as a builder gives it, None when nothing is."""
    unnamed = _unnamed(structure)
    if unnamed:
        return unnamed
    terms = {"M": structure.M, "K": structure.K, "C": structure.C}
    if not structure.sectors:  # pairs of a sector may reach the next one
        terms.update({f"B of '{name}'": pairs.B for name, pairs in structure.pairs.items()})
    for name, term in terms.items():
        if is_by_sector(term):
            return f"{name} has parts on other sectors: give the sector with both its faces, low and high"
    if structure.units is not None and structure.units not in SYSTEMS:
        return f"its unit system '{structure.units}' is none of {', '.join(SYSTEMS)}"
    n = structure.n_dof
    if n == 0:
        return "M has no dofs"
    sizes = {"M": structure.M, "K": structure.K, **({} if structure.C is None else {"C": structure.C})}
    sizes.update({f"part '{name}' of K": part for name, part in structure.parts.items()})
    for name, matrix in sizes.items():
        if np.shape(matrix) != (n, n):
            return f"{name} is {np.shape(matrix)[0]} x {np.shape(matrix)[1]}, M is {n} x {n}"
    for name, number in structure.dofs.items():
        if whole(number) is None:
            return f"dof '{name}' has the number {number!r}, which is not whole"
        if not 0 <= number < n:
            return f"dof '{name}' has the number {number} of {n}"
    if structure.names is not None and (len(structure.names), len(set(structure.names))) != (n, n):
        return f"{len(structure.names)} names, {len(set(structure.names))} of them different, of {n} dofs"
    for name, load in structure.loads.items():
        if np.shape(load) != (n,):
            return f"load '{name}' has the shape {np.shape(load)}, not ({n},)"
        if masked(load):
            return f"load '{name}' has masked entries"
        if np.asarray(load).dtype.kind not in "biuf" or not np.all(np.isfinite(load)):
            return f"load '{name}' has an entry that is not a number"
    return _wrong_grid(structure) or next(
        (text for text in (pairs.complaint(name, n) for name, pairs in structure.pairs.items()) if text), None
    )


def _unnamed(structure: Structure) -> str | None:
    """What is no dict, or no pairs."""
    for name in ("dofs", "pairs", "loads", "parts"):
        if not isinstance(getattr(structure, name), Mapping):
            return f"{name} are a {type(getattr(structure, name)).__name__}, not a dict by name"
    others = [name for name, pairs in structure.pairs.items() if not isinstance(pairs, Pairs)]
    return f"pairs '{others[0]}' are no fretwave.Pairs" if others else None


def _wrong_grid(structure: Structure) -> str | None:
    """What does not fit in nodes and cells."""
    if structure.coordinates is None:
        return "there are cells, but no coordinates" if structure.cells or structure.hexahedra is not None else None
    if masked(structure.coordinates):
        return "coordinates have masked entries"
    given = structure.displacements
    dofs = structure.n_dof
    if structure.expansion is not None:
        if np.shape(structure.expansion)[1:] != (dofs,):
            return f"expansion has the shape {np.shape(structure.expansion)}, not (n_unreduced, {dofs})"
        dofs = np.shape(structure.expansion)[0]
    n = dofs // 3 if given is None else len(given)
    if np.shape(structure.coordinates) != (n, 3):
        return f"coordinates have the shape {np.shape(structure.coordinates)}, not ({n}, 3)"
    if given is not None and (np.shape(given) != (n, 3) or np.max(given) >= dofs):
        return f"displacements have the shape {np.shape(given)} and the largest dof {np.max(given)}"
    cells = structure.hexahedra
    if cells is None:
        return wrong_cells(structure.cells, n)
    if np.ndim(cells) != 2 or np.shape(cells)[1] not in (8, 20, 27):
        return f"hexahedra have the shape {np.shape(cells)}, not (n_cells, 8, 20 or 27)"
    outside = not 0 <= np.min(cells) <= np.max(cells) < n
    if outside:
        return f"hexahedra have the nodes {np.min(cells)} to {np.max(cells)} of {n}"
    return wrong_cells(structure.cells, n)
