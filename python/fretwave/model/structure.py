"""Matrices, contacts, loads and places of a structure, as a builder or a model file gives them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass
class BuiltContact:
    """Contact pairs of a built model; the case file names their law.

    Attributes
    ----------
    B : (components * n_pairs, n_dof) sparse
        u = B x, rows pair by pair: normal (> 0 closes) and two tangents, or one tangent alone.
    components : int
        Rows of B for each pair.
    parameters : dict
        Law parameters used where the case gives none: numbers or (n_pairs,).
    areas : (n_pairs,), optional
        Area a pair stands for [m^2], for parameters given per area.
    points : (n_pairs, 3), optional
        Places [m].
    frames : (n_pairs, 3, 3), optional
        Rows: directions of normal and tangents in space, for the resultant of the contact forces.
    faces : sequence of str, optional
        Name of the face that each pair lies on: a picture has one panel for each.
    positions : (n_pairs, 2), optional
        Places on the face [m], for pictures.
    """

    B: Any
    components: int = 3
    parameters: Mapping[str, Any] = field(default_factory=dict)
    areas: Optional[Array] = None
    points: Optional[Array] = None
    frames: Optional[Array] = None
    faces: Optional[Sequence[str]] = None
    positions: Optional[Array] = None

    def __repr__(self) -> str:
        return f"BuiltContact({self.n_pairs} pairs of {self.components}, {', '.join(self.parameters)})"

    @property
    def n_pairs(self) -> int:
        """Number of pairs."""
        return int(self.B.shape[0]) // self.components


@dataclass
class BuiltModel:
    """What the function ``build(**options)`` of a builder returns.

    Attributes
    ----------
    M, K, C : (n_dof, n_dof) sparse [kg], [N/m], [N s/m]
        Without contact; C may be None.
    dofs : dict
        Dof numbers by the names that the case file may use (observation dofs); kept by a reduction.
    contacts : dict
        Contacts by the names that ``[[contact]]`` takes up.
    loads : dict
        Static loads (n_dof,) [N] by the names that ``[preload]`` takes up.
    coordinates : (n_nodes, 3), optional
        Nodes [m], for pictures and resultants.
    displacements : (n_nodes, 3), optional
        Dof of each node along x, y and z, -1 where it is held; without it 3 * node + axis.
    expansion : (n_unreduced, n_dof), optional
        Of a model that the builder has reduced: dofs of the nodes from the model's own, with which a picture begins.
        `displacements` then number its rows, and the faces of a sector correspond as they are.
    hexahedra : (n_cells, 8, 20 or 27), optional
        Nodes of the cells in VTK's order, for pictures.
    sectors : int, optional
        The model is one sector of a wheel of this many.
    low, high : (n_face,), optional
        Matching dofs of a sector's two faces (`fretwave.match_faces` finds nodes that match).
    axis : {"x", "y", "z"}, optional
        Dofs of the faces are triples of Cartesian components, and the wheel lies about this axis.
    parts : dict
        Shares of K (n_dof, n_dof) by the names that a mistuning may vary: a sector's K grows by its deviation times
        the share. A blade's own stiffness is what the elements of the blade put into K.
    """

    M: Any
    K: Any
    C: Any = None
    dofs: Mapping[str, int] = field(default_factory=dict)
    contacts: Mapping[str, BuiltContact] = field(default_factory=dict)
    loads: Mapping[str, Array] = field(default_factory=dict)
    coordinates: Optional[Array] = None
    displacements: Optional[npt.NDArray[np.intp]] = None
    expansion: Optional[Any] = None
    hexahedra: Optional[npt.NDArray[np.intp]] = None
    sectors: Optional[int] = None
    low: Optional[npt.NDArray[np.intp]] = None
    high: Optional[npt.NDArray[np.intp]] = None
    axis: Optional[str] = None
    parts: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        wheel = f", one of {self.sectors} sectors" if self.sectors else ""
        return f"BuiltModel({self.M.shape[0]} dofs, contacts {list(self.contacts)}{wheel})"

    def complaint(self) -> str | None:
        """What is inconsistent, None when nothing is."""
        n = self.M.shape[0]
        if n == 0:
            return "M has no dofs"
        sizes = {"M": self.M, "K": self.K, **({} if self.C is None else {"C": self.C})}
        sizes.update({f"part '{name}' of K": part for name, part in self.parts.items()})
        for name, matrix in sizes.items():
            if matrix.shape != (n, n):
                return f"{name} is {matrix.shape[0]} x {matrix.shape[1]}, M is {n} x {n}"
        for name, number in self.dofs.items():
            if not 0 <= number < n:
                return f"dof '{name}' has the number {number} of {n}"
        for name, load in self.loads.items():
            if np.shape(load) != (n,):
                return f"load '{name}' has the shape {np.shape(load)}, not ({n},)"
            if not np.all(np.isfinite(load)):
                return f"load '{name}' has an entry that is not a number"
        return self._wrong_grid() or next(
            (text for text in (_wrong(c, name, n) for name, c in self.contacts.items()) if text), None
        )

    def _wrong_grid(self) -> str | None:
        """What does not fit in nodes and cells."""
        if self.coordinates is None:
            return None if self.hexahedra is None else "there are hexahedra, but no coordinates"
        given = self.displacements
        dofs = self.M.shape[0]
        if self.expansion is not None:
            if np.shape(self.expansion)[1:] != (dofs,):
                return f"expansion has the shape {np.shape(self.expansion)}, not (n_unreduced, {dofs})"
            dofs = np.shape(self.expansion)[0]
        n = dofs // 3 if given is None else len(given)
        if np.shape(self.coordinates) != (n, 3):
            return f"coordinates have the shape {np.shape(self.coordinates)}, not ({n}, 3)"
        if given is not None and (np.shape(given) != (n, 3) or np.max(given) >= dofs):
            return f"displacements have the shape {np.shape(given)} and the largest dof {np.max(given)}"
        cells = self.hexahedra
        if cells is None:
            return None
        if np.ndim(cells) != 2 or np.shape(cells)[1] not in (8, 20, 27):
            return f"hexahedra have the shape {np.shape(cells)}, not (n_cells, 8, 20 or 27)"
        outside = not 0 <= np.min(cells) <= np.max(cells) < n
        return f"hexahedra have the nodes {np.min(cells)} to {np.max(cells)} of {n}" if outside else None


def _wrong(contact: BuiltContact, name: str, n_dof: int) -> str | None:
    rows, columns = contact.B.shape
    if columns != n_dof or rows % contact.components or not rows:
        return f"B of contact '{name}' is {rows} x {columns}, not {contact.components} n_pairs x {n_dof}"
    if not np.all(np.isfinite(contact.B.data)):
        return f"B of contact '{name}' has an entry that is not a number"
    n = contact.n_pairs
    shapes = {"areas": (n,), "points": (n, 3), "frames": (n, 3, 3), "faces": (n,), "positions": (n, 2)}
    given = {key: getattr(contact, key) for key in shapes if getattr(contact, key) is not None}
    for key, value in given.items():
        if np.shape(value) != shapes[key]:
            return f"{key} of contact '{name}' have the shape {np.shape(value)}, not {shapes[key]}"
    for key, value in contact.parameters.items():
        if np.shape(value) not in ((), (n,)):
            return f"parameter {key} of contact '{name}' has the shape {np.shape(value)}, not ({n},)"
        if not np.all(np.isfinite(np.asarray(value, dtype=float))):
            return f"parameter {key} of contact '{name}' is not a number"
    return None
