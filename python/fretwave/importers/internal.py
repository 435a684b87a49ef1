"""Dofs that a code adds inside elements: of no node of the mesh, at rest in a rigid motion.

CalculiX' C3D8I carries its incompatible modes as three further nodes an element, numbered on from the deck's (its
routine gen3delem.f); Abaqus gives internal nodes negative numbers (Keywords Reference, *MATRIX OUTPUT).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import IntArray
from ..model.structure import Structure


def internal_dofs(model: Structure) -> npt.NDArray[np.bool_]:
    """(n_dof,) of nodes numbered beyond those of the mesh; none without a table of dofs and nodes."""
    if model.labels is None or model.node_numbers is None:
        return np.zeros(model.n_dof, dtype=bool)
    node = model.labels[:, 0]
    return np.asarray((node < 0) | (node > model.node_numbers.max()))


def internal_nodes(model: Structure) -> IntArray:
    """Their numbers."""
    inside = internal_dofs(model)
    return np.unique(model.labels[inside, 0]) if model.labels is not None else np.zeros(0, dtype=np.int64)
