"""Cards of a Nastran deck in every form of fields are read as they are meant, or refused in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fretwave.errors import InputError
from fretwave.importers import nastran

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("pyyeti.nastran.bulk", reason="pyyeti is not installed")

LONG = "GRID*                  1                             4.0             5.0"
#: GRID 1 at (4, 5, 6).
FORMS = {
    "comment between lines": LONG + "\n$ next\n*       6.0",
    "blank line between lines": LONG + "\n\n*       6.0",
    "long, then a short line": LONG + "\n+       6.0",
    "long, then no mark": LONG + "\n        6.0",
    "long and free": "GRID*,1,,4.0,5.0\n*,6.0",
    "long and free with marks": "GRID*,1,,4.0,5.0,*A\n*A,6.0",
    "long, short and free": "GRID*,1,,4.0,5.0\n,6.0",
    "long with marks": LONG + "*A7\n*A7     6.0",
    "free behind blanks": "  grid, 1,, 4.0 , 5., 6",
    "fixed behind a blank": " GRID   1               4.0     5.0     6.0",
    "tabs": "GRID\t1\t\t4.0\t5.0\t6.0",
    "comment with a comma": "GRID    1               4.0     5.0     6.0 $ a, b",
    "numbers without a letter": "GRID,1,0,.4+1,500.-2,6.D+0",
    "another card's name begins so": "GRIDB,9,,,1.0,2.0\nGRID,1,,4.,5.,6.",
    "latin letters in comments": "$ Gr\xf6\xdfe\nGRID,1,,4.,5.,6.",
    "a point behind the end": "GRID,1,,4.,5.,6.\nENDDATA\nGRID,9,,1.,1.,1.",
    "no quotes": "INCLUDE one.bdf",
    "double quotes, behind blanks": '  include "one.bdf"',
    "quotes over two lines": "INCLUDE 'one.\n         bdf'",
    "a dollar in quotes": "INCLUDE 'o$e.bdf' $ one",
    "a dollar without quotes": "INCLUDE one.bdf$ one",
    "marks of another card used again": "GRID,1,,4.,5.,6.,,,+A\nPLOTEL,1,1,2,,,,,+B\n+B,3",
}


def read(folder: Path, cards: str, head: str = "SOL 103\nCEND\nMPC = 3\nBEGIN BULK\n") -> nastran.Nodes:
    for name in ("one.bdf", "o$e.bdf"):
        (folder / name).write_text("GRID,1,,4.,5.,6.\n")
    path = folder / "model.bdf"
    path.write_bytes(f"{head}{cards}\nGRID,2,,1.,2.,3.\nENDDATA\n".encode("latin1"))
    return nastran.read_grid(path)


@pytest.mark.parametrize("cards", FORMS.values(), ids=FORMS)
def test_a_point_in_any_form(tmp_path: Path, cards: str) -> None:
    nodes = read(tmp_path, cards)
    np.testing.assert_array_equal(nodes.coordinates[nodes.numbers == 1], [[4, 5, 6]])
    assert set(nodes.numbers.tolist()) <= {1, 2}


#: Cards that are refused, and what is said.
REFUSED = {
    "replicated": ("GRID,1,,4.,5.,6.\n=,*1,=,*1.,=,=", "copy of another"),
    "number in the name": ("GRID   1                4.0     5.0     6.0", "wrong name"),
    "semicolons": ("GRID;1;;4.;5.;6.", "wrong name"),
    "own order": ("GRID,1,,4.,5.,6.\nSEQGP,1,2,2,1", "an order of their own"),
    "two models": ("GRID,1,,4.,5.,6.\nBEGIN SUPER=1", "several models"),
    "lines apart": ("GRID*,1,,4.0,5.0,*A\n*B,6.0", "go on with the card before"),
    "another card between": ("GRID*,1,,4.,5.,*A\nPLOTEL,1,1,2\n*A,6.", "stand behind the card"),
    "a card of its kind between": ("GRID*,1,,4.,5.,*A\nGRID,3\n*A,,,6.", "stand behind the card"),
    "the next line first": ("*A,6.\nGRID*,1,,4.,5.,*A\nPLOTEL,1,1,2", "stand behind the card"),
    "a line before any card": ("+,6.\nGRID,1,,4.,5.,6.", "stand behind the card"),
    "behind another card at the end": ("GRID*,1,,4.,5.,*A\nPLOTEL,1,1,2,,,,,+B\n*A,6.", "stand behind the card"),
    "an open quote": ("INCLUDE 'one.bdf\n" + 9 * "PLOTEL,1,1,2\n", "not closed"),
    "an open quote at the end of a file": ("INCLUDE 'one.bdf", "not closed"),
    "a point of a fluid": ("GRID,1,,4.,5.,6.,-1", "of a fluid"),
    "directions in no system": ("GRID,1,,4.,5.,6.,7", "directions of nodes are turned"),
    "directions by a word": ("GRID,1,,4.,5.,6.,x7", "no number"),
    "a field too many": ("GRID,1,,4.0,5.0,\n,6.0", "no number"),
    "a file that is not there": ("INCLUDE 'two.bdf'", "does not exist"),
    "a circle of files": ("INCLUDE 'model.bdf'", "includes itself"),
}


@pytest.mark.parametrize("cards, said", REFUSED.values(), ids=REFUSED)
def test_what_is_not_read_is_said(tmp_path: Path, cards: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read(tmp_path, cards)


@pytest.mark.parametrize("mark", ["$ between", ""], ids=["comment", "nothing"])
def test_systems_in_any_form(tmp_path: Path, mark: str) -> None:
    """A spherical system within a cylindrical one that is turned and moved, against their closed forms."""
    own = (
        "CORD2S*,8,7,0.,0.\n*,2.,0.,0.,3.\n{}\n*,1.,0.,2.\nCORD2C  7               1.0     0.0     0.0     1.0     0.0"
    )
    cards = own.format(mark) + "     1.0\n\n        1.0     1.0     0.0\nGRID,1,8,2.,60.,30."
    nodes = read(tmp_path, cards)
    # system 7 has x along the basic y and y against the basic x; system 8 stands 2 above it, turned as it is
    theta, phi = np.radians([60.0, 30.0])
    x, y, z = 2 * np.sin(theta) * np.cos(phi), 2 * np.sin(theta) * np.sin(phi), 2 * np.cos(theta)
    np.testing.assert_allclose(nodes.coordinates[0], [1 - y, x, z + 2], atol=1e-14)
