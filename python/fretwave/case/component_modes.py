"""How many component modes a reduction takes for an accuracy of the lowest frequencies."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..hb.states import ZETA_FLOOR

if TYPE_CHECKING:
    from .load import Case
    from .reduction_report import FullHz, ReductionReport

#: A number is doubled as long as the error falls below this share: what is left is not of the component modes.
GAIN = 0.7
#: No more component modes than these.
MOST = 160


def choice_of(case: Case) -> Choice | None:
    """Of the numbers of component modes, for an accuracy; None where the number, or a frequency, is told.

    An analysis' accuracy is one of lambda over zeta omega0. Before zeta is known it is taken for `ZETA_FLOOR`, and the
    frequency that counts is that of the analysis' linear mode.
    """
    section = case.reduction
    assert section is not None
    if section.accuracy is not None:
        return Choice(section.accuracy, section.compare)
    if section.modes is not None or section.up_to_hz is not None:
        return None
    harmonic = [analysis.harmonic() for analysis in case.analyses.values()]
    asked = [(one.accuracy, one.linear_mode) for one in harmonic if one is not None and one.accuracy is not None]
    if not asked:
        return None
    return Choice(ZETA_FLOOR * min(accuracy for accuracy, _ in asked), max(mode for _, mode in asked))


@dataclass
class Choice:
    """Numbers of component modes that are tried in turn, each twice the last.

    Attributes
    ----------
    asked : relative accuracy of the frequencies
    frequencies : how many of the lowest ones count, of those that are compared
    tried : (number, largest relative error of these) of each
    end : why no more were tried; empty where the accuracy is kept
    full_hz : frequencies of the unreduced model, the same whatever is tried, as far as they are known
    """

    asked: float
    frequencies: int
    tried: list[tuple[int, float]] = field(default_factory=list)
    end: str = ""
    full_hz: FullHz = field(default_factory=dict)

    def next(self, found: ReductionReport) -> int | None:
        """The number to try after this one; None if it is enough, or no more modes help."""
        errors = [abs(e) for waves in found.every_relative() for e in waves[: self.frequencies] if e is not None]
        error, before = max(errors, default=0.0), self.tried[-1][1] if self.tried else float("inf")
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
        numbers = ", ".join(f"{number} leave {error:.1e}" for number, error in self.tried)
        missed = f"; {self.end}: this is not kept" if self.end else ""
        return f"reduction: component modes for {self.asked:.1e} of the lowest frequencies: {numbers}{missed}"
