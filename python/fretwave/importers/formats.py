"""Which reader a matrix file needs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError
from ..files.isolated import call_isolated
from ..texts import display, nearest
from . import abaqus, calculix, matlab, matrix_market, npz, petsc_binary
from .entries import Entries

FORMATS = (
    "NumPy (.npz, .npy)",
    "Matrix Market (.mtx)",
    "MATLAB 5 to 7.3 (.mat)",
    "PETSc binary",
    "CalculiX (.sti, .mas)",
    "Abaqus (.mtx)",
)

HDF5 = b"\x89HDF\r\n\x1a\n"


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
        names = sorted(entry.name for entry in path.parent.iterdir()) if path.parent.is_dir() else []
        fix = nearest(path.name, names) or "check the path"
        raise InputError(f"the file of {letter} does not exist", display(path), None, "a matrix file", fix)
    with readable(path, f"file of {letter}"):
        with path.open("rb") as file:
            head = file.read(520)
        return _read(path, head, variable, letter)


@contextmanager
def readable(path: Path, what: str) -> Iterator[None]:
    """A damaged file makes the readers of NumPy, SciPy and h5py raise anything: it is named, whatever that was.

    Raises
    ------
    InputError
    """
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


def _isolated(function: str, path: Path, letter: str, variable: str | None) -> Entries:
    """A reader of `matlab` in a process of its own: SciPy and HDF5 can crash on a damaged file."""
    found: Entries = call_isolated(matlab.__name__, function, path, letter, variable, size=path.stat().st_size)
    return found


def split(given: str) -> tuple[Path, str | None]:
    """``model.mat:Kred`` -> (model.mat, Kred); a path that exists is never split."""
    name, colon, variable = given.rpartition(":")
    if colon and variable.isidentifier() and not Path(given).exists():
        return Path(name), variable
    return Path(given), None


def _read(path: Path, head: bytes, variable: str | None, letter: str) -> Entries:
    if head.startswith((b"PK\x03\x04", b"\x93NUMPY")):
        return npz.read(path, letter, variable)
    if head.startswith(b"%%MatrixMarket"):
        return matrix_market.read(path)
    if head.startswith(b"MATLAB 7.3") or HDF5 in (head[:8], head[512:520]):
        return _isolated("read_v73", path, letter, variable)
    if head.startswith(b"MATLAB 5.0"):
        return _isolated("read_v5", path, letter, variable)
    if petsc_binary.integer_type(head):
        return petsc_binary.read(path)
    if path.suffix.lower() in calculix.SUFFIXES:
        return calculix.read(path)
    if abaqus.looks_like(head):
        return abaqus.read(path)
    raise InputError(
        f"the format of the file of {letter} is not known",
        display(path),
        f"it begins with {head[:24]!r}",
        ", ".join(FORMATS),
        "write it with scipy.sparse.save_npz or scipy.io.mmwrite",
    )
