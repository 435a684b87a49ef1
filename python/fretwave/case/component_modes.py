"""How many component modes a reduction takes for an accuracy of the lowest frequencies."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..hb.states import ZETA_FLOOR

if TYPE_CHECKING:
    from .load import Case
    from .reduction_report import FullHz, ReductionReport

#: A number is doubled as long as the error falls below this share: what is left is not of the component modes.
GAIN = 0.7
#: No more component modes than these, and no more frequencies compared for their sake.
MOST, MOST_COMPARED = 160, 80


def choice_of(case: Case) -> Choice | None:
    """Of the numbers of component modes, for an accuracy; None where the number, or a frequency, is told.

    An analysis' accuracy is one of lambda over zeta omega0. Before zeta is known it is taken for `ZETA_FLOOR`, and the
    frequencies that count are those up to the analysis' linear mode, and up to the last one of a response.
    """
    section = case.reduction
    assert section is not None
    if section.accuracy is not None:
        return Choice(section.accuracy, section.compare, compare=section.compare)
    if section.modes is not None or section.up_to_hz is not None:
        return None
    harmonic = [analysis.harmonic() for analysis in case.analyses.values()]
    asked = [(one.accuracy, one.linear_mode, one.up_to_hz()) for one in harmonic if one is not None and one.accuracy]
    if not asked:
        return None
    accuracies, modes, last = zip(*asked)
    return Choice(ZETA_FLOOR * min(accuracies), max(modes), max(last), max(section.compare, *modes))


@dataclass
class Choice:
    """Numbers of component modes that are tried in turn, each twice the last.

    Attributes
    ----------
    asked : relative accuracy of the frequencies
    frequencies : how many of the lowest ones count
    up_to_hz : those up to here count too
    compare : how many are compared
    tried : (number, largest relative error of these) of each
    end : why no more were tried; empty where the accuracy is kept
    full_hz : frequencies of the unreduced model, the same whatever is tried, as far as they are known
    """

    asked: float
    frequencies: int
    up_to_hz: float = 0.0
    compare: int = 0
    tried: list[tuple[int, float]] = field(default_factory=list)
    end: str = ""
    full_hz: FullHz = field(default_factory=dict)

    def looks_further(self, found: ReductionReport) -> bool:
        """More frequencies are to be compared than these: not all that count were, and the reduced model has more."""
        if self._all_seen(found) or len(found.relative) < self.compare or self.compare >= MOST_COMPARED:
            return False
        self.compare = min(2 * self.compare, MOST_COMPARED)
        return True

    def _all_seen(self, found: ReductionReport) -> bool:
        """The frequencies that count were compared."""
        least = min((hz[-1] for hz, _ in found.every_comparison() if hz), default=0.0)
        return len(found.relative) >= self.frequencies and least >= self.up_to_hz

    def _error(self, found: ReductionReport) -> float:
        """The largest of those that count; infinite where not all of them are compared."""
        fewer = len(found.relative) < self.compare or self.compare >= MOST_COMPARED
        if fewer and found.component_modes < found.inner and not self._all_seen(found):
            return math.inf
        every = [(k, f, e) for hz, relative in found.every_comparison() for k, (f, e) in enumerate(zip(hz, relative))]
        counted = [e for k, f, e in every if k < self.frequencies or f <= self.up_to_hz]
        return max((abs(e) for e in counted if e is not None), default=0.0)

    def next(self, found: ReductionReport) -> int | None:
        """The number to try after this one; None if it is enough, or no more modes help."""
        error, before = self._error(found), self.tried[-1][1] if self.tried else math.inf
        self.tried.append((found.component_modes, error))
        most = min(MOST, found.inner)
        if error <= self.asked:
            return None
        if error > GAIN * before:
            self.end = "more of them change little"
        elif found.component_modes >= most:
            self.end = f"{most} are the most that are taken"
        return None if self.end else min(2 * found.component_modes, most)

    def line(self) -> str:
        """In words, for the log."""
        tried = (
            (number, f"leave {error:.1e}" if error < math.inf else "do not tell of all") for number, error in self.tried
        )
        numbers = ", ".join(f"{number} {found}" for number, found in tried)
        missed = f"; {self.end}: this is not kept" if self.end else ""
        return f"reduction: component modes for {self.asked:.1e} of the lowest frequencies: {numbers}{missed}"
