"""The check report of an import: is this the model that was meant?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..arrays import Array
from ..errors import FretwaveError, PetscError
from ..model.sectors import Sparse
from ..model.structure import Structure
from ..texts import counted
from .internal import internal_dofs, internal_nodes
from .units import Evidence, words

if TYPE_CHECKING:
    from mpi4py import MPI


#: omega^2 of a rigid motion is rounding: below this share of trace K / trace M.
RIGID = 1e-12
#: Energy of a rigid motion of one body, over that of its stiffest dof, below which nothing holds the body.
UNHELD = 1e-10
#: Masses along x, y and z may differ by this share before it is said.
MASS_SPREAD = 1e-6


@dataclass
class Report:
    """Lines of what was found, and warnings: what is likely to be wrong."""

    lines: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def text(self) -> str:
        return "\n".join([*self.lines, *(f"warning: {warning}" for warning in self.warnings)])


def rigid_motions(model: Structure) -> Array | None:
    """Translations along and rotations about x, y, z (n_dof, 6), None without coordinates of all nodes.

    Dofs inside elements do not move in them.
    """
    if model.labels is None or model.coordinates is None or model.node_numbers is None:
        return None
    meshed = np.flatnonzero(~internal_dofs(model))
    node, direction = model.labels[meshed].T
    order = np.argsort(model.node_numbers)
    place = order[np.clip(np.searchsorted(model.node_numbers[order], node), 0, len(order) - 1)]
    if (model.node_numbers[place] != node).any() or direction.min(initial=1) < 1 or direction.max(initial=1) > 6:
        return None
    x = model.coordinates - model.coordinates.mean(axis=0)
    motions = np.zeros((model.n_dof, 6))
    motions[meshed, direction - 1] = 1.0
    moved = np.flatnonzero(direction <= 3)
    turned = np.cross(np.eye(3), x[place[moved], None])  # (dof, axis of rotation, direction)
    motions[meshed[moved], 3:] = turned[np.arange(len(moved)), :, direction[moved] - 1]
    return motions


def expected_rigid(model: Structure, motions: Array) -> tuple[int, int]:
    """Rigid modes that the geometry allows, and the number of separate bodies (what K joins)."""
    count, body = connected_components(model.K, directed=False)
    largest = float(abs(model.K.diagonal()).max())
    free = 0
    for number in range(count):
        dofs = np.flatnonzero(body == number)
        Q, size, _ = np.linalg.svd(motions[dofs], full_matrices=False)
        Q = Q[:, size > 1e-9 * size.max(initial=1e-300)]
        energy = np.linalg.eigvalsh(Q.T @ (model.K[dofs][:, dofs] @ Q))
        free += int(np.sum(abs(energy) < UNHELD * largest))
    return free, int(count)


def check(
    model: Structure,
    symmetry: dict[str, str],
    notes: Sequence[str],
    evidence: Sequence[Evidence],
    modes: int,
    comm: MPI.Comm,
    warnings: Sequence[str] = (),
) -> Report:
    """Everything that can be said without a law of contact. Collective.

    Parameters
    ----------
    symmetry : dict
        What was found of each matrix, by letter.
    notes : sequence of str
        What the import did.
    evidence : sequence of Evidence
        Of its units.
    modes : int
        Frequencies to show beside the rigid modes.
    warnings : sequence of str
        Of the import.
    """
    report = Report(warnings=list(warnings))
    nodes = "" if model.labels is None else f" at {len(np.unique(model.labels[:, 0]))} nodes"
    inside = len(internal_nodes(model))
    more = f", {inside} of them inside elements (numbered beyond the mesh's)" if inside else ""
    report.lines.append(f"{model.n_dof} dofs{nodes}{more}")
    for letter, said in symmetry.items():
        report.lines.append(f"{letter}: {getattr(model, letter).nnz} entries, {said}")
    report.lines.extend(notes)
    motions = rigid_motions(model)
    _contacts(model, report)
    _mass(model, motions, report)
    _diagonal(model, model.K.diagonal(), "stiffness", report)
    _frequencies(model, motions, modes, comm, report)
    lines, warnings = words(model.units, evidence)
    report.lines += lines
    report.warnings += dict.fromkeys(warnings)
    return report


def _contacts(model: Structure, report: Report) -> None:
    for name, pairs in model.pairs.items():
        area = "areas not given" if pairs.areas is None else f"area {pairs.areas.sum():.6g} in all"
        report.lines.append(f"contact '{name}': {counted(pairs.n_pairs, 'pair')}, {area}")


def _mass(model: Structure, motions: Array | None, report: Report) -> None:
    diagonal = model.M.diagonal()
    report.lines.append(f"M: diagonal {diagonal.min():.4g} to {diagonal.max():.4g}")
    _diagonal(model, diagonal, "mass", report)
    if motions is None:
        report.lines.append("mass of the body: not known without coordinates and a table of dofs")
        return
    found, unit = masses(model.M, motions), f" [{model.unit_system('mass')}]" if model.units else ""
    absent = len(np.setdiff1d(model.node_numbers, model.labels[:, 0]))  # type: ignore[arg-type,index]
    held = f" (without the {absent} nodes that have no dof)" if absent else ""
    report.lines.append("mass: " + ", ".join(f"{m:.6g} along {a}" for m, a in zip(found, "xyz")) + unit + held)
    if np.ptp(found) > MASS_SPREAD * found.max():
        report.warnings.append(
            "the mass differs along x, y and z: dofs are held or missing, or M has entries that belong elsewhere"
        )


def masses(M: Sparse, motions: Array) -> Array:
    """t^T M t (3,) [mass] of the three translations, the first columns of motions (n_dof, 3 or more)."""
    return np.asarray(np.einsum("ik,ik->k", motions[:, :3], M @ motions[:, :3]))


def _diagonal(model: Structure, diagonal: Array, quantity: str, report: Report) -> None:
    """Every dof has mass and stiffness."""
    wrong = diagonal == 0
    if wrong.any():
        first = model.dof_names[int(np.argmax(wrong))]
        report.warnings.append(f"{counted(int(wrong.sum()), 'dof')} with no {quantity}, the first is {first}")


def _frequencies(model: Structure, motions: Array | None, modes: int, comm: MPI.Comm, report: Report) -> None:
    from ..model.model import Model
    from ..model.modes import linear_modes

    expected, bodies = (6, 1) if motions is None else expected_rigid(model, motions)
    try:
        with Model(model.M, model.K, comm=comm) as whole:
            found = linear_modes(whole, expected + modes, "free")
    except FretwaveError as error:
        reason = "" if isinstance(error, PetscError) else f" ({error.what})"
        said = "is a dof without mass and stiffness, or K singular where there is no mass?"
        report.warnings.append(f"the frequencies cannot be computed{reason}: {said}")
        return
    scale = model.K.diagonal().sum() / model.M.diagonal().sum()
    squares = np.array([mode.shape @ (model.K @ mode.shape) / (mode.shape @ (model.M @ mode.shape)) for mode in found])
    rigid = int(np.sum(abs(squares) < RIGID * scale))
    if motions is None:
        said = "0 or 6 are usual for one body"
    else:
        said = f"expected {expected}" + (f" ({bodies} bodies, each joined by K)" if bodies > 1 else "")
    report.lines.append(f"rigid modes: {rigid} found, {said}")
    if motions is not None and rigid != expected:
        report.warnings.append(
            f"K has {counted(rigid, 'rigid mode')}, the nodes and what holds them let expect {expected}: "
            + ("a mechanism or a loose part" if rigid > expected else "K does not leave a rigid motion free of force")
        )
    if (squares < -RIGID * scale).any():
        report.warnings.append(
            f"K is negative for a motion: omega^2 = {squares.min():.4g}. A buckled structure, or one that spins too"
            " fast for its stiffness, is unstable so; else a sign or an entry of K is wrong"
        )
    elastic = np.sqrt(squares[squares >= RIGID * scale])[:modes] / (2 * np.pi)
    unit = "Hz" if model.units else "1/time"
    faces = ", both faces free" if model.sectors else ""
    values = ", ".join(f"{value:.6g}" for value in elastic) or "none among the modes that were looked for"
    report.lines.append(f"first frequencies{faces} [{unit}]: {values}")
    if model.sectors and modes:
        _waves(model, modes, unit, comm, report)


def _waves(model: Structure, modes: int, unit: str, comm: MPI.Comm, report: Report) -> None:
    """Of the sector tied to its neighbours, all moving alike, without contact. Collective."""
    from ..model.modes import linear_modes

    with model.tied().model(comm=comm, nodal_diameter=0) as wheel:
        found = [mode.omega / (2 * np.pi) for mode in linear_modes(wheel, modes, "free")]
    values = ", ".join(f"{value:.6g}" for value in found)
    report.lines.append(f"first frequencies of the wheel, 0 nodal diameters, no contact [{unit}]: {values}")
