"""Linear modes at the far end of a backbone: contact free, or closed and sliding."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ...case.analysis import AnalysisSection
from ...case.harmonic import HarmonicSection, nodal_diameter
from ...model.contact import Contact, in_limit
from ...model.sectors import in_wave
from ...post.largest import largest
from .context import AnalysisContext

if TYPE_CHECKING:
    from mpi4py import MPI

    from ...case.load import Case
    from ...model.model import Model
    from ...model.modes import LinearMode

#: Modes looked through for the one most like the stuck mode, beyond its own number: two, and the six rigid motions of a
#: body that friction alone holds.
MORE_MODES = 8
#: Frequencies that differ by less, relative, are one: of a double mode, which the solver leaves apart by rounding.
SAME = 1e-8


def other_asymptote(context: AnalysisContext[HarmonicSection], stuck: LinearMode) -> dict[str, float]:
    """Frequency of the linear mode most like the stuck one, without friction. Collective.

    Returns
    -------
    dict
        ``free_omega`` [rad/s]: no contact force at all. For contacts with a normal direction ``sliding_omega``:
        all pairs stay closed and slide without friction; without contact such a structure is often not held. Empty
        without contact.
    """
    if not context.case.contacts:
        return {}
    limit, modes = loose_modes(context, min(context.model.n_dof, context.analysis.linear_mode + MORE_MODES))
    return {f"{limit}_omega": most_like(context, modes, stuck, nodal_diameter(context.analysis)).omega}


def loose_modes(context: AnalysisContext[HarmonicSection], count: int) -> tuple[str, list[LinearMode]]:
    """The limit of the contact without friction, ``free`` or ``sliding``, and its lowest modes. Collective."""
    if all(contact.components == 1 for contact in context.case.contacts):
        return "free", context.linear_mode("free", count)
    from ...model.modes import linear_modes

    with limit_model(context.case, context.comm, "sliding", nodal_diameter(context.analysis)) as model:
        return "sliding", linear_modes(model, count)


def sector_phase(case: Case, diameters: int) -> float:
    """Phase from a sector to the next of a wave of so many nodal diameters [rad]; 0 without sectors."""
    return 2 * np.pi * diameters / case.neighbours.sectors if case.neighbours else 0.0


def limit_model(case: Case, comm: MPI.Comm, limit: str, diameters: int = 0) -> Model:
    """The model with its contacts in a linear limit (`fretwave.model.contact.LIMITS`), in a wave. Collective.

    For undamped modes: without damping by mode, which is of the case's own contacts.
    """
    return _with_contacts(case, in_limit(case.contacts, limit), comm, diameters)


def with_friction(case: Case, model: Model, diameters: int = 0) -> Model:
    """The model of a case with friction in every pair that is closed at rest; the others are open. Collective."""
    closed = [contact.closed(which) for contact, which in zip(case.contacts, model.closed_at_rest())]
    return _with_contacts(case, closed, model.comm, diameters)


def _with_contacts(case: Case, contacts: list[Contact], comm: MPI.Comm, diameters: int) -> Model:
    from ...case.build import build_model

    undamped = replace(case.tables, damping=None)
    return build_model(replace(case, contacts=contacts, tables=undamped), (), comm, nodal_diameter=diameters)


def closed_stiffness(
    context: AnalysisContext[AnalysisSection], closed: Mapping[str, npt.NDArray[np.bool_]]
) -> sp.csr_matrix:
    """Stiffness of closed pairs that stick, on the dofs: sum k_b b b^T over normals and tangents.

    Parameters
    ----------
    closed : (n_pairs,) of contacts with a normal direction, by name; all pairs of others are
    """
    total = sp.csr_matrix(context.case.M.shape)
    for contact in context.case.contacts:
        for row in range(contact.components):
            value = contact.value(contact.info.stiffness_along(row))
            if value is not None:
                rows = contact.pairs.own[row :: contact.components]
                stiffness = np.broadcast_to(value, (contact.n_pairs,)) * closed.get(contact.name, 1.0)
                total = total + rows.T @ sp.diags(stiffness) @ rows
    return total


def asymptote_line(name: str, stuck: float, other: dict[str, float]) -> str:
    """The asymptotes in one line."""
    words = {"free_omega": "contact free", "sliding_omega": "closed and sliding"}
    texts = [f"stuck {stuck / (2 * math.pi):.6g} Hz"]
    texts += [f"{words[key]} {omega / (2 * math.pi):.6g} Hz" for key, omega in other.items()]
    return f"{name}: asymptotes: {', '.join(texts)}"


def most_like(
    context: AnalysisContext[AnalysisSection], modes: Sequence[LinearMode], stuck: LinearMode, diameters: int = 0
) -> LinearMode:
    """The mode most like another, by the product of their shapes with M in the wave.

    Modes of one frequency span a plane in which the solver turns them at will: the whole of it is compared, and the
    other mode's projection on it stands for it.

    Parameters
    ----------
    modes : ascending, of unit modal mass
    diameters : nodal diameters of the wave of both, on a sector
    """
    theta = sector_phase(context.case, diameters)
    wanted = in_wave(context.case.structure.M, stuck.shape + 1j * stuck.imaginary, theta)
    shares = np.array([np.vdot(mode.shape + 1j * mode.imaginary, wanted) for mode in modes])
    planes = planes_of(modes)
    plane = planes[largest(np.array([np.linalg.norm(shares[plane]) for plane in planes]))]
    first = modes[int(plane[0])]
    size = float(np.linalg.norm(shares[plane]))
    if len(plane) == 1 or size == 0.0:
        return first
    shapes = np.array([modes[k].shape + 1j * modes[k].imaginary for k in plane])
    phi = shares[plane] @ shapes / size
    return replace(first, shape=phi.real.copy(), imaginary=phi.imag.copy())


def planes_of(modes: Sequence[LinearMode]) -> list[npt.NDArray[np.intp]]:
    """Places of the modes that share a frequency, of ascending ones."""
    omega = np.array([mode.omega for mode in modes])
    return np.split(np.arange(len(omega)), 1 + np.flatnonzero(np.abs(np.diff(omega)) > SAME * omega[1:]))
