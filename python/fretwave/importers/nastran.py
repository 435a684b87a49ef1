"""Nastran: matrices of OUTPUT4 files (``.op4``) and grid points of a bulk data deck, through the package pyyeti (BSD).

Layout (MSC Nastran, DMAP Programmer's Guide, OUTPUT4; Quick Reference Guide, GRID): named matrices, text or binary of
either byte order, single or double precision, full or sparse. Which rows are which dofs an .op4 file does not say.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..texts import display
from .constraints import Constraints
from .entries import Entries
from .extras import reader_of
from .nastran_deck import flat
from .nodes import Nodes
from .npz import choose

#: What matrices are called: of the analysis set, of an external superelement (EXTSEOUT), of all grid points.
USUAL = {"K": ("KAA", "KXX", "KGG"), "M": ("MAA", "MXX", "MGG"), "C": ("BAA", "BXX", "BGG")}
#: Cards that make dofs depend on others.
JOINS = r"(MPC|RBE[123]|RBAR1?|RROD|RJOINT|RSPLINE|RTRPLT1?|RSSCON),"
GRID = r"GRID,"
#: Cards that tell up to two coordinate systems by the numbers of three grid points each.
BY_POINTS = r"CORD1[RCS],"
#: Names of cards that are read or looked for.
WANTED = re.compile(r"(GRID|GRDSET|SEQGP|CORD[12][RCS]|" + JOINS.removesuffix(",") + r")(?![A-Z0-9])")


def read(path: Path, letter: str, variable: str | None = None) -> Entries:
    """A matrix of an .op4 file; where a name stands several times, its matrices are NAME_1, NAME_2, ..."""
    where = display(path)
    op4 = reader_of("pyyeti.nastran.op4", "pyyeti", where)
    given = op4.dir(str(path), verbose=False)[0]
    names = _numbered([name.upper() for name in given])
    place = names.index(choose(names, letter, variable and variable.upper(), where, USUAL))
    alike = op4.load(str(path), namelist=[given[place]], into="list", sparse=True)[1]
    return Entries.of(alike[given[:place].count(given[place])], where, "Nastran .op4")


def _numbered(names: list[str]) -> list[str]:
    total, seen = Counter(names), Counter[str]()
    found = []
    for name in names:
        seen[name] += 1
        found.append(name if total[name] == 1 else f"{name}_{seen[name]}")
    return found


def read_grid(path: Path) -> Nodes:
    """Grid points of a deck, INCLUDE files too, in basic coordinates and the order of their numbers.

    Raises
    ------
    InputError
        Displacements are in another coordinate system than the basic one, or a coordinate is no number.
    """
    where = display(path)
    bulk = reader_of("pyyeti.nastran.bulk", "pyyeti", where)
    deck = StringIO(flat(path, WANTED))
    grid = bulk.rdcards(deck, GRID, regex=True, return_var="list", no_data_return=[])
    _check_cards(grid, where, "ENDDATA" in deck.getvalue())
    _check_systems(grid, bulk.rdcards(deck, BY_POINTS, regex=True, return_var="list", no_data_return=[]), where)
    _check_order(deck.getvalue(), where)
    _check_turned(grid, bulk.rdcards(deck, "GRDSET") is not None, where)
    table = bulk.bulk2uset(deck)[0]
    places = table[["x", "y", "z"]].to_numpy(dtype=float).reshape(-1, 6, 3)  # behind x, y, z: system, origin, turn
    numbers = table.index.get_level_values(0).to_numpy(dtype=np.int64)[::6]
    cards = bulk.rdcards(deck, JOINS, regex=True, return_var="list", keep_name=True, no_data_return=[])
    joins = Constraints(joins=str(cards[0][0]) if cards else "")
    return Nodes(numbers, places[:, 0], where, constraints=joins)


def _check_cards(cards: Sequence[Sequence[object]], where: str, ends: bool) -> None:
    """Fields that are no numbers would be read as zero; what is blank is (Quick Reference Guide, GRID)."""
    expected = "GRID, number, system, x, y, z"
    for card in cards:
        wrong = [field for field in card[:6] if isinstance(field, str) and field] or card[8:]
        if wrong:
            measured = f"{wrong[0]} in GRID {card[0]}"
            raise InputError(
                "a grid point has a field that is no number", where, measured, expected, "correct the field"
            )
    if cards and len(cards[-1]) < 5 and not ends:
        measured, fix = f"GRID {cards[-1][0]} ends behind {len(cards[-1])} fields, no ENDDATA", "write the deck again"
        raise InputError("the deck is cut within a grid point", where, measured, expected, fix)


def _check_turned(grid: Sequence[Sequence[Any]], defaults: bool, where: str) -> None:
    """Before systems are looked for: CD -1 is none, but says that the point is a fluid's (GRID)."""
    turned = sorted(card[0] for card in grid if len(card) > 5 and card[5])
    fluid = sorted(card[0] for card in grid if len(card) > 5 and card[5] == -1)
    if fluid:
        measured, expected = f"CD -1 of GRID {fluid[0]}, {len(fluid)} such", "points of a structure"
        raise InputError("grid points are of a fluid", where, measured, expected, "give the structure's deck alone")
    if turned or defaults:
        measured = f"CD of GRID {turned[0]}, {len(turned)} such" if turned else "GRDSET"
        fix = "leave CD and GRDSET out and write the matrices again"
        raise InputError("directions of nodes are turned", where, measured, "directions x, y, z at every node", fix)


def _check_order(deck: str, where: str) -> None:
    """Rows of the matrices follow the numbers of the grid points, unless the deck says another order."""
    if "SEQGP," in deck:
        fix = "take SEQGP out and write the matrices again"
        raise InputError("grid points are in an order of their own", where, "SEQGP", "the order of their numbers", fix)


def _check_systems(grid: Sequence[Sequence[object]], cards: Sequence[Sequence[object]], where: str) -> None:
    """A system that grid points define is not read: where another is placed by it, it is nowhere."""
    systems = {number for card in cards for number in (card[0], *card[4:5]) if number}
    for point in grid:
        if len(point) > 1 and point[1] in systems:
            measured = f"GRID {point[0]} is given in system {point[1]}, a CORD1 card"
            expected, fix = "basic coordinates, or a CORD2R, CORD2C or CORD2S card", "write that system as a CORD2 card"
            raise InputError("a coordinate system is defined by grid points", where, measured, expected, fix)
