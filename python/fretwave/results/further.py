"""Tables ``<name>_<suffix>.csv`` that stand beside an analysis' own."""

from __future__ import annotations

from collections.abc import Collection
from glob import escape
from pathlib import Path

#: What analyses may write, not each of them in each run.
SUFFIXES = (
    *("amplification", "blades", "crossings", "curve", "diameters", "peaks", "sectors", "shifted_*", "time", "tuned"),
    "waves",
)


def remove_further(folder: Path, name: str, analyses: Collection[str]) -> None:
    """Remove those of an earlier run, which an analysis that begins anew may not write again. One rank only.

    Parameters
    ----------
    analyses : names of all of the case: one's own table is no further one of another
    """
    for suffix in SUFFIXES:
        for path in folder.glob(f"{escape(name)}_{suffix}.csv"):
            if path.stem not in analyses:
                path.unlink()
