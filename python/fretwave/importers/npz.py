"""NumPy archives: ``scipy.sparse.save_npz`` (keys ``format``, ``data``, ...) or dense arrays of ``numpy.savez``.

Layout: scipy.sparse.save_npz (SciPy reference), numpy.savez (NumPy reference, "A simple file format for NumPy arrays").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..errors import InputError
from ..texts import display
from .entries import Entries

#: What variables are called when none is named.
USUAL = {
    "M": ("M", "mass", "Mass", "MASS", "m"),
    "K": ("K", "stiffness", "Stiffness", "STIFFNESS", "k"),
    "C": ("C", "D", "damping", "Damping", "DAMPING", "c"),
}


def read(path: Path, letter: str, variable: str | None = None) -> Entries:
    """A sparse or dense matrix."""
    where = display(path)
    found = np.load(path)
    if isinstance(found, np.ndarray):
        return Entries.of(_matrix(found, where), where, "NumPy array")
    with found:
        if "format" not in found.files:
            name = choose(found.files, letter, variable, where)
            return Entries.of(_matrix(found[name], where), where, "NumPy archive")
    return Entries.of(sp.load_npz(path), where, "SciPy sparse archive")


def _matrix(values: npt.NDArray[Any], where: str) -> npt.NDArray[Any]:
    if values.ndim != 2 or values.dtype.kind not in "fiuc":
        measured = f"{values.ndim} dimensions of {values.dtype}"
        raise InputError("an array is no matrix", where, measured, "two dimensions of numbers", "name another array")
    return values


def choose(
    names: Sequence[str],
    letter: str,
    variable: str | None,
    where: str,
    usual: Mapping[str, Sequence[str]] = USUAL,
) -> str:
    """The variable asked for, else one of the usual name, else the only one, unless that is another matrix's name."""
    if variable is not None and variable in names:
        return variable
    found = [name for name in usual[letter] if name in names]
    others = {name for key, given in usual.items() if key != letter for name in given}
    if variable is None and (found or (len(names) == 1 and names[0] not in others)):
        return found[0] if found else names[0]
    likely = [name for name in names if name.startswith(tuple(usual[letter]))] or [*names, "NAME"]
    asked = f"variable {variable}" if variable is not None else f"matrix {letter}"
    raise InputError(
        f"there is no {asked} in this file",
        where,
        f"it holds {', '.join(names) or 'nothing'}",
        f"one of {', '.join(usual[letter])}" if variable is None else variable,
        f"name it: {where}:{likely[0]}",
    )
