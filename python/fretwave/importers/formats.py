"""Which reader a matrix file needs: formats of the package, and those that users register."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, TypeVar

import numpy as np
import scipy.sparse as sp

from .. import registry
from ..errors import InputError
from ..files.isolated import call_isolated
from ..given import masked
from ..texts import display, names_beside, nearest
from . import abaqus, ansys_full, calculix, matlab, matrix_market, nastran, npz, petsc_binary
from .entries import Entries
from .text import check_plain, check_unmarked, head_of

HDF5 = b"\x89HDF\r\n\x1a\n"
#: A function of path, letter and variable that gives `Entries`; a registered one may give a matrix.
Reader = TypeVar("Reader", bound=Callable[[Path, str, "str | None"], Any])


@dataclass(frozen=True)
class Format:
    """A format of matrix files.

    Attributes
    ----------
    name : str
        As a message lists it.
    tells : callable
        Whether a file is of it, from its first 520 bytes and its path.
    read : callable
        Its `Reader`.
    """

    name: str
    tells: Callable[[bytes, Path], bool]
    read: Callable[[Path, str, str | None], Any]


def _matlab(path: Path, letter: str, variable: str | None) -> Entries:
    """In a process of its own: SciPy and HDF5 can crash on a damaged file."""
    with path.open("rb") as file:
        function = "read_v5" if file.read(10) == b"MATLAB 5.0" else "read_v73"
    found: Entries = call_isolated(matlab.__name__, function, path, letter, variable, size=path.stat().st_size)
    return found


def _is_matlab(head: bytes, path: Path) -> bool:
    return head.startswith((b"MATLAB 7.3", b"MATLAB 5.0")) or HDF5 in (head[:8], head[512:520])


def _ansys(path: Path, letter: str, variable: str | None) -> Entries:
    found: Entries = call_isolated(ansys_full.__name__, "read", path, letter, size=path.stat().st_size)
    return found


def _nastran(path: Path, letter: str, variable: str | None) -> Entries:
    check_unmarked(path)
    found: Entries = call_isolated(nastran.__name__, "read", path, letter, variable, size=path.stat().st_size)
    return found


#: Asked in this order, after the registered ones.
FORMATS = (
    Format("NumPy (.npz, .npy)", lambda head, path: head.startswith((b"PK\x03\x04", b"\x93NUMPY")), npz.read),
    Format(
        "Matrix Market (.mtx)",
        lambda head, path: matrix_market.looks_like(head),
        lambda path, letter, variable: matrix_market.read(path),
    ),
    Format("MATLAB 5 to 7.3 (.mat)", _is_matlab, _matlab),
    Format(
        "PETSc binary",
        lambda head, path: bool(petsc_binary.integer_type(head)),
        lambda path, letter, variable: petsc_binary.read(path),
    ),
    Format(
        "CalculiX (.sti, .mas)",
        lambda head, path: path.suffix.lower() in calculix.SUFFIXES,
        lambda path, letter, variable: calculix.read(path),
    ),
    Format("Ansys (.full)", lambda head, path: head.startswith(ansys_full.head_of(4)), _ansys),
    Format("Nastran (.op4)", lambda head, path: path.suffix.lower() == ".op4", _nastran),
    Format(
        "Abaqus (.mtx)",
        lambda head, path: abaqus.looks_like(head),
        lambda path, letter, variable: abaqus.read(path),
    ),
)
_registered: dict[str, Format] = {}
_readers: dict[str, Any] = {}


def register_format(suffix: str) -> Callable[[Reader], Reader]:
    """Decorator that makes a reader of matrix files known by their suffix, to cases and to ``fretwave import``.

    Parameters
    ----------
    suffix : str
        ``".xyz"``; goes before the formats of the package.

    The reader takes the path, the letter (M, K, C) and the variable named behind a colon (or None); it gives a dense or
    SciPy matrix, or `Entries` with node and direction of each row. It may raise anything on a damaged file.

    Raises
    ------
    InputError
        Another file has a reader of this suffix, or it is no suffix.
    """
    if not suffix.startswith(".") or len(suffix) < 2:
        raise InputError("it is no suffix", f"register_format({suffix!r})", suffix, "as in '.xyz'", "begin with a dot")

    def register(reader: Reader) -> Reader:
        registry.admit(registry.FORMAT, suffix, _readers, reader)
        _readers[suffix] = reader
        _registered[suffix] = Format(suffix, lambda head, path: path.suffix.lower() == suffix.lower(), read)
        return reader

    def read(path: Path, letter: str, variable: str | None) -> Any:
        return _matrix(_readers[suffix](path, letter, variable), path, suffix)

    return register


def _matrix(found: object, path: Path, suffix: str) -> Any:
    """What a registered reader gave, if it is a matrix of numbers."""
    if isinstance(found, Entries):
        return found
    values: Any = found if sp.issparse(found) else np.asanyarray(found)
    if values.ndim != 2 or values.dtype.kind not in "biufc" or masked(values):
        kind = "masked values" if masked(values) else f"{type(found).__name__}, {values.dtype.name} {values.shape}"
        what, fix = f"the reader of {suffix} files returned no matrix of numbers", "correct the plug-in"
        raise InputError(what, display(path), kind, "a dense or SciPy matrix, or fretwave.Entries", fix)
    return values


def forget_format(reader: Reader) -> None:
    """The inverse of `register_format`."""
    for suffix in [suffix for suffix, known in _readers.items() if known is reader]:
        del _readers[suffix], _registered[suffix]


def registered(path: Path) -> Format | None:
    """The format that a user has registered for this file."""
    return next((one for one in _registered.values() if one.tells(b"", path)), None)


def format_of(path: Path) -> Format | None:
    """The format of a file that is there, as its first bytes tell it; None where none of them is."""
    head = head_of(path, 520)
    return next((one for one in (*_registered.values(), *FORMATS) if one.tells(head, path)), None)


def read_matrix(given: str, letter: str) -> Entries:
    """Read one matrix; the file's first bytes tell its format.

    Parameters
    ----------
    given : str
        Path, or ``path:variable`` for files of several variables.
    letter : str
        M, K or C: the variable looked for when none is named.

    Raises
    ------
    InputError
        The file is missing, of an unknown format or not what its format says.
    """
    path, variable = split(given)
    if not path.is_file():
        fix = nearest(path.name, names_beside(path)) or "check the path"
        raise InputError(f"the file of {letter} does not exist", display(path), None, "a matrix file", fix)
    with readable(path, f"file of {letter}"):
        return _read(path, variable, letter)


@contextmanager
def readable(path: Path, what: str) -> Iterator[None]:
    """A damaged file makes the readers of NumPy, SciPy and h5py raise anything: it is named, whatever that was.

    Raises
    ------
    InputError
    """
    check_plain(path, what)
    try:
        yield
    except InputError as error:
        if error.where is None:
            raise InputError(f"the {what} cannot be read", display(path), error.measured, None, error.fix) from None
        raise
    except Exception as error:
        text = " ".join(str(error).split())
        measured, fix = f"{type(error).__name__}: {text}", "export it again; is the file complete?"
        raise InputError(f"the {what} cannot be read", display(path), measured, None, fix) from None


def split(given: str) -> tuple[Path, str | None]:
    """``model.mat:Kred`` -> (model.mat, Kred); a path that exists is never split."""
    name, colon, variable = given.rpartition(":")
    if colon and variable.isidentifier() and not Path(given).exists():
        return Path(name), variable
    return Path(given), None


def _read(path: Path, variable: str | None, letter: str) -> Entries:
    one = format_of(path)
    if one is not None:
        found = one.read(path, letter, variable)
        return found if isinstance(found, Entries) else Entries.of(found, display(path), one.name)
    raise InputError(
        f"the format of the file of {letter} is not known",
        display(path),
        f"it begins with {head_of(path, 24)!r}",
        ", ".join(one.name for one in (*FORMATS, *_registered.values())),
        "write it with scipy.sparse.save_npz or scipy.io.mmwrite",
    )
