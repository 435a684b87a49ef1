"""Built models kept between runs: one .npz for each set of options and each state of the code that builds."""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import scipy.sparse as sp

from ..files.whole import FileError, replaced

_PARTS = ("data", "indices", "indptr", "shape")


def default_folder() -> Path:
    """``$XDG_CACHE_HOME/fretwave``, or ``~/.cache/fretwave``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fretwave"


def model_key(options: Mapping[str, Any], sources: Iterable[Path]) -> str:
    """Hash of the options and of the files whose code decides the result; this package's own are included."""
    digest = hashlib.sha256(json.dumps(dict(options), sort_keys=True, default=str).encode())
    for path in [*sorted(Path(__file__).parent.glob("*.py")), *sources]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cached(file: Path, compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What `compute` returns (arrays, CSR matrices, numbers, text), read from the file when it is there.

    The file appears whole or not at all, so that several processes may build at once.
    """
    with suppress(OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error):  # not there, or damaged: made anew
        return load(file)
    values = compute()
    with suppress(OSError, FileError):  # a cache that cannot be written costs time, nothing else
        file.parent.mkdir(parents=True, exist_ok=True)
        with replaced(file, own=True, keep_suffix=True) as fresh:
            save(fresh, values)
    return values


def save(file: Path, values: Mapping[str, Any]) -> None:
    """Write arrays, CSR matrices, numbers and text to an .npz."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if sp.issparse(value):
            flat.update({f"{name}.{part}": getattr(value.tocsr(), part) for part in _PARTS})
        else:
            flat[name] = value
    np.savez(file, **flat)


def load(file: Path) -> dict[str, Any]:
    """The inverse of `save`."""
    with np.load(file) as archive:
        flat = {name: archive[name] for name in archive.files}
    matrices = {name.rpartition(".")[0] for name in flat if "." in name}
    values = {name: value.item() if value.ndim == 0 else value for name, value in flat.items() if "." not in name}
    for name in matrices:
        data, indices, indptr, shape = (flat[f"{name}.{part}"] for part in _PARTS)
        values[name] = sp.csr_matrix((data, indices, indptr), shape=tuple(shape))
    return values
