"""Readers of other packages, for files of codes whose formats are their own: imported only when such a file is read."""

from __future__ import annotations

import importlib
from types import ModuleType

from ..errors import InputError


def reader_of(module: str, package: str, extra: str, where: str) -> ModuleType:
    """An optional module.

    Parameters
    ----------
    module, package : str
        What is imported, and what pip calls it.
    extra : str
        Of fretwave, that brings it.
    where : str
        The file to be read, as a user would name it.

    Raises
    ------
    InputError
        It cannot be imported.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        what, fix = f"this file is read by the package {package}", f"pip install 'fretwave[{extra}]'"
        raise InputError(what, where, str(error), f"the optional package {package}", fix) from None
