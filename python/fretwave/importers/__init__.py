"""Importers: matrices, nodes and contact pairs of finite-element codes into one native model file.

Every format has its file. A reader takes a path and gives `Entries`; `read_matrix` chooses it by what the file begins
with, not by what it is called: ``.mtx`` is Matrix Market's suffix and Abaqus' as well.
"""

from __future__ import annotations

from .entries import Assembled, Entries, assemble
from .formats import FORMATS, read_matrix

__all__ = ["FORMATS", "Assembled", "Entries", "assemble", "read_matrix"]
