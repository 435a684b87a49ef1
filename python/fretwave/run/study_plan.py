"""What a study runs and how its errors are measured; knows neither cases nor solvers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..arrays import Array, Complex, Indices
from ..columns import SOURCES
from ..hb.states import ZETA_FLOOR, default_samples
from ..post.calibration import FACTORS, share_within
from ..solve.accuracy import TOLERATED

#: a reported point belongs to an amplitude when it is this near; a loose Newton tolerance lets it miss by about itself
MATCH = 1e-2
#: What a sweep's runs differ by from the finest
SOURCE_OF = {"harmonics": "harmonics", "samples": "samples", "tolerance": "solver"}


@dataclass(frozen=True)
class Settings:
    """Numerical settings of one run; `tolerance` is the norm of the dimensionless residual at which Newton stops.

    `component_modes` of a reduced model, None for the model as the case has it. With an `accuracy` the run
    chooses its harmonics and samples.
    """

    harmonics: int
    samples: int
    tolerance: float
    component_modes: int | None = None
    accuracy: float | None = None

    def possible(self) -> bool:
        """At least two samples per period of the highest harmonic."""
        return self.samples > 2 * self.harmonics


@dataclass(frozen=True)
class Outcome:
    """What one run found.

    Attributes
    ----------
    amplitude, omega, zeta : (n,) at the reported points, in the order of the branch
    estimate : (n, 3) estimated errors of lambda there [1/s], by `SOURCES`
    peak_zeta, peak_amplitude : largest damping ratio and where it is
    wall_s : time of the whole branch [s]
    harmonics, samples : the most that it took, where it has chosen them
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


@dataclass(frozen=True)
class Plan:
    """Sweeps of one setting at a time, the others at their finest: the common reference is the finest of all.

    Beside accuracies that a run is asked for stand runs of each number of harmonics with its default samples: what they
    are held against is the quickest of all runs with a fixed set that is as accurate.
    """

    harmonics: Sequence[int] = (1, 3, 7, 21, 41)
    samples: Sequence[int] = (64, 128, 256, 512, 1024, 2048)
    tolerance: Sequence[float] = (1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
    component_modes: Sequence[int] = ()
    accuracy: Sequence[float] = ()

    @property
    def reference(self) -> Settings:
        """The finest settings."""
        most = max(self.component_modes) if self.component_modes else None
        return Settings(max(self.harmonics), max(self.samples), min(self.tolerance), most)

    def sweeps(self) -> list[tuple[str, Settings]]:
        """(name of the swept setting, settings) of every row of the table, coarse to fine."""
        finest = self.reference
        values: dict[str, Sequence[Any]] = {"harmonics": sorted(self.harmonics), "samples": sorted(self.samples)}
        values |= {"tolerance": sorted(self.tolerance)[::-1], "component_modes": sorted(self.component_modes)}
        values |= {"accuracy": sorted(self.accuracy)[::-1]}
        rows = [(name, replace(finest, **{name: value})) for name, swept in values.items() for value in swept]
        if self.accuracy:
            sets = [(highest, default_samples(highest)) for highest in sorted(self.harmonics)]
            rows += [("set", replace(finest, harmonics=highest, samples=count)) for highest, count in sets]
        return [(name, settings) for name, settings in rows if settings.possible()]


@dataclass
class Study:
    """Outcomes of a plan and the table made of them.

    Attributes
    ----------
    amplitudes : at which runs are compared
    left_out : amplitudes of these at which some run has several solutions (between two folds) or none
    failures : settings that found no whole branch, and why
    """

    plan: Plan
    amplitudes: Array
    outcomes: dict[Settings, Outcome] = field(default_factory=dict)
    failures: dict[Settings, str] = field(default_factory=dict)

    def run(self, solve: Callable[[Settings], Outcome | str], report: Callable[[str, Settings], None]) -> None:
        """Solve every setting once; `solve` returns the reason as text when there is no whole branch."""
        for sweep, settings in self.plan.sweeps():
            if settings in self.outcomes or settings in self.failures:
                continue
            found = solve(settings)
            if isinstance(found, str):
                self.failures[settings] = found
            else:
                self.outcomes[settings] = found
            report(sweep, settings)

    @property
    def left_out(self) -> Array:
        """Amplitudes that cannot be compared: a run meets them several times, or never."""
        return np.array([a for a in self.amplitudes if a not in self.compared])

    @property
    def compared(self) -> Array:
        """Amplitudes that every run meets exactly once."""
        met = [[len(_at(run, a)) == 1 for a in self.amplitudes] for run in self.outcomes.values()]
        return self.amplitudes[np.all(met, axis=0)] if met else self.amplitudes[:0]

    def table(self) -> list[dict[str, float | int | str]]:
        """One row per run and sweep; empty when the reference itself failed."""
        reference = self.outcomes.get(self.plan.reference)
        if reference is None:
            return []
        rows = self.plan.sweeps()
        return [self._row(sweep, settings, reference) for sweep, settings in rows if settings in self.outcomes]

    def _row(self, sweep: str, settings: Settings, reference: Outcome) -> dict[str, float | int | str]:
        run = self.outcomes[settings]
        omega, zeta, estimate = _values(run, self.compared)
        omega_true, zeta_true, _ = _values(reference, self.compared)
        source = self._source(sweep, settings)
        guessed = estimate.sum(axis=1) if source is None else estimate[:, source]
        ratios = self._ratios(sweep, settings, reference)
        known, true = (np.array([row[name] for row in ratios]) for name in ("estimate", "error"))
        return {
            "sweep": sweep,
            "harmonics": run.harmonics or settings.harmonics,
            "samples": run.samples or settings.samples,
            "tolerance": settings.tolerance,
            "points": run.points,
            "newton": run.newton,
            "wall_s": run.wall_s,
            "omega_error": _largest(np.abs(omega / omega_true - 1.0)),
            "zeta_error": _largest(np.abs(zeta - zeta_true)) / abs(reference.peak_zeta),
            "peak_zeta": run.peak_zeta,
            "peak_amplitude": run.peak_amplitude,
            "peak_zeta_error": abs(run.peak_zeta / reference.peak_zeta - 1.0),
            "zeta_error_estimate": _largest(guessed / omega_true) / abs(reference.peak_zeta),
            **{f"within_{factor}": share_within(known, true, factor) for factor in FACTORS},
            "component_modes": -1 if settings.component_modes is None else settings.component_modes,
            "accuracy": math.nan if settings.accuracy is None else settings.accuracy,
            "kept": math.nan if settings.accuracy is None else self._kept(settings, settings.accuracy),
            "best_fixed_s": math.nan if settings.accuracy is None else self._best_fixed(settings.accuracy),
            "reference": int(settings == self.plan.reference),
        }

    def _kept(self, settings: Settings, accuracy: float) -> float:
        """Share of the amplitudes at which a run is as accurate, in lambda over zeta omega0."""
        omega, zeta, _ = _values(self.outcomes[settings], self.compared)
        true = _eigenvalue(*_values(self.outcomes[self.plan.reference], self.compared)[:2])
        allowed = accuracy * np.maximum(-true.real, ZETA_FLOOR * np.abs(true))
        return float(np.mean(np.abs(_eigenvalue(omega, zeta) - true) <= allowed)) if len(true) else math.nan

    def _best_fixed(self, accuracy: float) -> float:
        """Time [s] of the quickest run of one set that keeps an accuracy at 95 % of the amplitudes; nan without any."""
        fixed = [settings for settings in self.outcomes if settings.accuracy is None]
        times = [self.outcomes[s].wall_s for s in fixed if self._kept(s, accuracy) >= 1 - TOLERATED]
        return min(times, default=math.nan)

    def calibration(self) -> list[dict[str, Any]]:
        """Estimated and true error of lambda [1/s] by run and amplitude, of the source that the sweep is over.

        What the others add is the same in a run and in the finest, to which it is compared.
        """
        reference = self.outcomes.get(self.plan.reference)
        known = [(sweep, settings) for sweep, settings in self.plan.sweeps() if settings in self.outcomes]
        if reference is None:
            return []
        return [row for sweep, settings in known for row in self._ratios(sweep, settings, reference)]

    def _ratios(self, sweep: str, settings: Settings, reference: Outcome) -> list[dict[str, Any]]:
        source = self._source(sweep, settings)
        if source is None:
            return []
        omega, zeta, estimate = _values(self.outcomes[settings], self.compared)
        omega_true, zeta_true, _ = _values(reference, self.compared)
        error = np.abs(_eigenvalue(omega, zeta) - _eigenvalue(omega_true, zeta_true))
        own = {"sweep": sweep, "harmonics": settings.harmonics, "samples": settings.samples}
        own["tolerance"] = settings.tolerance
        found = zip(self.compared, error, estimate[:, source])
        return [{**own, "amplitude": a, "error": e, "estimate": guessed} for a, e, guessed in found]

    def _source(self, sweep: str, settings: Settings) -> int | None:
        """Column of `Outcome.estimate` that is of what a run differs by from the finest; None where none is."""
        differs = settings != self.plan.reference and sweep in SOURCE_OF
        return SOURCES.index(SOURCE_OF[sweep]) if differs else None


def _eigenvalue(omega: Array, zeta: Array) -> Complex:
    """lambda = -beta + i omega [1/s] of damped frequencies."""
    return np.asarray(omega * (1j - zeta / np.sqrt(1 - zeta**2)))


def common_amplitudes(first: float, last: float, count: int) -> Array:
    """Even in log amplitude, strictly inside the branch."""
    return np.geomspace(first, last, count + 2)[1:-1]


def _at(run: Outcome, amplitude: float) -> Indices:
    return np.flatnonzero(np.abs(run.amplitude / amplitude - 1.0) < MATCH)


def _values(run: Outcome, amplitudes: Iterable[float]) -> tuple[Array, Array, Array]:
    rows = [int(_at(run, a)[0]) for a in amplitudes]
    return run.omega[rows], run.zeta[rows], run.estimate[rows]


def _largest(values: Array) -> float:
    return float(values.max()) if len(values) else float("nan")
