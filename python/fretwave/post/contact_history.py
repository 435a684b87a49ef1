"""Status, gap and work of contact pairs over a period: what the law said of each sample, as results.h5 keeps it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..model.law_info import OPEN, SLIP, STICK, UNKNOWN

States = npt.NDArray[np.int8]
Change = Callable[[npt.NDArray[Any]], npt.NDArray[Any]]

#: What is kept of a contact's period, by name: unit (of the quantity), long name, type, value of rows that lack it.
MOTION: Mapping[str, tuple[str, str, str, float]] = {
    "u": ("length", "relative displacement over one period", "f8", 0),
    "v": ("length/s", "relative velocity over one period", "f8", 0),
    "f": ("force", "contact force over one period", "f8", 0),
    "status": ("1", "status over one period: stick 0, slip 1, open 2, not kept -1", "i1", UNKNOWN),
    "gap": ("length", "distance to contact over one period, 0 where closed", "f8", np.nan),
    "work": ("energy", "energy dissipated in one period", "f8", np.nan),
    "shares": ("1", "of the period in stick, slip and open", "f8", np.nan),
}
SAMPLED, BY_PAIR = ("sample", "component", "pair"), ("sample", "pair")
#: Its axes.
AXES: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys("uvf", SAMPLED),
    **dict.fromkeys(("status", "gap"), BY_PAIR),
    "work": ("pair",),
    "shares": ("state", "pair"),
}
#: Of those the ones that are not of samples: what is measured of the whole period.
MEASURED = ("work", "shares")


@dataclass(frozen=True)
class ContactHistory:
    """Samples of one contact over one period.

    Attributes
    ----------
    u, v, f : (n_samples, components, n_pairs)
        Relative displacement [length] and velocity [length/s], and force [force].
    kept_status, kept_gap : (n_samples, n_pairs), optional
        As the law told them; None where they are not kept.
    normal : int or None
        Component along the normal, > 0 closing.
    kept_work, kept_shares : (n_pairs,) [energy] and (3, n_pairs), optional
        As measured of the whole period, not of its samples; None in results of an earlier version.
    """

    u: Array
    v: Array
    f: Array
    kept_status: States | None = None
    kept_gap: Array | None = None
    normal: int | None = None
    kept_work: Array | None = None
    kept_shares: Array | None = None

    @classmethod
    def of(cls, motion: Mapping[str, Any], normal: int | None) -> ContactHistory:
        """From what is kept of a period, by the names of `MOTION`."""
        told = (motion.get(name) for name in ("work", "shares"))
        return cls(motion["u"], motion["v"], motion["f"], motion.get("status"), motion.get("gap"), normal, *told)

    @property
    def n_pairs(self) -> int:
        return int(self.f.shape[2])

    def delayed(self, samples: int) -> ContactHistory:
        """The same motion so many samples later."""
        return self._each(lambda values: np.roll(values, samples, axis=0), lambda measured: measured)

    def of_pairs(self, pairs: slice) -> ContactHistory:
        """Of some pairs alone."""
        return self._each(lambda values: values[..., pairs], lambda measured: measured[..., pairs])

    def _each(self, change: Change, change_measured: Change) -> ContactHistory:
        def told(change: Change, kept: npt.NDArray[Any] | None) -> npt.NDArray[Any] | None:
            return None if kept is None else change(kept)

        return replace(
            self,
            u=change(self.u),
            v=change(self.v),
            f=change(self.f),
            kept_status=told(change, self.kept_status),
            kept_gap=told(change, self.kept_gap),
            kept_work=told(change_measured, self.kept_work),
            kept_shares=told(change_measured, self.kept_shares),
        )

    @property
    def normal_force(self) -> Array:
        """(n_samples, n_pairs) [force], > 0 compressive; nan for a law without one."""
        return normal_force(self.f, self.normal)

    @property
    def tangential_force(self) -> Array:
        """(n_samples, n_pairs) [force], its magnitude."""
        return tangential_force(self.f, self.normal)

    @property
    def gap(self) -> Array:
        """(n_samples, n_pairs) [length]: distance to contact, 0 where closed; nan for a law without one."""
        return np.full_like(self.f[:, 0], np.nan) if self.kept_gap is None else self.kept_gap

    @property
    def status(self) -> States | None:
        """(n_samples, n_pairs): stick 0, slip 1, open 2; None where it is not kept of all samples."""
        known = self.kept_status is not None and not np.any(self.kept_status == UNKNOWN)
        return self.kept_status if known else None

    def share(self, status: int) -> Array:
        """(n_pairs,): share of the period in a status."""
        return np.asarray(
            np.mean(self.status == status, axis=0) if self.kept_shares is None else self.kept_shares[status]
        )

    @property
    def work(self) -> Array:
        """(n_pairs,) [energy]: work done against the force over the period, that is, dissipated.

        As measured, or the integral of f . du with the exact derivative of the sampled u, which has finitely many
        harmonics: the sum over all pairs is then in balance with the harmonic equations.
        """
        if self.kept_work is not None:
            return self.kept_work
        n = len(self.u)
        orders = np.arange(n // 2 + 1)[:, None, None]
        slope = np.fft.irfft(1j * orders * np.fft.rfft(self.u, axis=0), n, axis=0)
        return np.asarray((self.f * slope).sum(axis=(0, 1)) * 2 * np.pi / n)


def normal_force(f: Array, normal: int | None) -> Array:
    """(..., n_pairs) of forces (..., components, n_pairs), > 0 compressive; nan without a normal direction."""
    return np.full_like(f[..., 0, :], np.nan) if normal is None else f[..., normal, :]


def tangential_force(f: Array, normal: int | None) -> Array:
    """(..., n_pairs) of forces (..., components, n_pairs): its magnitude, zero of a law without tangents."""
    parts = [f[..., row, :] for row in range(f.shape[-2]) if row != normal]
    return np.asarray(reduce(np.hypot, parts, np.zeros_like(f[..., 0, :])))


__all__ = ["AXES", "MEASURED", "MOTION", "OPEN", "SLIP", "STICK", "ContactHistory", "normal_force", "tangential_force"]
