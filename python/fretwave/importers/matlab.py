"""MATLAB files: version 5 (``save -v6``, ``-v7``) through SciPy, version 7.3 (``save -v7.3``) through h5py.

Layout of version 5: MathWorks, "MAT-File Format". Version 7.3 is HDF5 behind a block of 512 bytes that begins with
"MATLAB 7.3 MAT-file"; MathWorks does not document it further. As files (and the readers mat73 and hdf5storage) show: a
sparse matrix is a group with the attribute ``MATLAB_sparse`` (number of rows) and the datasets ``data``, ``ir`` (row of
each entry) and ``jc`` (where each column begins); ``data`` and ``ir`` are absent when it has no entry. A full matrix is
a dataset with its dimensions reversed; complex numbers are compounds (real, imag).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.io
import scipy.sparse as sp

from ..texts import display
from .entries import Entries
from .npz import choose

if TYPE_CHECKING:
    import h5py
    import numpy.typing as npt


NUMERIC = ("sparse", "double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")


def read_v5(path: Path, letter: str, variable: str | None = None) -> Entries:
    """A matrix of a file of version 5."""
    where = display(path)
    names = [name for name, shape, kind in scipy.io.whosmat(str(path)) if kind in NUMERIC and len(shape) == 2]
    name = choose(names, letter, variable, where)
    return Entries.of(scipy.io.loadmat(str(path), variable_names=[name])[name], where, "MATLAB 5")


def read_v73(path: Path, letter: str, variable: str | None = None) -> Entries:
    """A matrix of a file of version 7.3."""
    import h5py

    where = display(path)
    with h5py.File(path, "r") as file:
        names = [name for name, item in file.items() if _is_matrix(item)]
        item = file[choose(names, letter, variable, where)]
        matrix = _sparse(item) if hasattr(item, "keys") else _real_or_complex(item[()]).T
    return Entries.of(matrix, where, "MATLAB 7.3")


def _is_matrix(item: h5py.Group | h5py.Dataset) -> bool:
    if hasattr(item, "keys"):
        return "MATLAB_sparse" in item.attrs and "jc" in item
    return item.ndim == 2 and (item.dtype.kind in "fiu" or item.dtype.names == ("real", "imag"))


def _sparse(group: h5py.Group) -> sp.csc_matrix:
    starts = group["jc"][()].astype(np.int64)
    shape = (int(group.attrs["MATLAB_sparse"]), len(starts) - 1)
    if "data" not in group:
        return sp.csc_matrix(shape)
    return sp.csc_matrix((_real_or_complex(group["data"][()]), group["ir"][()].astype(np.int64), starts), shape=shape)


def _real_or_complex(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return values["real"] + 1j * values["imag"] if values.dtype.names else values
