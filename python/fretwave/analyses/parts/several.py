"""Branches of one analysis that run one after the other: which of them came to their end, also over a resumed run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...results.file import ENDED

#: In the state that an analysis goes on from: why branches before it stopped.
STOPPED = "stopped"


def stopped_before(own: Mapping[str, Any]) -> dict[int, str]:
    """Why branches before the one that is gone on with stopped early, by their numbers."""
    kept = own.get(STOPPED)
    return {} if kept is None else {int(k): why for k, why in json.loads(bytes(np.asarray(kept))).items()}


def with_stopped(stopped: Mapping[int, str], **own: float) -> dict[str, Any]:
    """An analysis' own part of the state to go on from, with why earlier branches stopped."""
    return {**own, STOPPED: np.frombuffer(json.dumps(dict(stopped)).encode(), dtype=np.uint8)}


def ending_of(
    stopped: Mapping[int, str], branches: Sequence[Any], all_done: str = "stop value reached"
) -> tuple[str, str, dict[str, str]]:
    """Status, reason, and as an attribute of the results those branches that came to their end.

    Parameters
    ----------
    branches : what tells them apart in the table: levels, nodal diameters, numbers of starts
    all_done : the reason where none stopped
    """
    ended = [branch for number, branch in enumerate(branches) if number not in stopped]
    reason = "; ".join(stopped.values()) or all_done
    return "stopped" if stopped else "done", reason, {ENDED: json.dumps(ended)}
