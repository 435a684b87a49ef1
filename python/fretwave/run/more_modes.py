"""More component modes than were chosen, where a branch finds that the reduction limits its accuracy."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ..case.component_modes import MOST, choice_of
from ..case.load import Case
from .stopped import limited_by

#: Of run.json: an analysis, the number of component modes that limited it, and the number taken in its place.
GREW = "component_modes_grew"


class TooFewModes(Exception):
    """The component modes that were chosen limit an analysis; with the entry for run.json."""

    def __init__(self, entry: Mapping[str, Any]) -> None:
        super().__init__(entry)
        self.entry = dict(entry)


def expect_enough(case: Case, name: str, reason: str) -> None:
    """Of a reduced case whose analysis ended for this reason.

    Raises
    ------
    TooFewModes
        Component modes limit its accuracy, their number was chosen, and there are more.
    """
    found = case.reduced
    if found is None or limited_by(reason) != "reduction" or choice_of(case) is None:
        return
    few, more = found.component_modes, min(2 * found.component_modes, MOST, found.inner)
    if more > few:
        raise TooFewModes({"analysis": name, "limited_by": few, "taken": more})


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
    steps = [f"{one['limited_by']} limited the accuracy of '{one['analysis']}'" for one in record.get(GREW, ())]
    return f"reduction: {grown(record)} component modes: {', '.join(steps)}" if steps else ""
