"""Contact pairs of a CSV: nodes, normal and area of each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, IntArray
from ..errors import InputError
from ..model.pairs import Pairs
from ..texts import display, number_in
from .nodes import Nodes
from .pairs import FAR, Found, joined, reach_of
from .text import check_heading, doubt_of_end, first_data_line, whole

#: Of a table.
COLUMNS = ("node_a", "node_b", "nx", "ny", "nz", "area")
#: Decimals to which unit normals are compared.
DIGITS = 9


def read_pairs(
    name: str,
    path: Path,
    labels: IntArray,
    nodes: Nodes | None = None,
    tangent: Array | None = None,
    tolerance: float | None = None,
) -> Pairs:
    """A CSV of ``node_a, node_b, nx, ny, nz, area``; node_b empty or 0 is ground, the area may be left out.

    Parameters
    ----------
    name, labels, tangent
        As `match`, the default tangent being the axis most across all normals.
    tolerance
        As `match`: nodes of a pair may be a thousand of it apart, for what a CSV pairs need not coincide.

    Raises
    ------
    InputError
        A line is no pair, or its nodes are far apart.
    """
    where = display(path)
    if not path.is_file():
        raise InputError("the file of pairs does not exist", where, fix="check the path; two names are two node sets")
    doubt_of_end(path)  # a last number that was cut is refused
    table, areas = _read_table(path, where)
    both = whole(table[:, :2], where)
    _check_table(table, where)
    if nodes is not None:
        _check_apart(both, nodes, where, reach_of(nodes, tolerance))
    second = both[:, 1]
    weights = sp.diags((second != 0).astype(float)).tocsr()
    return joined(name, Found(both, second, weights), table[:, 2:5], areas, where, labels, nodes, tangent)


def _read_table(path: Path, where: str) -> tuple[Array, Array | None]:
    """Numbers (n, 6) of all pairs, and their areas (n,) if they are given, else zeros stand for them."""
    rows, widths = [], set[int]()
    for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1):
        if not first_data_line(line.encode()):
            continue  # blank or comment
        place = f"{where}:{number}"
        if line.lower().lstrip('" ').startswith("node"):
            check_heading(line, COLUMNS, place)
            continue
        rows.append(_numbers(line, place))
        widths.add(len(rows[-1]))
    if len(widths) > 1:
        measured, fix = "some pairs have an area, some have none", "give the area of every pair, or of none"
        raise InputError("the table of pairs is uneven", where, measured, "lines of one length", fix)
    if widths == {len(COLUMNS)}:
        table = np.array(rows)
        return table, table[:, -1]
    return np.column_stack([np.array(rows).reshape(-1, 5), np.zeros(len(rows))]), None


def _numbers(line: str, place: str) -> list[float]:
    """Of a pair: all of `COLUMNS`, or without the area."""
    words = [word.strip() for word in line.split(",")]
    if len(words) == len(COLUMNS) and not words[-1]:
        words.pop()  # left out
    try:
        found = [number_in(word or "0") for word in words]
    except ValueError:
        found = []
    if not words[0] or len(found) not in (5, 6) or not np.isfinite(found).all():
        raise InputError("this is no pair", place, line, ", ".join(COLUMNS), "correct the line")
    return found


def _check_table(table: Array, where: str) -> None:
    """Each pair (n, 6) stands once, is of two nodes, and has no area below zero."""
    repeated = np.ones(len(table), dtype=bool)
    repeated[np.unique(_oriented(table), axis=0, return_index=True)[1]] = False
    for wrong, what, expected in (
        (repeated, "a pair stands twice", "each pair once"),
        (table[:, 0] == table[:, 1], "a pair is of one node with itself", "two nodes, or 0 for ground"),
        (table[:, 5] < 0, "a pair has an area below zero", "zero or more"),
    ):
        if wrong.any():
            measured = f"pair {np.argmax(wrong) + 1} ({', '.join(f'{x:g}' for x in table[np.argmax(wrong)])})"
            raise InputError(what, where, f"{measured}, {wrong.sum()} such", expected, "correct the table")


def _oriented(table: Array) -> Array:
    """Nodes and unit normals (n, 5), the same of a pair that is written the other way round."""
    both, normals = table[:, :2], table[:, 2:5]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    turned = np.where(both[:, :1] > both[:, 1:], -1.0, 1.0)
    normals = turned * normals / np.where(length == 0, 1.0, length)
    return np.column_stack([np.sort(both, axis=1), normals.round(DIGITS) + 0.0])  # no -0.0


def _check_apart(both: IntArray, nodes: Nodes, where: str, reach: float) -> None:
    """No pair of nodes is a thousand tolerances apart."""
    rows = np.flatnonzero(both[:, 1])
    xa, xb = (nodes.coordinates[nodes.places(both[rows, k])] for k in (0, 1))
    apart = np.linalg.norm(xa - xb, axis=1)
    if (apart > FAR * reach).any():
        worst = int(np.argmax(apart))
        a, b = both[rows[worst]]
        measured = f"nodes {a} and {b} are {apart[worst]:.3g} apart; {int((apart > FAR * reach).sum())} such"
        expected = f"at most {FAR * reach:.3g}, which is {FAR:g} tolerances of {reach:.3g}"
        tolerance = f"--tolerance {1.1 * apart[worst] / FAR:.2g}"
        fix = f"check the node numbers, or, where they are meant, give {tolerance} (a pair may be {FAR:g} of it apart)"
        raise InputError("nodes of a pair are far apart", where, measured, expected, fix)
