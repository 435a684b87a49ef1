"""Which reader a file of nodes needs: its content tells, not its name."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from pathlib import Path

from ..files.isolated import call_isolated
from . import ansys_mesh, nastran
from .ansys_full import head_of
from .nodes import Nodes, read_nodes
from .text import check_unmarked

#: How a file begins, or a line of it, that only this kind has; and its reader.
KINDS = (
    (re.compile(b"\\A" + re.escape(head_of(12))), ansys_mesh.__name__, "read_result"),
    (re.compile(rb"^NBLOCK,", re.MULTILINE | re.IGNORECASE), ansys_mesh.__name__, "read_archive"),
    (
        re.compile(rb"^[ \t]*(GRID(\*?[ \t]+|\*?[ \t]*,[ \t]*)\d|INCLUDE[ \t,'\"])", re.MULTILINE | re.IGNORECASE),
        nastran.__name__,
        "read_grid",
    ),
)
#: NPZ, and input decks.
OTHERS = (b"PK\x03\x04", b"*")


def read_node_file(path: Path) -> Nodes:
    """Coordinates and sets from a file of any of the forms; other packages read theirs in a process of its own."""
    content = path.read_bytes().removeprefix(BOM_UTF8) if path.is_file() else b""
    for known, module, function in KINDS if not content.startswith(OTHERS) else ():
        if known.search(content):
            check_unmarked(path)
            found: Nodes = call_isolated(module, function, path, size=len(content))
            return found
    return read_nodes(path)
