"""The model as it was given, and its mesh in the cells of VTK."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..case.load import Case
from ..errors import InputError
from ..fe.mesh import VTK_LATTICE
from ..model.cells import HEXAHEDRA, KINDS
from ..model.structure import Structure
from ..texts import display
from .vtkhdf import HEXAHEDRON, VERTEX, Cells, linear_cells


def geometry(case: Case) -> Structure:
    """Nodes, cells and pairs of the model as it was given: of a sector, with both its faces.

    Raises
    ------
    InputError
        There are no nodes.
    """
    given = case.structure.cut or case.structure
    if given.coordinates is None:
        raise InputError(
            "the model cannot be shown: it has no nodes",
            display(case.path),
            "no coordinates of nodes with three displacements each",
            "a builder that gives coordinates (and hexahedra), or a model file with coordinates",
            "give Structure its coordinates, or import with --coordinates; `plot` and `probe --dof` need neither",
        )
    return given


def mesh_of(case: Case, linear: bool = False) -> tuple[Array, list[Cells]]:
    """Nodes (n_nodes, 3), and cells (n_cells, m) with VTK's number of their kind; points where there are no cells."""
    given = geometry(case)
    nodes, cells = np.asarray(given.coordinates), given.hexahedra
    found: list[Cells] = [(table, KINDS[kind].vtk) for kind, table in given.cells.items() if len(table)]
    if cells is not None:
        cut = linear and cells.shape[1] == 27
        first = (linear_cells(cells, VTK_LATTICE), HEXAHEDRON) if cut else (cells, HEXAHEDRA[cells.shape[1]])
        found.insert(0, first)
    return nodes, found or [(np.arange(len(nodes))[:, None], VERTEX)]
