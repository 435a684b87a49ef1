"""Solid elements of Ansys as those of a deck: SOLID185, 186, 187 and their forerunners.

Node orders (Ansys, Element Reference) are those of C3D8, C3D20 and C3D10; a brick of which corners fall together is a
wedge or a tetrahedron. Other elements (MESH200, contact, surface effect, shells) are left out.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from ..arrays import IntArray
from ..errors import InputError
from .cells import SOLIDS, Block

#: Numbers of the element types.
KINDS = {45: 8, 185: 8, 95: 8, 186: 8, 92: 4, 187: 4, 285: 4}  # corners
#: What stands in a row of the reader's table before the nodes, and where in it the element's number.
HEAD, NUMBER = 10, 8
#: A brick's corners and middle nodes that wedges and tetrahedra have, in the order of C3D15 and C3D10.
WEDGE = ((0, 1, 2, 4, 5, 6), (8, 9, 11, 12, 13, 15, 16, 17, 18))
TETRAHEDRON = ((0, 1, 2, 4), (8, 9, 11, 16, 17, 18))


def blocks_of(rows: Sequence[IntArray], types: IntArray, where: str) -> dict[str, Block]:
    """Solid elements by kind.

    Parameters
    ----------
    rows : list of (10 + m,)
        Of the EBLOCK: its ten fields, of which the ninth is the element's number, and the nodes.
    types : (n_elements,)
        Numbers of the element types.
    where : str
        The file, as a user would name it.

    Raises
    ------
    InputError
        An element is a pyramid, or some of its middle nodes are missing.
    """
    tables: dict[tuple[int, int], list[IntArray]] = defaultdict(list)
    for row, kind in zip(rows, types.tolist()):
        if kind in KINDS:
            tables[KINDS[kind], len(row)].append(row)
    shapes: dict[int, list[IntArray]] = defaultdict(list)
    for (corners, _), table in tables.items():
        for shape in _shapes(np.vstack(table).astype(np.int64), corners, where):
            shapes[shape.shape[1] - 1].append(shape)
    joined = {SOLIDS[count]: np.vstack(parts) for count, parts in shapes.items()}
    return {kind: Block(table[:, 0], table[:, 1:]) for kind, table in joined.items()}


def _shapes(table: IntArray, corners: int, where: str) -> Iterator[IntArray]:
    """Tables (n, 1 + m) of element numbers and nodes, each of one shape; middle nodes are all there or none."""
    numbers, nodes = table[:, NUMBER], table[:, HEAD:]
    middle = nodes[:, corners:] > 0
    quadratic = middle.any(axis=1)
    odd = quadratic & ~middle.all(axis=1)
    if odd.any():
        raise _unknown(numbers[odd], "some of its middle nodes, not all", where)
    for chosen, width in ((~quadratic, corners), (quadratic, nodes.shape[1])):
        if chosen.any():
            yield from _by_corners(np.column_stack([numbers, nodes[:, :width]])[chosen], corners, where)


def _by_corners(table: IntArray, corners: int, where: str) -> Iterator[IntArray]:
    """Bricks, and those whose corners fall together as wedges and tetrahedra."""
    if corners != 8:
        yield table
        return
    same = table[:, [3, 5, 6, 7]] == table[:, [4, 6, 7, 8]]  # K = L, M = N, N = O, O = P
    shapes = {WEDGE: (same == [True, False, False, True]).all(axis=1), TETRAHEDRON: same.all(axis=1)}
    brick = ~same.any(axis=1)
    odd = ~np.any([brick, *shapes.values()], axis=0)
    if odd.any():
        raise _unknown(table[odd, 0], "the shape of a pyramid", where)
    if brick.any():
        yield table[brick]
    for (ends, between), chosen in shapes.items():
        places = [0] + [1 + place for place in ends + (between if table.shape[1] == 21 else ())]
        if chosen.any():
            yield table[chosen][:, places]


def _unknown(numbers: IntArray, what: str, where: str) -> InputError:
    measured = f"element {numbers[0]} has {what}; {len(numbers)} such"
    expected = "bricks, wedges and tetrahedra, with all middle nodes or none"
    fix = "mesh without such elements, or give the nodes as CSV or .npz"
    return InputError("an element is of no known shape", where, measured, expected, fix)
