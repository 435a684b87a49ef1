"""What a run of a study found, and how its errors are measured: of a mode, of a forced response."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Union

import numpy as np

from ..arrays import Array, Complex, Indices
from ..hb.states import ZETA_FLOOR
from ..post.mode_curve import without_rounding


@dataclass(frozen=True)
class Outcome:
    """A mode's branch.

    Attributes
    ----------
    amplitude, omega, zeta : (n,) at the reported points, in the order of the branch
    estimate : (n, 4) estimated errors of lambda there [1/s], by `SOURCES`
    peak_zeta, peak_amplitude : largest damping ratio and where it is
    wall_s : time of the whole branch [s]
    harmonics, samples : the most that it took, where it has chosen them
    cpu_s : time of the processor [s], which other work on the machine disturbs least
    """

    amplitude: Array
    omega: Array
    zeta: Array
    estimate: Array
    peak_zeta: float
    peak_amplitude: float
    points: int
    newton: int
    wall_s: float
    harmonics: int = 0
    samples: int = 0
    cpu_s: float = float("nan")

    @property
    def parameter(self) -> Array:
        """Over which runs are compared (n,)."""
        return self.amplitude

    @property
    def value(self) -> Complex:
        """lambda = -beta + i omega [1/s] of damped frequencies (n,)."""
        return np.asarray(self.omega * (1j - self.zeta / np.sqrt(1 - self.zeta**2)))

    @property
    def unit(self) -> float:
        """In which errors of single points are told [1/s]."""
        return 1.0

    @property
    def summary(self) -> str:
        """In words."""
        return f"peak zeta {100 * self.peak_zeta:.4f} % at {self.peak_amplitude:.4g}"

    def allowed(self, rows: Indices) -> Array:
        """Error of the value that an accuracy of 1 allows."""
        true = self.value[rows]
        return np.maximum(-true.real, ZETA_FLOOR * np.abs(true))

    def errors(self, true: Outcome, rows: Indices, its: Indices, estimate: Array) -> Mapping[str, float]:
        """Columns of these rows against another run's, with what is estimated of them (m,).

        Of damping they are over its peak; as they are where that is none, as of a mode that never slips.
        """
        peak = abs(without_rounding(true.peak_zeta)) or 1.0
        return {
            "omega_error": _largest(np.abs(self.omega[rows] / true.omega[its] - 1.0)),
            "zeta_error": _largest(np.abs(self.zeta[rows] - true.zeta[its])) / peak,
            "peak_zeta": self.peak_zeta,
            "peak_amplitude": self.peak_amplitude,
            "peak_zeta_error": abs(self.peak_zeta - true.peak_zeta) / peak,
            "zeta_error_estimate": _largest(estimate / true.omega[its]) / peak,
        }


@dataclass(frozen=True)
class ResponseOutcome:
    """A forced response's branch.

    Attributes
    ----------
    omega : (n,) frequencies [rad/s] of the reported points, in the order of the branch
    cosine, sine : (n,) parts of the observed fundamental there [length]
    estimate : (n, 4) estimated errors of the complex amplitude there [length], by `SOURCES`
    peak, peak_omega : largest amplitude [length] and where it is
    wall_s, harmonics, samples, cpu_s : as of a mode
    """

    omega: Array
    cosine: Array
    sine: Array
    estimate: Array
    peak: float
    peak_omega: float
    points: int
    newton: int
    wall_s: float
    harmonics: int = 0
    samples: int = 0
    cpu_s: float = float("nan")

    @property
    def parameter(self) -> Array:
        """Over which runs are compared (n,)."""
        return self.omega

    @property
    def value(self) -> Complex:
        """Complex amplitude [length] (n,)."""
        return np.asarray(self.cosine) - 1j * np.asarray(self.sine)

    @property
    def unit(self) -> float:
        """In which errors of single points are told: the largest amplitude [length]."""
        return self.peak

    @property
    def summary(self) -> str:
        """In words."""
        return f"peak {self.peak:.4g} at {self.peak_omega / (2 * np.pi):.5g} Hz"

    def allowed(self, rows: Indices) -> Array:
        """Error of the value that an accuracy of 1 allows."""
        return np.asarray(np.abs(self.value[rows]))

    def errors(self, true: ResponseOutcome, rows: Indices, its: Indices, estimate: Array) -> Mapping[str, float]:
        """Columns of these rows against another run's, with what is estimated of them (m,)."""
        return {
            "amplitude_error": _largest(np.abs(self.value[rows] - true.value[its])) / true.peak,
            "peak_amplitude": self.peak,
            "peak_frequency_hz": self.peak_omega / (2 * np.pi),
            "peak_amplitude_error": abs(self.peak / true.peak - 1.0),
            "amplitude_error_estimate": _largest(estimate) / true.peak,
        }


AnyOutcome = Union[Outcome, ResponseOutcome]


def _largest(values: Array) -> float:
    return float(values.max()) if len(values) else float("nan")
