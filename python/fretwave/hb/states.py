"""What the scalar unknowns of a problem mean: frequency, damping, amplitude. Plain numbers, no PETSc.

The scalars of unknowns y are linear in y: the problem's own (frequency, ...), then the fundamental's coefficients
(c, s) of the chosen dof, scaled. Whoever has them has the state, of a point as of what lies between two points.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Union

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..columns import SOURCES

#: A smaller damping ratio is known accurately enough when it is known to a share of this one.
ZETA_FLOOR = 1e-4
#: Where a mode's damping is steep over the amplitude, its point may be off by 1 / STRICT of the accuracy.
STRICT = 10.0
#: Of a resonance, relative to its frequency: a response's frequency is known accurately when to a share of this.
BANDWIDTH = 0.01


def default_samples(highest: int) -> int:
    """Time samples of a period where none are given: the power of two from 16 `highest` up, 64 at least."""
    return max(64, 1 << (16 * highest - 1).bit_length())


class _Columns(ABC):
    """Columns of scalars."""

    def __call__(self, z: npt.ArrayLike) -> dict[str, float]:
        """The columns of these scalars."""
        return {name: float(value) for name, value in self.table(np.asarray(z, dtype=float)).items()}

    @abstractmethod
    def table(self, z: Array) -> dict[str, Array]:
        """The same of many states (..., 3) at once."""


@dataclass(frozen=True)
class ModalState(_Columns):
    """Scalars (beta / w_ref, w / w_ref, log a, ...) of a nonlinear mode; w = w0 for EPMC.

    lambda = -beta + i omega, omega0 = |lambda|, zeta = beta / omega0 (Laxalde et al. 2008, eq. 1).

    Examples
    --------
    >>> ModalState("CNM", 10.0)([0.3, 0.4, 0.0])["zeta"]
    0.6
    """

    kind: ClassVar[str] = "mode"
    #: The continuation parameter as users call it.
    parameter: ClassVar[str] = "amplitude"
    columns: ClassVar[tuple[str, ...]] = ("amplitude", "omega", "omega0", "frequency_hz", "beta", "zeta")
    #: The scalars by name, in physical units [1/s, rad/s, 1] as `factors` gives them.
    scalars: ClassVar[tuple[str, ...]] = ("beta", "w", "log_amplitude")
    #: Columns of the error of lambda by all sources, and by one.
    error: ClassVar[str] = "omega_error"
    error_by: ClassVar[str] = "lambda_error_{}"
    method: str
    omega_reference: float = 1.0

    @property
    def factors(self) -> Array:
        """That bring the scalars to physical units (3,)."""
        return np.array([self.omega_reference, self.omega_reference, 1.0])

    def scalars_of(self, table: Mapping[str, Any]) -> Array:
        """The inverse in physical units (n, 3), from columns of n states."""
        w = table["omega0" if self.method == "EPMC" else "omega"]
        return np.column_stack([table["beta"], w, np.log(table["amplitude"])])

    def errors(self, z: Array, changes: Sequence[Array]) -> dict[str, float]:
        """Errors of these scalars in columns, from their changes by all sources and by each of `SOURCES`.

        Of the complex eigenvalue by source [1/s]; of omega and zeta those of its modulus, |d omega| <= |d lambda| and
        |d zeta| <= |d lambda| / omega0, for an error of zeta by itself changes its sign along a branch. Where EPMC's
        zeta is 1 or more lambda says nothing of w, and |d zeta| <= (|d beta| + zeta |d w|) / w.
        """
        here = self.eigenvalue(z)
        # NumPy's: Python 3.11's own abs of nan overflows where something before it has set errno
        error, *parts = (float(np.abs(self.eigenvalue(z + change) - here)) for change in changes)
        own = {self.error_by.format(source): part for source, part in zip(SOURCES, parts)}
        of_zeta = self._creeping(z, changes[0]) if self.method == "EPMC" and not here.imag else error
        size = float(self._oscillation(z)[2])
        return {"omega_error": error, "zeta_error": of_zeta / size if size else math.nan, **own}

    def _creeping(self, z: Array, change: Array) -> float:
        """Error of zeta times w [1/s] where the free motion does not oscillate."""
        d_beta, d_w = np.abs(np.asarray(change, dtype=float)[:2]) * self.omega_reference
        return float(d_beta + np.abs(self._oscillation(z)[3]) * d_w)

    def relative(self, z: Array) -> Array:
        """That takes a change of the scalars to its relative size: amplitude (times `STRICT`), lambda over zeta omega0.

        (3, 3). So it is what an accuracy of the damping, and of the frequency with it, is judged by. A zeta below
        `ZETA_FLOOR` is measured in that, for it begins at zero where slip does.
        """
        beta, omega, omega0, zeta = self._oscillation(z)
        size = omega0 * min(max(abs(zeta), ZETA_FLOOR), 1.0) / self.omega_reference
        # omega^2 = w^2 - beta^2 for EPMC, above zeta = 1 it is zero and w stands for itself
        by_beta, by_w = (-beta / omega, omega0 / omega) if self.method == "EPMC" and omega else (0.0, 1.0)
        return np.array([[0.0, 0.0, STRICT], [-1.0 / size, 0.0, 0.0], [by_beta / size, by_w / size, 0.0]])

    def eigenvalue(self, z: npt.ArrayLike) -> complex:
        """lambda = -beta + i omega [1/s]."""
        beta, omega, _, _ = self._oscillation(z)
        return complex(-beta, omega)

    def table(self, z: Array) -> dict[str, Array]:
        beta, omega, omega0, zeta = self._oscillation(z)
        return dict(zip(self.columns, (np.exp(z[..., 2]), omega, omega0, omega / (2 * math.pi), beta, zeta)))

    def _oscillation(self, z: npt.ArrayLike) -> tuple[Any, Any, Any, Any]:
        """beta, omega, omega0 [1/s] and zeta, whatever the amplitude."""
        beta, w = (np.asarray(z, dtype=float)[..., k] * self.omega_reference for k in (0, 1))
        if self.method == "EPMC":
            zeta = beta / w
            # above 1 the free motion creeps back: its frequency is zero
            return beta, w * np.sqrt(np.maximum(0.0, (1 - zeta) * (1 + zeta))), w, zeta
        omega0 = np.hypot(beta, w)
        return beta, w, omega0, beta / omega0


@dataclass(frozen=True)
class ForcedState(_Columns):
    """Scalars (w / w_ref, c, s, ...) of a forced response, x = a_ref (c cos w t + s sin w t) = A cos(w t + phase)."""

    kind: ClassVar[str] = "forced"
    parameter: ClassVar[str] = "omega"
    columns: ClassVar[tuple[str, ...]] = ("level", "omega", "frequency_hz", "amplitude", "phase")
    scalars: ClassVar[tuple[str, ...]] = ("omega", "cosine", "sine")
    #: Columns of the error of the complex amplitude by all sources, and by one.
    error: ClassVar[str] = "amplitude_error"
    error_by: ClassVar[str] = "amplitude_error_{}"
    level: float
    omega_reference: float = 1.0
    amplitude_reference: float = 1.0

    @property
    def factors(self) -> Array:
        """That bring the scalars to physical units [rad/s, length, length] (3,)."""
        return np.array([self.omega_reference, self.amplitude_reference, self.amplitude_reference])

    def scalars_of(self, table: Mapping[str, Any]) -> Array:
        """The inverse in physical units (n, 3), from columns of n states."""
        amplitude, phase = np.asarray(table["amplitude"]), np.asarray(table["phase"])
        return np.column_stack([table["omega"], amplitude * np.cos(phase), -amplitude * np.sin(phase)])

    def errors(self, z: Array, changes: Sequence[Array]) -> dict[str, float]:
        """Errors of the complex amplitude [length] in columns, from changes of the scalars by all sources and each."""
        error, *parts = (self.amplitude_reference * math.hypot(change[1], change[2]) for change in changes)
        return {self.error: error, **{self.error_by.format(name): part for name, part in zip(SOURCES, parts)}}

    def relative(self, z: Array) -> Array:
        """That takes a change of the scalars to its relative size: frequency over `BANDWIDTH`, and amplitude (3, 3)."""
        size = np.hypot(*z[1:3])
        return np.diag([1.0 / (BANDWIDTH * z[0]), 1.0 / size, 1.0 / size])

    def table(self, z: Array) -> dict[str, Array]:
        omega = z[..., 0] * self.omega_reference
        cosine, sine = (z[..., k] * self.amplitude_reference for k in (1, 2))
        level, amplitude, phase = np.full_like(omega, self.level), np.hypot(cosine, sine), np.arctan2(-sine, cosine)
        return dict(zip(self.columns, (level, omega, omega / (2 * math.pi), amplitude, phase)))


State = Union[ModalState, ForcedState]


@dataclass(frozen=True)
class Estimate:
    """Errors of a point: changes of its scalars at the same parameter by all sources and by each of `SOURCES`.

    Attributes
    ----------
    z, along : scalars of the point, and of its branch's unit tangent
    """

    meaning: State
    z: Array
    along: Array
    changes: list[Array]

    @classmethod
    def none(cls, meaning: State) -> Estimate:
        """Nothing is known."""
        unknown = np.full(3, np.nan)
        return cls(meaning, unknown, unknown, [unknown] * (1 + len(SOURCES)))

    @property
    def columns(self) -> dict[str, float]:
        """As a table has them."""
        return self.meaning.errors(self.z, self.changes)

    def distances(self) -> dict[str, float]:
        """Relative distance of the point from the true branch, by "all" sources and by each.

        Along the branch a change is none: where it is steep, at a fold, nothing lies at the same parameter.
        """
        sized = self.meaning.relative(self.z)
        v, found = sized @ self.along[:3], np.array([change[:3] for change in self.changes]) @ sized.T
        aside = found - np.outer(found @ v / (v @ v), v)
        return dict(zip(("all", *SOURCES), np.linalg.norm(aside, axis=1).tolist()))


def described(state: State) -> dict[str, Any]:
    """The state's kind and numbers, from which `state_of` makes it again."""
    return {"kind": state.kind, **asdict(state)}


def state_of(description: dict[str, Any]) -> State:
    """The inverse of `described`."""
    given = dict(description)
    return ModalState(**given) if given.pop("kind") == ModalState.kind else ForcedState(**given)
