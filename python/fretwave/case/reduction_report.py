"""What a reduction of a case did, for the log and the results."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class ReductionReport:
    """What a reduction did.

    Attributes
    ----------
    unreduced, kept, component_modes : int
        Dofs before, kept among them, and modes added.
    highest_component_hz : float
        Frequency of the last component mode.
    full_hz, reduced_hz : list of float
        Lowest linear frequencies with stuck contact, without and with reduction.
    relative : list of float
        reduced / full - 1.
    wall_s : float
        Of the reduction; `compare_wall_s` that of the comparison.
    interface : int
        Coordinates of one face of a sector.
    waves : list of dict
        Of a sector: the comparison for each nodal diameter, contact stuck and sliding (`fretwave.WaveError`); that of
        the first stands above.
    wave_lines : list of str
        The same for the log.
    """

    unreduced: int
    kept: int
    component_modes: int
    highest_component_hz: float
    full_hz: list[float]
    reduced_hz: list[float]
    relative: list[float]
    wall_s: float
    compare_wall_s: float
    interface: int = 0
    waves: list[dict[str, Any]] = field(default_factory=list)
    wave_lines: list[str] = field(default_factory=list)

    def plain(self) -> dict[str, Any]:
        """For run.json and results.h5."""
        return {key: value for key, value in asdict(self).items() if key != "wave_lines"}

    def lines(self) -> list[str]:
        """For the log: one line, and one for each wave of a sector that was compared."""
        if self.interface:
            text = (
                f"reduction: {self.unreduced} dofs to {self.kept} kept, {self.interface} of each face and"
                f" {self.component_modes} component modes (up to {self.highest_component_hz:.4g} Hz),"
                f" {self.wall_s:.1f} s"
            )
            return [text, *(f"reduction: {line}" for line in self.wave_lines)]
        return [self._line()]

    def _line(self) -> str:
        text = (
            f"reduction: {self.unreduced} dofs to {self.kept} kept and {self.component_modes} component modes"
            f" (up to {self.highest_component_hz:.4g} Hz), {self.wall_s:.1f} s"
        )
        if self.relative:
            worst = max(self.relative, key=abs)
            text += (
                f"; the lowest {len(self.relative)} frequencies with stuck contact, {self.full_hz[0]:.6g} to"
                f" {self.full_hz[-1]:.6g} Hz, are off by {self.relative[0]:.1e} (first) to {worst:.1e} (worst)"
            )
        return text
