"""Contact pairs: where two bodies touch, and the map from dofs to their relative displacement. NumPy alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Optional, Union

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array
from ..errors import InputError
from ..given import masked, whole
from .sectors import Parts, Term, around, by_sector, combine, real_csr

#: A law's parameters: a number, or one per pair.
Values = Mapping[str, Union[float, npt.ArrayLike]]


@dataclass
class Pairs:
    """Contact pairs; a `fretwave.Contact` is pairs with a law.

    Attributes
    ----------
    B : (components * n_pairs, n_dof) sparse or dense, or dict
        u = B x, rows pair by pair: normal (> 0 closes) and two tangents, or one tangent alone. On a sector
        {0: B_0, 1: B_1}: u = B_0 x_j + B_1 x_{j+1} reaches the next sector's dofs.
    components : int
        Rows of B for each pair.
    parameters : dict
        Law parameters used where none is given: numbers or (n_pairs,).
    areas : (n_pairs,), optional
        Area a pair stands for [length^2], for parameters given per area, and for wear.
    points : (n_pairs, 3), optional
        Places [length].
    frames : (n_pairs, 3, 3), optional
        Rows: directions of normal and tangents in space, for the resultant of the contact forces. Of two bodies the
        normal points from the first to the second.
    faces : sequence of str, optional
        Name of the face that each pair lies on: a picture has one panel for each.
    positions : (n_pairs, 2), optional
        Places on the face [length], for pictures.
    nodes : (n_pairs, 2), optional
        First and second node of each pair in the mesh's own numbers, 0 for ground.
    clearance : (n_pairs,), optional
        How far the two sides stand apart in the mesh along the normal [length], below zero they overlap; None where
        they touch. It is no gap of the contact, and an import alone knows it.
    """

    B: Term
    components: int = 3
    parameters: Values = field(default_factory=dict)
    areas: Optional[Array] = None
    points: Optional[Array] = None
    frames: Optional[Array] = None
    faces: Optional[Sequence[str]] = None
    positions: Optional[Array] = None
    nodes: Optional[npt.NDArray[np.int64]] = None
    clearance: Optional[Array] = None

    def __post_init__(self) -> None:
        rows = whole(self.components) or 0
        if rows < 1:
            measured, fix = repr(self.components), "count the rows of B that are of one pair"
            raise InputError(
                "contact pairs have no such number of components", None, measured, "a whole number >= 1", fix
            )
        self.components = rows

    def __repr__(self) -> str:
        return f"Pairs({self.n_pairs} pairs of {self.components}, {', '.join(self.parameters)})"

    @property
    def own(self) -> sp.csr_matrix:
        """B on the dofs of the own sector."""
        return real_csr(by_sector(self.B)[0])

    @property
    def n_pairs(self) -> int:
        """Number of pairs."""
        return int(np.shape(by_sector(self.B)[0])[0]) // self.components

    @property
    def touched(self) -> npt.NDArray[np.intp]:
        """Dofs that B reaches, of any sector."""
        reached = [real_csr(B).indices for B in by_sector(self.B).values()]
        return np.asarray(np.unique(np.concatenate(reached)), dtype=np.intp)

    def tied(self, ties: Parts) -> Pairs:
        """On the dofs of a sector whose high face was tied to the next one (`fretwave.Structure.tied`)."""
        rows = int(np.shape(by_sector(self.B)[0])[0])
        return replace(self, B=combine({0: sp.identity(rows)}, by_sector(self.B), ties, +1))

    def mapped(self, rows: Callable[[sp.csr_matrix], sp.csr_matrix]) -> Pairs:
        """With every part of B on other coordinates."""
        parts = {k: rows(real_csr(B)) for k, B in by_sector(self.B).items()}
        return replace(self, B=parts[0] if list(parts) == [0] else parts)

    def around(self, sectors: int) -> Pairs:
        """Those of all sectors of a wheel, one after the other; their places are those of one sector, and left out."""
        given = {name: repeated(value, sectors) for name, value in self.parameters.items()}
        areas = None if self.areas is None else np.tile(self.areas, sectors)
        return Pairs(around(self.B, sectors), self.components, given, areas)

    def complaint(self, name: str, n_dof: int) -> str | None:
        """What is inconsistent, None when nothing is."""
        for B in map(real_csr, by_sector(self.B).values()):
            rows, columns = B.shape
            if columns != n_dof or rows % self.components or not rows or rows != self.own.shape[0]:
                return f"B of contact '{name}' is {rows} x {columns}, not {self.components} n_pairs x {n_dof}"
            if not np.all(np.isfinite(B.data)):
                return f"B of contact '{name}' has an entry that is not a number"
        n = self.n_pairs
        shapes = {"areas": (n,), "points": (n, 3), "frames": (n, 3, 3), "faces": (n,), "positions": (n, 2)}
        given = {key: getattr(self, key) for key in shapes if getattr(self, key) is not None}
        hidden = [key for key, value in {**given, **self.parameters}.items() if masked(value)]
        if hidden:
            return f"{hidden[0]} of contact '{name}' have masked entries"
        for key, value in given.items():
            if np.shape(value) != shapes[key]:
                return f"{key} of contact '{name}' have the shape {np.shape(value)}, not {shapes[key]}"
        for key, value in self.parameters.items():
            if np.shape(value) not in ((), (n,)):
                return f"parameter {key} of contact '{name}' has the shape {np.shape(value)}, not ({n},)"
            if not np.all(np.isfinite(np.asarray(value, dtype=float))):
                return f"parameter {key} of contact '{name}' is not a number"
        return None


def repeated(value: npt.ArrayLike, sectors: int) -> npt.ArrayLike:
    """A parameter of one sector's pairs for those of all sectors."""
    return np.tile(value, sectors) if np.size(value) > 1 else value
