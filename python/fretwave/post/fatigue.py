"""Stress and strain over a period, and Goodman's limit of endurance.

The stress amplitude is the largest von Mises stress of sigma(t) - mean over the period: half the range of ASME BPVC
VIII-2, 5.5.3 (von Mises stress of the difference of two instants), where the motion has odd harmonics alone, and not
below it otherwise. The mean stress is von Mises' of harmonic 0, with the sign of its trace (D. F. Socie and
G. B. Marquis, Multiaxial Fatigue, SAE 2000: signed von Mises). Goodman: sigma_a / sigma_e + sigma_m / sigma_u <= 1;
compression counts as no mean stress (Shigley's Mechanical Engineering Design, chapter on fatigue failure). Shear has
no trace: what a mesh leaves of one must not choose whether it counts, and it does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..arrays import Array
from .motion import waves

#: Instants of a period for each harmonic. A maximum between them is read off a parabola, which errs by about 1e-5 of
#: it; the largest sample alone would be short by (pi / 64)^2 at most, as trigonometric polynomials are.
INSTANTS = 64
#: Largest values that differ by less than this share, which the parabola may err by, are equal: those of the sectors
#: of a tuned wheel.
EQUAL = 2e-5
#: A trace above minus this share of von Mises' stress is that of shear: a twisted bar has up to 1e-3 by its mesh.
SHEAR = 0.01
#: Numbers of one block of places over the period.
BLOCK = 4_000_000


def doubts(table: Mapping[str, Iterable[object]]) -> list[str]:
    """Warnings in a table of gauges and stress, which stand in one of its rows."""
    return [str(text) for text in table.get("warning", ()) if isinstance(text, str) and text]


def von_mises_square(stress: Array) -> Array:
    """Square of von Mises' stress of stresses (n, 6, ...) in the order xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = np.moveaxis(stress, 1, 0)
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.asarray(normal / 2 + 3 * (xy**2 + xz**2 + yz**2))


def parts(labels: Sequence[str], coefficients: Array) -> tuple[Array, Array, list[str]]:
    """Harmonic 0 (n, ...) of coefficients (n, ..., m), zero where there is none, the others and their labels."""
    moving = [k for k, label in enumerate(labels) if label != "0"]
    still = coefficients[..., [k for k, label in enumerate(labels) if label == "0"]].sum(axis=-1)
    return still, coefficients[..., moving], [labels[k] for k in moving]


def instants(labels: Sequence[str]) -> Array:
    """Phases of a period that tell its extremes."""
    highest = max((int(label.rstrip("cs")) for label in labels), default=1)
    return np.asarray(2 * np.pi * np.arange(INSTANTS * highest) / (INSTANTS * highest))


def stress_amplitude(labels: Sequence[str], stress: Array) -> Array:
    """Largest von Mises stress (n,) over the period of stresses (n, 6, m) less their mean."""
    _, moving, names = parts(labels, stress)
    if not names:
        return np.zeros(len(stress))
    basis = waves(names, instants(names))
    size = max(1, BLOCK // (6 * len(basis)))
    blocks = [moving[k : k + size] @ basis.T for k in range(0, len(moving), size)]
    return np.asarray(np.sqrt(np.concatenate([highest(von_mises_square(block)) for block in blocks])))


def mean_stress(labels: Sequence[str], stress: Array) -> Array:
    """Von Mises stress (n,) of the mean of stresses (n, 6, m), negative where its trace is."""
    still, _, _ = parts(labels, stress)
    size = np.sqrt(von_mises_square(still))
    return np.asarray(np.where(still[:, :3].sum(axis=1) < -SHEAR * size, -size, size))


def swing(labels: Sequence[str], values: Array) -> tuple[Array, Array]:
    """Half of largest less least value (n,) over the period of (n, m), and their mean over time."""
    mean, moving, names = parts(labels, values)
    if not names:
        return np.zeros(len(values)), mean
    over = moving @ waves(names, instants(names)).T
    return (highest(over) + highest(-over)) / 2, mean


def highest(over: Array) -> Array:
    """Maximum (n,) of periodic functions at equal steps (n, n_samples), by the parabola through the largest three."""
    rows, top = np.arange(len(over)), over.argmax(axis=1)
    before, at, after = (over[rows, (top + step) % over.shape[1]] for step in (-1, 0, 1))
    bend = 2 * at - before - after
    return np.asarray(at + np.where(bend > 0, (after - before) ** 2 / (8 * np.where(bend > 0, bend, 1.0)), 0.0))


def goodman(amplitude: Array, mean: Array, endurance_limit: float, ultimate_strength: float) -> Array:
    """Goodman's factor, 1 at the limit; compression counts as no mean stress."""
    return np.asarray(amplitude / endurance_limit + np.maximum(mean, 0.0) / ultimate_strength)


def first_reaching(values: Array, limit: float, *columns: Array) -> tuple[float, ...] | None:
    """Columns where values along a branch first pass a limit from below, off straight lines; None where they do not."""
    rises = np.flatnonzero((values[:-1] < limit) & (values[1:] >= limit))
    if not len(rises):
        return None
    k = int(rises[0])
    share = (limit - values[k]) / (values[k + 1] - values[k])
    return tuple(float(column[k] + share * (column[k + 1] - column[k])) for column in columns)
