"""What no case file needs and nothing behind it can take: values nested without end, and the character NUL."""

from __future__ import annotations

from typing import Any

from ...errors import InputError

#: Tables and arrays within each other; a matrix of an analysis' option is five deep.
DEEPEST = 32


def check_plain(data: object, where: str) -> None:
    """Refuse a value that would break what reads it (HDF5 and paths end at NUL, walks of a tree are recursive).

    Raises
    ------
    InputError
    """
    level, depth = [data], 0
    while level:
        if depth > DEEPEST:
            raise InputError(
                "tables or arrays are nested too deeply", where, f"more than {DEEPEST} levels", "a few", "flatten them"
            )
        for value in level:
            texts = list(value) if isinstance(value, dict) else [value]
            bad = next((text for text in texts if isinstance(text, str) and "\0" in text), None)
            if bad is not None:
                shown = repr(bad if len(bad) < 60 else bad[:57] + "...")
                raise InputError("a text has the character NUL", where, shown, "printable text", "take it out")
        level = [part for value in level for part in _inside(value)]
        depth += 1


def _inside(value: object) -> list[Any]:
    if isinstance(value, dict):
        return list(value.values())
    return value if isinstance(value, list) else []
