"""Refuse an analysis that cannot fit into the memory of the machine, before anything of it is allocated."""

from __future__ import annotations

import contextlib
import os
import resource
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..model.contact import Contact
from .reporter import Found, Reporter
from .schema import AnalysisSection, HarmonicSection, TransientSection, WearAnalysis
from .toml.source import Source

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


def check_sizes(
    source: Source,
    analyses: Mapping[int, AnalysisSection],
    n_dof: int,
    contacts: Sequence[Contact],
    sectors: int,
    found: Found,
) -> None:
    """Every analysis fits into memory by the least that it can need.

    Parameters
    ----------
    n_dof : of the model that is solved, at least
    sectors : of the wheel, 1 for a whole structure
    """
    available = machine_memory()
    columns = sum(contact.n_pairs * contact.components for contact in contacts)
    for number, analysis in analyses.items():
        parts = _parts(analysis, n_dof, columns, sectors)
        least = sum(parts.values())
        if least > available:
            key, shown = max(parts.items(), key=lambda part: part[1])[0].split(": ", 1)
            Reporter(source, ("analysis", number), found).wrong(
                (key,),
                f"takes at least {size(least)} of memory: {shown}",
                f"at most the {size(available)} of this machine",
                "lower it, or take a machine with more memory",
            )


def _parts(analysis: AnalysisSection, n_dof: int, columns: int, sectors: int) -> dict[str, float]:
    """Least memory [bytes] by the key that asks for it, and what it is for."""
    if isinstance(analysis, TransientSection):
        count = analysis.periods * analysis.samples_per_period
        return {f"periods: {count} samples of {n_dof} dofs": 2.0 * NUMBER * n_dof * count}
    if not isinstance(analysis, (HarmonicSection, WearAnalysis)) or not analysis.harmonics:
        return {}
    copies = sectors if getattr(analysis, "wheel", False) else 1
    harmonics = analysis.harmonics
    samples = analysis.samples or max(64, 1 << (16 * harmonics - 1).bit_length())
    return {
        f"harmonics: {VECTORS} vectors of {n_dof * copies} dofs": float(NUMBER) * VECTORS * n_dof * copies * harmonics,
        f"{'samples' if analysis.samples else 'harmonics'}: {samples} samples of {columns * copies} contact motions": (
            float(NUMBER) * SERIES * columns * copies * samples
        ),
    }


def size(count: float) -> str:
    """Bytes in the unit that suits them."""
    units = ("B", "kB", "MB", "GB", "TB", "PB", "EB", "ZB", "YB")
    power = 0
    while count >= 1000 and power < len(units) - 1:
        count, power = count / 1000, power + 1
    return f"{count:.3g} {units[power]}"
