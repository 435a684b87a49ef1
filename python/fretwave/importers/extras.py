"""Readers of other packages, for files of codes whose formats are their own: imported only when such a file is read."""

from __future__ import annotations

import importlib
from types import ModuleType

import numpy as np

from ..errors import InputError

#: How pip gets them into an environment whose h5py is the system's: what pyyeti asks for beside pandas is not needed
#: here, and an h5py of pip's, with an HDF5 of its own beside PETSc's, crashes.
INSTALLED_BY = {
    "ansys-mapdl-reader": "pip install ansys-mapdl-reader",
    "mapdl-archive": "pip install mapdl-archive",
    "pyyeti": "pip install pandas && pip install --no-deps pyyeti",
}


def reader_of(module: str, package: str, where: str) -> ModuleType:
    """An optional module.

    Parameters
    ----------
    module, package : str
        What is imported, and what pip calls it, one of `INSTALLED_BY`.
    where : str
        The file to be read, as a user would name it.

    Raises
    ------
    InputError
        It cannot be imported.
    """
    try:
        with np.printoptions():  # pyyeti changes how NumPy prints, for all
            return importlib.import_module(module)
    except ImportError as error:
        what, expected = f"this file is read by the package {package}", f"the optional package {package}"
        raise InputError(what, where, str(error), expected, INSTALLED_BY[package]) from None
