"""How values, paths and likely words are written in messages."""

from __future__ import annotations

import difflib
import json
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

#: Keys that papers write as symbols, in small letters without their underscore. Laws say theirs themselves.
SYMBOLS = {
    **{"m": ("M",), "k": ("K",), "c": ("C",), "alpha": ("mass_damping",), "beta": ("stiffness_damping",)},
    **{"kw": ("coefficient",), "nh": ("harmonics",), "nt": ("samples",), "zeta": ("damping",), "eta": ("loss_factor",)},
    **{"nd": ("nodal_diameter", "nodal_diameters"), "eo": ("engine_order",)},
}


@cache
def own_version() -> str:
    """Of the package that is installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("fretwave")
    except PackageNotFoundError:
        return "not installed"


def shortened(text: str, longest: int = 200) -> str:
    """A text as a message can bear it."""
    return text if len(text) <= longest else text[: longest - 3] + "..."


def number_in(text: str) -> float:
    """Of a table's field: Python reads 0.1_5 as 0.15, where it is a slip of the hand.

    Raises
    ------
    ValueError
        It is no number.
    """
    if "_" in text:
        raise ValueError(text)
    return float(text)


def whole_in(text: str) -> int:
    """The same of a whole number: Python reads 1_2 as 12.

    Raises
    ------
    ValueError
        It is none.
    """
    if "_" in text:
        raise ValueError(text)
    return int(text)


def counted(number: int, word: str) -> str:
    """``1 dof``, ``2 dofs``."""
    return f"{number} {word}{'s' * (number != 1)}"


def plus_minus(error: float | None) -> str:
    """What is said of an estimated error behind a value; empty where it is not known."""
    return "" if error is None or not math.isfinite(error) else f" +- {error:.1g}"


def without_nan(value: object) -> object:
    """The same with None where there is no number: JSON knows no nan."""
    if isinstance(value, Mapping):
        return {key: without_nan(one) for key, one in value.items()}
    if isinstance(value, list):
        return [without_nan(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def times(number: int) -> str:
    """``once``, ``2 times``."""
    return "once" if number == 1 else f"{number} times"


def nearest(word: str, known: Sequence[str], say: Callable[[str], str] = "did you mean `{}`?".format) -> str | None:
    """A fix line with the nearest known word (its symbol, its begin, like letters), None when nothing is near."""
    symbol = word.lower().replace("_", "")
    meant = [other for other in SYMBOLS.get(symbol, ()) if other in known]
    begun = meant or [other for other in known if len(word) > 1 and other.startswith(word)]
    found = begun or difflib.get_close_matches(word, known, n=1, cutoff=0.65)
    return say(found[0]) if found else None


def display(path: Path) -> str:
    """A path as short as it can be said from here."""
    relative = os.path.relpath(path)
    return readable(shortened(relative if not relative.startswith("..") else str(path)))


def readable(name: str) -> str:
    """The name of a file as text: bytes that are none in UTF-8, as of old archives, are written out (``\\xfc``)."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def is_there(path: Path) -> bool:
    """Whether a path can be opened; a name that no file can have is not there."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def names_beside(path: Path, pattern: str = "*") -> list[str]:
    """Names in the folder of a file, none where there is no such folder."""
    folder = path.parent
    return sorted(entry.name for entry in folder.glob(pattern)) if is_there(folder) and folder.is_dir() else []


def toml(value: object, longest: int = 60) -> str:
    """A value as TOML writes it, cut when long."""
    try:
        text = _inline(value)
    except (ValueError, RecursionError):  # integers of more than 4300 digits, arrays nested without end
        text = "(too long to show)"
    return shortened(text, longest)


def _inline(value: object) -> str:
    """A table inline and without what is not set; all else is as in JSON."""
    if isinstance(value, Mapping):
        named = ((key if re.fullmatch("[A-Za-z0-9_-]+", key) else json.dumps(key), one) for key, one in value.items())
        return "{ " + ", ".join(f"{key} = {_inline(one)}" for key, one in named if one is not None) + " }"
    if isinstance(value, list) and any(isinstance(one, Mapping) for one in value):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return str(value) if isinstance(value, float) else json.dumps(value, default=str, ensure_ascii=False)
