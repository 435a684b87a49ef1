"""Two rotating state slots in results.h5, from which a killed run goes on.

A kill inside a write spoils at most the slot being written: its checksum fails and the other one, a point
older, is used.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

State = Mapping[str, Any]


@dataclass
class Slot:
    """What a slot holds.

    Attributes
    ----------
    sequence : int
        Rises with every write; the newer of two valid slots wins.
    rows : int
        Rows the table had when it was written.
    reported : int
        Reported points it had.
    arrays : dict
        The state itself.
    """

    sequence: int
    rows: int
    reported: int
    arrays: dict[str, Any] = field(default_factory=dict)


class Slots:
    """Writes states in turn into ``state_0`` and ``state_1`` of a group.

    Parameters
    ----------
    group : h5py.Group
        The group of an analysis.
    """

    def __init__(self, group: Any) -> None:
        self._group = group
        self._data: dict[tuple[int, str], Any] = {}

    def write(self, slot: Slot) -> None:
        """Write a state; arrays of unchanged shape are written in place."""
        turn = slot.sequence % 2
        arrays = {name: np.asarray(value, order="C") for name, value in slot.arrays.items()}
        if self._group.get(f"state_{turn}") is None:
            self._group.create_group(f"state_{turn}")
        for name, array in arrays.items():
            self._array(turn, name, array)
        header = [slot.sequence, slot.rows, slot.reported]
        self._array(turn, "header", np.array([*header, _checksum(header, arrays)], dtype="i8"))

    def _array(self, turn: int, name: str, array: Any) -> None:
        from h5py import h5s

        data = self._data.get((turn, name))
        if data is None or data.shape != array.shape or data.dtype != array.dtype:
            holder = self._group[f"state_{turn}"]
            if name in holder:
                del holder[name]
            data = self._data[turn, name] = holder.create_dataset(name, data=array).id
        data.write(h5s.ALL, h5s.ALL, array)


def read_valid(group: Any) -> list[Slot]:
    """Slots whose checksum is right, the newest first."""
    slots = [_read(group[name]) for name in ("state_0", "state_1") if name in group]
    valid = [slot for slot in slots if slot is not None]
    return sorted(valid, key=lambda slot: slot.sequence, reverse=True)


def _read(holder: Any) -> Slot | None:
    try:
        header = holder["header"][()]
        arrays = {name: np.asarray(holder[name][()]) for name in holder if name != "header"}
    except (KeyError, OSError, RuntimeError):
        return None
    *counts, checksum = (int(number) for number in header)
    if checksum != _checksum(counts, arrays):
        return None
    return Slot(counts[0], counts[1], counts[2], arrays)


def _checksum(counts: list[int], arrays: Mapping[str, Any]) -> int:
    total = zlib.crc32(np.array(counts, dtype="i8").tobytes())
    for name in sorted(arrays):
        array = np.asarray(arrays[name], order="C")
        total = zlib.crc32(f"{name}{array.dtype.str}{array.shape}".encode(), total)
        total = zlib.crc32(array.tobytes(), total)
    return total
