"""Finite elements for the cases: structured hexahedra, elastic matrices, contact surfaces."""

from __future__ import annotations

from .cache import cached, default_folder, model_key
from .elasticity import TITANIUM, Material, MatrixReport, assemble, centrifugal_load, check_matrices, rigid_modes
from .interface import ContactPatch, contact_patch, nodal_areas, relative_rows, tangent_frames
from .mesh import Block, Mesh, Quality, join
from .prestress import spin_softening, stress_stiffness, stresses

__all__ = [
    "TITANIUM",
    "Block",
    "ContactPatch",
    "Material",
    "MatrixReport",
    "Mesh",
    "Quality",
    "assemble",
    "cached",
    "centrifugal_load",
    "check_matrices",
    "contact_patch",
    "default_folder",
    "join",
    "model_key",
    "nodal_areas",
    "relative_rows",
    "rigid_modes",
    "spin_softening",
    "stress_stiffness",
    "stresses",
    "tangent_frames",
]
