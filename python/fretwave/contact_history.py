"""Status, gap and work of contact pairs over a period, from the samples that results.h5 keeps of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

STICK, SLIP, OPEN = 0, 1, 2
#: A sample slips when its tangential force is this near to the limit, as in the laws' own diagnosis (src/contact).
AT_LIMIT = 1e-12


@dataclass(frozen=True)
class ContactHistory:
    """Samples of one contact over one period.

    Attributes
    ----------
    law : name of the law
    parameters : of the law as it acted, numbers or (n_pairs,)
    u, v, f : (n_samples, components, n_pairs)
        Relative displacement [m] and velocity [m/s], and force [N]; with three components the first is normal.
    """

    law: str
    parameters: Mapping[str, Any]
    u: Array
    v: Array
    f: Array

    @property
    def n_pairs(self) -> int:
        return int(self.f.shape[2])

    @property
    def is_3d(self) -> bool:
        return bool(self.f.shape[1] == 3)

    def delayed(self, samples: int) -> ContactHistory:
        """The same motion so many samples later."""
        u, v, f = (np.roll(values, samples, axis=0) for values in (self.u, self.v, self.f))
        return replace(self, u=u, v=v, f=f)

    def of_pairs(self, pairs: slice) -> ContactHistory:
        """Of some pairs alone."""
        return replace(self, u=self.u[..., pairs], v=self.v[..., pairs], f=self.f[..., pairs])

    @property
    def normal_force(self) -> Array:
        """(n_samples, n_pairs) [N], > 0 compressive; nan for a law without one."""
        return self.f[:, 0] if self.is_3d else np.full_like(self.f[:, 0], np.nan)

    @property
    def tangential_force(self) -> Array:
        """(n_samples, n_pairs) [N], its magnitude."""
        return np.asarray(np.hypot(self.f[:, 1], self.f[:, 2]) if self.is_3d else np.abs(self.f[:, 0]))

    @property
    def gap(self) -> Array:
        """(n_samples, n_pairs) [m]: distance to contact where open; nan for a law without one.

        The law's N = max(0, N0 + kn (u_n - gap)), solved for the missing approach (src/contact/coulomb_3d.h).
        """
        if not self.is_3d:
            return np.full_like(self.f[:, 0], np.nan)
        distance = self._value("gap") - self.u[:, 0] - self._value("normal_load") / self._value("normal_stiffness")
        return np.where(self.f[:, 0] > 0, 0.0, np.maximum(distance, 0.0))

    @property
    def status(self) -> npt.NDArray[np.int8] | None:
        """(n_samples, n_pairs): stick 0, slip 1, open 2, as the law counts them; None for an unknown law."""
        rule = {
            "coulomb_3d": self._slips_within(np.hypot),
            "coulomb_3d_uncoupled": self._slips_within(lambda a, b: np.maximum(np.abs(a), np.abs(b))),
            "jenkins": lambda: np.abs(self.f[:, 0]) >= (1 - AT_LIMIT) * self._value("friction_limit"),
            "regularised_coulomb": lambda: np.abs(self.v[:, 0]) > 2 * self._value("regularisation_velocity"),
        }.get(self.law)
        if rule is None:
            return None
        is_open = (self.f[:, 0] <= 0) & self.is_3d
        return np.where(is_open, OPEN, np.where(rule(), SLIP, STICK)).astype(np.int8)

    def _slips_within(self, size: Any) -> Any:
        def rule() -> Any:
            limit = self._value("friction_coefficient") * self.f[:, 0]
            return size(self.f[:, 1], self.f[:, 2]) >= (1 - AT_LIMIT) * limit

        return rule

    def share(self, status: int) -> Array:
        """(n_pairs,): share of the period in a status."""
        return np.asarray(np.mean(self.status == status, axis=0))

    @property
    def work(self) -> Array:
        """(n_pairs,) [J]: work done against the force over the period, that is, dissipated.

        The integral of f . du with the exact derivative of the sampled u, which has finitely many harmonics: the sum
        over all pairs is then in exact balance with the harmonic equations.
        """
        n = len(self.u)
        orders = np.arange(n // 2 + 1)[:, None, None]
        slope = np.fft.irfft(1j * orders * np.fft.rfft(self.u, axis=0), n, axis=0)
        return np.asarray((self.f * slope).sum(axis=(0, 1)) * 2 * np.pi / n)

    def _value(self, name: str) -> Any:
        return np.broadcast_to(np.asarray(self.parameters.get(name, 0.0), dtype=float), (self.n_pairs,))
