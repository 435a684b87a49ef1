"""Branches of one analysis that run one after the other: which of them came to their end, also over a resumed run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ...errors import InputError
from ...results.file import ENDED

#: In the state that an analysis goes on from: why branches before it stopped, and with what errors some never began.
STOPPED, REFUSED = "stopped", "refused"


def stopped_before(own: Mapping[str, Any]) -> dict[int, str]:
    """Why branches before the one that is gone on with stopped early, by their numbers."""
    return {int(number): why for number, why in _kept(own, STOPPED).items()}


def refused_before(own: Mapping[str, Any]) -> dict[int, InputError]:
    """Errors of branches before that one that could not begin, by what tells them apart."""
    return {int(branch): InputError(*said) for branch, said in _kept(own, REFUSED).items()}


def with_stopped(stopped: Mapping[int, str], **own: float) -> dict[str, Any]:
    """An analysis' own part of the state to go on from, with why earlier branches stopped."""
    return {**own, STOPPED: _bytes(stopped)}


def with_refused(refused: Mapping[int, InputError]) -> dict[str, Any]:
    """A further part of it: what `refused_before` gives, none where all began."""
    said = {number: [None if one is None else str(one) for one in error.args] for number, error in refused.items()}
    return {REFUSED: _bytes(said)} if said else {}


def _bytes(told: Mapping[int, Any]) -> npt.NDArray[np.uint8]:
    return np.frombuffer(json.dumps(dict(told)).encode(), dtype=np.uint8)


def _kept(own: Mapping[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(bytes(np.asarray(own[name]))) if name in own else {}
    return found


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
