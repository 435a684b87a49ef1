"""Whether the arrays of a model file fit each other, as they are written and as they are read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..model.cells import wrong_cells
from ..model.sectors import by_sector
from ..model.structure import Structure

#: An array of the file, None where it has none.
Table = Union[npt.NDArray[Any], None]
#: B on the dofs of the own sector and the next one, by their names in the file.
PARTS = {0: "B", 1: "B_next"}
#: Arrays of pairs by their names in the file, and as attributes of `Pairs`.
PAIR_ARRAYS = {"positions": "points", "areas": "areas", "frames": "frames", "nodes": "nodes"}


def check_parts(structure: Structure, tables: Mapping[str, Table], where: str) -> None:
    """The parts fit each other."""
    n, names = structure.n_dof, structure.dof_names

    def wrong(what: str, measured: object, expected: object) -> InputError:
        return InputError(what, where, measured, expected, "write the file again with matching parts")

    for letter in ("M", "K", "C"):
        matrix = getattr(structure, letter)
        if matrix is not None and matrix.shape != (n, n):
            raise wrong(f"{letter} does not fit M", f"{matrix.shape}", f"{(n, n)}")
    if len(names) != n or len(set(names)) != n:
        raise wrong("the names of the dofs do not fit", f"{len(set(names))} different names", f"{n}, one per dof")
    for name, length, expected in _lengths(structure, tables):
        if length != expected:
            raise wrong(f"{name} does not fit", f"{length} values", expected)
    cells, nodes = tables["cells/hexahedra"], _count(tables["nodes/number"])
    if cells is not None and cells.size and not 0 <= cells.min() <= cells.max() < nodes:
        raise wrong("a node of a cell does not exist", f"{cells.min()} to {cells.max()}", f"0 to {nodes - 1}")
    complaint = wrong_cells(structure.cells, nodes)
    if complaint:
        raise wrong("the cells do not fit", complaint, f"nodes 0 to {nodes - 1}")
    _check_sector(structure, wrong)
    kept = tables["dofs/kept"]
    if kept is not None and len(kept) and not 0 <= min(kept) <= max(kept) < n:
        raise wrong("a kept dof does not exist", f"{min(kept)} to {max(kept)}", f"0 to {n - 1}")


def _check_sector(structure: Structure, wrong: Callable[[str, object, object], InputError]) -> None:
    """Two faces of as many dofs each, and a wheel that a sector is of."""
    reach = [name for name, pairs in structure.pairs.items() if 1 in by_sector(pairs.B)]
    if not structure.sectors:
        if reach:
            raise wrong("pairs reach the next sector, and there is none", ", ".join(reach), "a sector of a wheel")
        return
    if structure.low is None or structure.high is None:
        raise wrong("a sector has no faces", None, "low and high")
    for name, face in (("low", structure.low), ("high", structure.high)):
        if (
            len(face) != len(structure.low)
            or not 0 <= np.min(face, initial=0) <= np.max(face, initial=0) < structure.n_dof
        ):
            measured = f"{len(face)} dofs, {np.min(face, initial=0)} to {np.max(face, initial=0)}"
            raise wrong(
                f"the {name} face does not fit", measured, f"{len(structure.low)} of 0 to {structure.n_dof - 1}"
            )
    if structure.axis not in (None, "x", "y", "z"):
        raise wrong("there is no such axis", structure.axis, "x, y, z or none")


def _lengths(structure: Structure, tables: Mapping[str, Table]) -> list[tuple[str, int, int]]:
    """Every array with the length it has and the one it must have."""
    n, nodes = structure.n_dof, _count(tables["nodes/number"])
    expected = {"dofs/node": n, "dofs/direction": n, "nodes/coordinates": nodes}
    table = [(name, len(values), expected[name]) for name in expected if (values := tables[name]) is not None]
    for name, pairs in structure.pairs.items():
        place = f"contacts/{name}"
        for k, B in by_sector(pairs.B).items():
            rows, columns = np.shape(B)
            part = f"{place}/{PARTS[k]}"
            table += [(part, columns, n), (part, rows, pairs.components * pairs.n_pairs)]
        arrays = {key: getattr(pairs, own) for key, own in PAIR_ARRAYS.items()}
        table += [(f"{place}/{key}", len(v), pairs.n_pairs) for key, v in arrays.items() if v is not None]
    return table


def _count(values: Table) -> int:
    return 0 if values is None else len(values)
