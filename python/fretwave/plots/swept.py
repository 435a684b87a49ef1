"""A sweep as its pictures see it: branches and quantities by value, their colours, lines and names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..files.dimensions import names_of_data
from ..post.grid import SHOWN, Plan
from ..results.analysis import Analysis, Table
from ..results.file import open_results
from ..results.sweep_summary import split_of
from ..solve.table import Table as Reading
from ..texts import shortened, toml
from . import scales, style
from .scales import Scale

LINES = ("-", (0, (5, 1.5)), (0, (1, 1)), "-.")


@dataclass
class Swept:
    """A sweep as its pictures see it.

    Attributes
    ----------
    branches : (number of the value, place in `parts`, columns along the branch); none of analyses that follow none
    summary : quantity -> (n_1, n_2, ..., [n_parts])
    split, parts : what tells the branches of one value apart, and its values: levels, nodal diameters
    """

    analysis: Analysis
    plan: Plan
    branches: list[tuple[int, int, Table]]
    summary: Table
    split: str
    parts: list[float]

    @classmethod
    def of(cls, analysis: Analysis) -> Swept:
        with open_results(analysis.path) as file:
            group, split = file[analysis.name]["summary"], split_of(str(analysis.attributes["of_type"]))
            names = [*names_of_data(group), *([split] if split in group else [])]
            summary = {key: np.asarray(group[key][()], dtype=float) for key in names}
        parts = [float(part) for part in summary.pop(split, ())]
        plan = plan_in(analysis)
        branches = [] if analysis.meaning is None else list(_branches(analysis.curve(), len(plan), split, parts))
        return cls(analysis, plan, branches, summary, split, parts)

    def unit(self, unit: str) -> str:
        """Of a panel; that of an amplitude where it is a length."""
        return self.analysis.unit("amplitude") or self.analysis.unit_system(unit) if unit == "length" else unit

    def amplitudes(self) -> Scale:
        """Of an axis with the amplitudes of all branches."""
        return scales.logarithmic(self.analysis.unit_system, self.unit("length"), self.analysis.columns["amplitude"])

    @property
    def main(self) -> int:
        """The key with most values: shown by colour, or on an axis."""
        return int(np.argmax(self.plan.shape))

    def look(self, number: int, part: int = 0) -> dict[str, Any]:
        """Colour and line of a branch; with two keys a colour for each value of one, a line for each of the other."""
        if not self.crossed():
            return {"color": style.shades(len(self.plan))[number], "linestyle": LINES[part % len(LINES)]}
        place = np.unravel_index(number, self.plan.shape)
        colours = style.shades(self.plan.shape[self.main])
        return {"color": colours[place[self.main]], "linestyle": LINES[place[1 - self.main]]}

    def crossed(self) -> bool:
        """Two keys, few enough of one's values for as many lines."""
        return len(self.plan.keys) == 2 and min(self.plan.shape) <= len(LINES) and not self.parts

    def names(self) -> list[tuple[str, dict[str, Any]]]:
        """Entries of the legend with their looks."""
        if not self.crossed():
            entries = [(label, self.look(number)) for number, label in enumerate(self.plan.labels())]
            names = [f"{self.split.replace('_', ' ')} {part:g}" for part in self.parts]
            lines = [{"color": style.GREY, "linestyle": LINES[part % len(LINES)]} for part in range(len(names))]
            return [*entries, *zip(names, lines)] if len(names) > 1 else entries
        entries = []
        for key in (self.main, 1 - self.main):
            name = self.plan.keys[key]
            for k, label in enumerate(Plan({name: self.plan.over[name]}, self.plan.units).labels()):
                place = [k if other == key else 0 for other in (0, 1)]
                look = self.look(int(np.ravel_multi_index(place, self.plan.shape)))
                changed = {"linestyle": "-"} if key == self.main else {"color": style.GREY}
                entries.append((label, {**look, **changed}))
        return entries


def plan_in(analysis: Analysis) -> Plan:
    """Of a sweep, with the units of its keys."""
    over = analysis.attributes["over"]
    return Plan(over, {key: style.symbol(analysis.unit(key)) for key in over})


def _branches(curve: Reading, values: int, split: str, parts: list[float]) -> Iterator[tuple[int, int, Table]]:
    for number, (place, part) in product(range(values), enumerate(parts or [np.nan])):
        rows = (curve["value"] == number) & (curve[split] == part if parts else True)
        if rows.any():
            yield number, place, {name: curve[name][rows] for name in curve.names}


def tick(value: object) -> str:
    """A value in a few characters."""
    if isinstance(value, str) and value:
        return shortened(value, SHOWN)
    return f"{value:.6g}" if isinstance(value, float) else toml(value, SHOWN)


def legend(figure: Figure, axes: Axes) -> None:
    """Above the axes, if there is anything to name."""
    names = axes.get_legend_handles_labels()[1]
    if names:
        style.legend_outside(figure, axes, columns=min(5, len(names)))
