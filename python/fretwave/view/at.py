"""Which point of a branch ``fretwave probe --at`` means: its peak, its ends, an amplitude, a row of the table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Indices
from ..errors import InputError
from ..results.overview import in_order, peak_row, whose_amplitude
from ..texts import display, nearest
from .options import ViewOptions
from .places import linear_last
from .points import not_kept, points_asked

if TYPE_CHECKING:
    import h5py

WORDS = ("peak", "start", "end")
#: How a point is asked for, in messages.
HOW = "--at row {}"


@dataclass(frozen=True)
class At:
    """One of a word, a row of the table, an amplitude [length]."""

    word: str = ""
    row: int | None = None
    amplitude: float | None = None

    @classmethod
    def read(cls, words: Sequence[str]) -> At:
        """From the words of the command line.

        Raises
        ------
        InputError
            They are none of these.
        """
        text = " ".join(words)
        if text in WORDS:
            return cls(word=text)
        number = text.removeprefix("row").strip()
        try:
            return cls(row=int(number)) if text.startswith("row") else cls(amplitude=float(number))
        except ValueError:
            expected = f"{', '.join(WORDS)}, an amplitude, or row N"
            fix = nearest(text, WORDS, "--at {}".format) or "--at peak"
            raise InputError("this is no point of a branch", "--at", text, expected, fix) from None

    def point(self, group: h5py.Group, kept: Indices | None, where: str) -> tuple[int, str]:
        """Number of the point and what was asked for, in words.

        Parameters
        ----------
        kept : points that keep what is wanted; None for all

        Raises
        ------
        InputError
            There is no such point, or it does not keep what is wanted.
        """
        count = len(group["points/amplitude"]) if "points/amplitude" in group else 0
        if not count or (kept is not None and not len(kept)):
            fix = "let the run go on: `fretwave resume`"
            raise InputError("there are no points yet that could be looked at", where, f"{count} points", None, fix)
        offered = np.arange(count) if kept is None else kept
        if self.word:
            return self._named(group, count, offered)
        options = ViewOptions(
            points=[] if self.row is None else [self.row],
            amplitudes=[] if self.amplitude is None else [self.amplitude],
            how=HOW,
        )
        ((point, said),) = points_asked(group, offered, options, where)
        if point not in offered:
            near = int(offered[np.argmin(np.abs(offered - point))])
            what = "the motion of the contacts is not kept at this point (report_at keeps more)"
            raise not_kept(what, where, f"point {point}", offered, group, near, HOW)
        return point, said

    def _named(self, group: h5py.Group, count: int, offered: Indices) -> tuple[int, str]:
        """The kept point nearest to the one that a word means."""
        peak = peak_row(group["points"])
        if self.word == "peak" and peak is None:
            return int(offered[0]), ", the first (there is no peak of damping or response)"
        meant = {"start": 0, "end": count - 1, "peak": peak or 0}[self.word]
        point = int(offered[np.argmin(np.abs(offered - meant))])
        of = "damping" if "zeta" in group["points"] else f"amplitude{whose_amplitude(group['points'])}"
        said = {"start": ", the first", "end": ", the last", "peak": f", that of the largest {of}"}[self.word]
        return point, said if point == meant else f", the kept point nearest to point {meant}{said}"


def analysis_with(
    file: h5py.File, folder: Path, asked: str | None, has: Callable[[h5py.Group], bool], what: str
) -> str:
    """Name of the analysis asked for, or of the case's first, that has something.

    Parameters
    ----------
    what : it has, in words

    Raises
    ------
    InputError
        There is no such analysis.
    """
    there = [name for name in in_order(folder, list(file)) if "type" in file[name].attrs and has(file[name])]
    found = linear_last(file, there)
    if found and asked in (None, *found):
        return asked or found[0]
    listed = ", ".join(found) or "none"
    fix = (nearest(asked, found) if asked else None) or (
        f"--analysis {found[0]}" if found else "run a mode or forced response"
    )
    raise InputError(_missing(file, asked, what), display(folder), f"analyses with {what}: {listed}", None, fix)


def _missing(file: h5py.File, asked: str | None, what: str) -> str:
    """What there is not."""
    if asked is None:
        return f"no analysis has {what}"
    return f"'{asked}' has no {what}" if asked in file else f"there is no analysis '{asked}'"
