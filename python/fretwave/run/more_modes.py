"""More component modes than were chosen, where a branch finds that the reduction limits its accuracy."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..case.component_modes import MOST, choice_of
from ..case.load import Case
from ..texts import counted
from .stopped import limited_points, most_limiting

#: Of run.json: an analysis, the number of component modes that limited it, at how many of how many points, and the
#: number taken in its place; or an analysis whose results are read, and the number that they are on.
GREW = "component_modes_grew"
#: Of an analysis in run.json: why a run has taken no more component modes though these limit it.
KEPT = "component_modes_kept"


class TooFewModes(Exception):
    """The component modes that were chosen limit an analysis; with the entry for run.json."""

    def __init__(self, entry: Mapping[str, Any]) -> None:
        super().__init__(entry)
        self.entry = dict(entry)


def expect_enough(case: Case, name: str, reason: str, record: Mapping[str, Any]) -> str:
    """Of a reduced case whose analysis ended for this reason.

    Returns
    -------
    str
        Why no more are taken though component modes limit its accuracy; empty where they do not, or were told.

    Raises
    ------
    TooFewModes
        Component modes limit its accuracy, their number was chosen, and there are more.
    """
    found = case.reduced
    if found is None or most_limiting(reason) != "reduction" or choice_of(case) is None:
        return ""
    few, more = found.component_modes, min(2 * found.component_modes, MOST, found.inner)
    limited, points = limited_points(reason, "reduction")
    why = _fixed(record) or _no_gain(record, name, few, limited, points)
    if not why and more > few:
        raise TooFewModes({"analysis": name, "limited_by": few, "points": [limited, points], "taken": more})
    return why or f"{few} are the most that are taken"


def _fixed(record: Mapping[str, Any]) -> str:
    """Results of an earlier run that are needed are on this number."""
    needed = [one["analysis"] for one in record.get(GREW, ()) if one.get("needed")]
    return f"the results of '{needed[0]}', which are needed, are on {grown(record)}" if needed else ""


def _no_gain(record: Mapping[str, Any], name: str, modes: int, limited: int, points: int) -> str:
    """The last that were taken for its sake limit no smaller share of its points."""
    own = [one for one in record.get(GREW, ()) if one["analysis"] == name and "points" in one]
    if not own or limited * own[-1]["points"][1] < own[-1]["points"][0] * points:
        return ""
    before, (at, of) = own[-1]["limited_by"], own[-1]["points"]
    return f"{before} limited {at} of {of} points, {modes} limit {limited} of {points}"


def grown(record: Mapping[str, Any]) -> int | None:
    """How many a run has taken in place of those that were chosen; None where these were enough."""
    return int(record[GREW][-1]["taken"]) if record.get(GREW) else None


def on_these(record: Mapping[str, Any], attributes: Mapping[str, Any]) -> bool:
    """Results (or a sweep, whose values have their own) are on as many as the run has taken by now."""
    most = grown(record)
    reduction = json.loads(attributes.get("reduction", "{}"))
    return most is None or reduction.get("component_modes", most) == most


def line(record: Mapping[str, Any]) -> str:
    """In words, for the end of a run; empty where those that were chosen were enough."""
    steps = [_step(one) for one in record.get(GREW, ())]
    own = {name: entry for name, entry in record["analyses"].items() if name in record["selected"]}
    steps += [f"no more for '{name}'" for name, entry in own.items() if steps and entry.get(KEPT)]
    return f"reduction: {grown(record)} component modes: {', '.join(steps)}" if steps else ""


def _step(one: Mapping[str, Any]) -> str:
    if "limited_by" in one:
        return f"{one['limited_by']} limited the accuracy of '{one['analysis']}'"
    return f"as the results of '{one['analysis']}' from an earlier run"


def line_of_values(records: Iterable[Mapping[str, Any] | None]) -> list[str]:
    """The same of the values of a sweep, in one line; none where those that were chosen were enough for all."""
    every = list(records)
    grew = [record for record in every if record is not None and record.get(GREW)]
    if not grew:
        return []
    numbers = Counter(grown(record) for record in grew)
    found = ", ".join(f"{modes} at {counted(n, 'value')}" for modes, n in sorted(numbers.items()))
    steps = dict.fromkeys(_step(one) for record in grew for one in record[GREW])
    of = f"{len(grew)} of {counted(len(every), 'value')}"
    return [f"reduction: component modes in place of those chosen at {of}: {found}: {', '.join(steps)}"]


def begin_anew(record: dict[str, Any], names: Sequence[str], few: Mapping[str, Any]) -> None:
    """Take note of more component modes; what was found on fewer is not of the run any more."""
    record.setdefault(GREW, []).append(few)
    record["analyses"] = {name: entry for name, entry in record["analyses"].items() if name not in names}
