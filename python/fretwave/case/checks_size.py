"""What an analysis takes of memory at the least, and what the machine has: known before anything is allocated."""

from __future__ import annotations

import contextlib
import os
import resource
from collections.abc import Sequence
from pathlib import Path
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
CGROUP = Path("/sys/fs/cgroup/memory.max")


def machine_memory() -> float:
    """What a process can have at most [bytes]: of the machine, of its container, of its limits."""
    found = [float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")]
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY:
        found.append(float(limit))
    with contextlib.suppress(OSError, ValueError):  # "max", or no such container
        found.append(float(CGROUP.read_text(encoding="ascii")))
    return min(found)


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


def size(count: float) -> str:
    """Bytes in the unit that suits them."""
    units = ("B", "kB", "MB", "GB", "TB", "PB", "EB", "ZB", "YB")
    power = 0
    while count >= 1000 and power < len(units) - 1:
        count, power = count / 1000, power + 1
    return f"{count:.3g} {units[power]}"
