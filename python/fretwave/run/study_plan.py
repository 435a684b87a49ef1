"""What a study runs and how its errors are measured; knows neither cases nor solvers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, Indices
from ..columns import SOURCES
from ..hb.states import default_samples
from ..post.calibration import FACTORS, can_be_told, share_within
from ..solve.accuracy import TOLERATED
from .study_outcomes import AnyOutcome

#: Relative, of a place; a loose Newton tolerance lets an amplitude miss by about itself.
MATCH = 1e-2
#: What a sweep's runs differ by from the finest
SOURCE_OF = {"harmonics": "harmonics", "samples": "samples", "tolerance": "solver", "component_modes": "reduction"}


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
        return [(name, settings) for name, settings in self._asked() if settings.possible()]

    @property
    def impossible(self) -> list[Settings]:
        """What is asked for and cannot be run."""
        return list(dict.fromkeys(settings for _, settings in self._asked() if not settings.possible()))

    def _asked(self) -> list[tuple[str, Settings]]:
        finest = self.reference
        values: dict[str, Sequence[Any]] = {"harmonics": sorted(self.harmonics), "samples": sorted(self.samples)}
        values |= {"tolerance": sorted(self.tolerance)[::-1], "component_modes": sorted(self.component_modes)}
        values |= {"accuracy": sorted(self.accuracy)[::-1]}
        rows = [(name, replace(finest, **{name: value})) for name, swept in values.items() for value in swept]
        if self.accuracy:
            sets = [(highest, default_samples(highest)) for highest in sorted(self.harmonics)]
            rows += [("set", replace(finest, harmonics=highest, samples=count)) for highest, count in sets]
        return rows


@dataclass
class Study:
    """Outcomes of a plan and the table made of them.

    Attributes
    ----------
    places : amplitudes or frequencies at which runs are compared, ascending
    over : what these are
    left_out : places of these at which some run has several solutions (between two folds) or none
    failures : settings that found no whole branch, and why
    """

    plan: Plan
    places: Array
    over: str = "amplitude"
    outcomes: dict[Settings, AnyOutcome] = field(default_factory=dict)
    failures: dict[Settings, str] = field(default_factory=dict)

    def run(self, solve: Callable[[Settings], AnyOutcome | str], report: Callable[[str, Settings], None]) -> None:
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
        """Places that cannot be compared: a run meets them several times, or never."""
        return np.array([a for a in self.places if a not in self.compared])

    @property
    def compared(self) -> Array:
        """Places that every run meets exactly once."""
        met = [[len(self._at(run, a)) == 1 for a in self.places] for run in self.outcomes.values()]
        return self.places[np.all(met, axis=0)] if met else self.places[:0]

    def table(self) -> list[dict[str, float | int | str]]:
        """One row per run and sweep; empty when the reference itself failed."""
        reference = self.outcomes.get(self.plan.reference)
        if reference is None:
            return []
        rows = self.plan.sweeps()
        return [self._row(sweep, settings, reference) for sweep, settings in rows if settings in self.outcomes]

    def _row(self, sweep: str, settings: Settings, reference: AnyOutcome) -> dict[str, float | int | str]:
        run = self.outcomes[settings]
        rows, its = self._rows(run), self._rows(reference)
        source = self._source(sweep, settings)
        estimate = run.estimate[rows]
        guessed = np.nansum(estimate, axis=1) if source is None else estimate[:, source]
        ratios = self._ratios(sweep, settings, reference)
        known, true, judge = (np.array([row[name] for row in ratios]) for name in ("estimate", "error", "judge"))
        told = can_be_told(true, judge)
        return {
            "sweep": sweep,
            "harmonics": run.harmonics or settings.harmonics,
            "samples": run.samples or settings.samples,
            "tolerance": settings.tolerance,
            "points": run.points,
            "newton": run.newton,
            "wall_s": run.wall_s,
            **run.errors(reference, rows, its, guessed),  # type: ignore[arg-type]
            **{f"within_{factor}": share_within(known[told], true[told], factor) for factor in FACTORS},
            "judged": int(told.sum()) if len(told) else math.nan,
            "component_modes": -1 if settings.component_modes is None else settings.component_modes,
            "accuracy": math.nan if settings.accuracy is None else settings.accuracy,
            "kept": math.nan if settings.accuracy is None else self._kept(settings, settings.accuracy),
            "best_fixed_s": math.nan if settings.accuracy is None else self._best_fixed(settings.accuracy),
            "reference": int(settings == self.plan.reference),
            "cpu_s": run.cpu_s,
        }

    def _rows(self, run: AnyOutcome) -> Indices:
        """Of a run where all are compared."""
        return np.array([int(self._at(run, a)[0]) for a in self.compared], dtype=int)

    def _at(self, run: AnyOutcome, place: float) -> Indices:
        return np.flatnonzero(np.abs(run.parameter / place - 1.0) < self._match)

    @cached_property
    def _match(self) -> float:
        """A point belongs to a place when it is this near."""
        apart = np.diff(self.places) / self.places[1:]
        return min(MATCH, float(apart.min()) / 3) if len(apart) else MATCH

    def _errors(self, settings: Settings) -> Array:
        """Of the values where all are compared."""
        run, true = self.outcomes[settings], self.outcomes[self.plan.reference]
        return np.abs(run.value[self._rows(run)] - true.value[self._rows(true)])

    def _kept(self, settings: Settings, accuracy: float) -> float:
        """Share of the places at which a run is as accurate, of a mode in lambda over zeta omega0."""
        true = self.outcomes[self.plan.reference]
        allowed = accuracy * true.allowed(self._rows(true))
        return float(np.mean(self._errors(settings) <= allowed)) if len(allowed) else math.nan

    def _best_fixed(self, accuracy: float) -> float:
        """Processor time [s] of the quickest run of one set that keeps an accuracy at 95 % of the places, or nan."""
        fixed = [settings for settings in self.outcomes if settings.accuracy is None]
        times = [self.outcomes[s].cpu_s for s in fixed if self._kept(s, accuracy) >= 1 - TOLERATED]
        return min(times, default=math.nan)

    def calibration(self) -> list[dict[str, Any]]:
        """Estimated and true error by run and place, of the source that the sweep is over: of lambda [1/s], or of the
        complex amplitude over the largest.

        What the others add is the same in a run and in the finest, to which it is compared; `judge` is what that one
        states of the same source of its own.
        """
        reference = self.outcomes.get(self.plan.reference)
        known = [(sweep, settings) for sweep, settings in self.plan.sweeps() if settings in self.outcomes]
        if reference is None:
            return []
        return [row for sweep, settings in known for row in self._ratios(sweep, settings, reference)]

    def _ratios(self, sweep: str, settings: Settings, reference: AnyOutcome) -> list[dict[str, Any]]:
        source = self._source(sweep, settings)
        if source is None:
            return []
        run, unit = self.outcomes[settings], reference.unit
        own = {"sweep": sweep, "harmonics": settings.harmonics, "samples": settings.samples}
        own["tolerance"] = settings.tolerance
        estimates = (of.estimate[self._rows(of), source] / unit for of in (run, reference))
        found = zip(self.compared, self._errors(settings) / unit, *estimates)
        return [{**own, self.over: a, "error": e, "estimate": guessed, "judge": j} for a, e, guessed, j in found]

    def _source(self, sweep: str, settings: Settings) -> int | None:
        """Column of `Outcome.estimate` that is of what a run differs by from the finest; None where none is."""
        differs = settings != self.plan.reference and sweep in SOURCE_OF
        return SOURCES.index(SOURCE_OF[sweep]) if differs else None


def common_amplitudes(first: float, last: float, count: int) -> Array:
    """Even in log amplitude, strictly inside the branch."""
    return np.geomspace(first, last, count + 2)[1:-1]
