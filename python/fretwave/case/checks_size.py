"""What an analysis takes of memory at the least: known before anything is allocated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..hb.states import default_samples

if TYPE_CHECKING:
    from ..model.contact import Contact
    from .facts import Facts

NUMBER = 8  #: bytes
#: Vectors of all coefficients at once, at the very least: point, tangent, residual, predictor and those of SNES.
VECTORS = 8
#: Time samples of a pair: displacement, velocity and force.
SERIES = 3


def harmonic_memory(harmonics: int, samples: int | None, copies: int, facts: Facts) -> dict[str, float]:
    """Least memory [bytes] of harmonic balance by the key that asks for it, and what it is for.

    Parameters
    ----------
    copies : sectors that are solved
    """
    n_dof, columns = facts.least_dofs, contact_columns(facts.contacts)
    count = samples or default_samples(harmonics)
    return {
        f"harmonics: {VECTORS} vectors of {n_dof * copies} dofs": float(NUMBER) * VECTORS * n_dof * copies * harmonics,
        f"{'samples' if samples else 'harmonics'}: {count} samples of {columns * copies} contact motions": (
            float(NUMBER) * SERIES * columns * copies * count
        ),
    }


def contact_columns(contacts: Sequence[Contact]) -> int:
    """Relative motions of all pairs."""
    return sum(contact.n_pairs * contact.components for contact in contacts)
