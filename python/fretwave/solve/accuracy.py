"""Which harmonics and samples a relative accuracy asks for, judged by the error estimate of a point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from math import isfinite, log
from typing import TYPE_CHECKING

from ..columns import SOURCES

if TYPE_CHECKING:
    from ..hb.harmonics import Harmonics

#: Shares of the accuracy: what a new set aims at, and above which a smaller one is not tried.
AIM, LOW = 0.6, 0.5
#: Assumed orders of convergence in the harmonics and in the samples until two sets have been compared, and how far
#: that is believed. Contact forces with kinks have 3 to 4 and 1 to 2, friction that jumps 1 in the harmonics.
ORDER_OF = {"harmonics": 3.0, "samples": 1.5}
ORDERS = (1.0, 8.0)
#: A set is changed at most so many times for one point, and made smaller so many times on a branch, and once more in
#: so many of its points: what a narrow resonance asks for is given back behind it.
ROUNDS, SMALLER, AGAIN = 3, 20, 20
#: A set grows at most so many times at once.
FACTOR = 3
#: No more harmonics and samples than these; harmonics above MANY as long as there are no more unknowns than these.
MOST_HARMONICS, MOST_SAMPLES = 1023, 1 << 14
MANY, UNKNOWNS = 255, 20_000
#: Share of a branch's points that may miss the accuracy.
TOLERATED = 0.05
#: Points of a branch before a smaller set is tried.
PATIENCE = 3


@dataclass
class Aim:
    """Chooses sets of harmonics and samples along a branch.

    Attributes
    ----------
    harmonics, samples : share of the allowed error at the last point; `before` at the one before it
    order_harmonics, order_samples : of convergence, as two sets at one point have shown it
    steps : points so far
    smaller : how often a smaller set was taken
    most_harmonics : that may be taken
    """

    harmonics: float = 0.0
    samples: float = 0.0
    before: float = 0.0
    order_harmonics: float = ORDER_OF["harmonics"]
    order_samples: float = ORDER_OF["samples"]
    steps: int = 0
    smaller: int = 0
    most_harmonics: int = MANY

    @classmethod
    def of(cls, state: Sequence[float]) -> Aim:
        """The inverse of `state`."""
        kinds = {"int": int, "float": float}
        return cls(**{field.name: kinds[str(field.type)](value) for field, value in zip(fields(cls), state)})

    @property
    def state(self) -> list[float]:
        return [float(value) for value in asdict(self).values()]

    def see(self, shares: Mapping[str, float]) -> None:
        """A point has been found on the present set."""
        self.before = self.harmonics + self.samples if self.steps else 0.0
        self.harmonics, self.samples = (
            shares[name] if isfinite(shares[name]) else 0.0 for name in ("harmonics", "samples")
        )
        self.steps += 1

    def compare(self, one: Harmonics, first: Mapping[str, float], other: Harmonics, then: Mapping[str, float]) -> None:
        """Learn the orders of convergence from one point on two sets."""
        for name, sizes in (
            ("harmonics", (one.orders[-1], other.orders[-1])),
            ("samples", (one.samples, other.samples)),
        ):
            if sizes[1] > sizes[0] and first[name] > 0 and then[name] > 0:
                order = log(first[name] / then[name]) / log(sizes[1] / sizes[0])
                setattr(self, f"order_{name}", min(max(order, ORDERS[0]), ORDERS[1]))

    def finer(self, at: Harmonics, shares: Mapping[str, float]) -> Harmonics | None:
        """A set that keeps the accuracy where this one misses it; None where it keeps it, or where no set helps."""
        if not shares["all"] > 1:
            return None
        return self._larger(at, shares["harmonics"], shares["samples"])

    def next(self, at: Harmonics, least: Harmonics) -> Harmonics | None:
        """Another set for what comes: larger where the error grows past the accuracy in one more step, or smaller."""
        now = self.harmonics + self.samples
        growth = min(max(now / self.before, 1.0), 2.0) if self.before > 0 else 1.0
        if now * growth > 1:
            return self._larger(at, self.harmonics * growth, self.samples * growth)
        if self.steps <= PATIENCE or self.smaller >= SMALLER + self.steps // AGAIN:
            return None
        found = self._smaller(at, least)
        self.smaller += found is not None
        return found

    def _larger(self, at: Harmonics, harmonics: float, samples: float) -> Harmonics | None:
        """The sources share what the accuracy allows; the smaller one is left alone where it is small."""
        highest, count = at.orders[-1], at.samples
        if harmonics > AIM:
            factor = (harmonics / AIM) ** (1 / self.order_harmonics)
            wanted = max(highest + 2, round(highest * min(factor, FACTOR)))
            highest = max(highest, min(wanted, self.most_harmonics))
        while samples > AIM and count < min(FACTOR * at.samples, MOST_SAMPLES):
            count, samples = 2 * count, samples / 2**self.order_samples
        return _other(at, at.up_to(highest, count))

    def _smaller(self, at: Harmonics, least: Harmonics) -> Harmonics | None:
        """A set whose expected error, at an order more than seen, is below LOW."""
        highest, count, samples = at.orders[-1], at.samples, self.samples
        if self.harmonics < LOW:
            factor = (self.harmonics / LOW) ** (1 / (self.order_harmonics + 1))
            highest = max(round(highest * max(factor, 1 / FACTOR)), least.orders[-1])
        while samples * 2 ** (self.order_samples + 1) < LOW and count > least.samples:
            count, samples = count // 2, samples * 2 ** (self.order_samples + 1)
        if highest > 0.85 * at.orders[-1]:
            highest = at.orders[-1]
        return _other(at, at.up_to(highest, count))


def _other(one: Harmonics, other: Harmonics) -> Harmonics | None:
    """The other one, if it is another."""
    return None if (one.orders, one.samples) == (other.orders, other.samples) else other


def most_harmonics(dofs: int) -> int:
    """Of a model with so many dofs: few resolve a steep law in thousands of unknowns, many would never end."""
    return min(MOST_HARMONICS, max(MANY, UNKNOWNS // (2 * dofs)))


def limiting(shares: Mapping[str, float]) -> str:
    """The largest source of error that is known; unknown where there is no estimate."""
    if not isfinite(shares["all"]):
        return "unknown"
    return max(SOURCES, key=lambda source: shares[source] if isfinite(shares[source]) else 0.0)
