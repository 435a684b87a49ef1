"""Pictures of a finished or running run, from its results alone; imported (with matplotlib) only on demand."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np
from numpy.linalg import LinAlgError

from ..errors import InputError
from ..registry import kinds
from ..texts import nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..results.reader import Run

    Family = Callable[[Run], Iterator[tuple[str, Figure]]]

Saved = TypeVar("Saved")
#: Raised where results are too few or too extreme for a picture.
OF_RESULTS = (ArithmeticError, ValueError, IndexError, LinAlgError)
#: Of no analysis.
OTHERS = ("study", "calibration", "gauges")


def families() -> list[tuple[str, Family]]:
    """Families of pictures: the modules here that the kinds of analysis name, and what kinds draw by themselves."""
    known = kinds()
    modules = dict.fromkeys([*(name for kind in known.values() for name in kind.pictures), *OTHERS])
    return [*((name, _family(name)) for name in modules), *((name, kind.figures) for name, kind in known.items())]


def check_names(run_folder: str | Path, only: Sequence[str]) -> None:
    """Refuse what is neither an analysis nor a table of the folder nor a family of pictures.

    Raises
    ------
    InputError
        The first such name.
    """
    from ..results.reader import Run

    run = Run(run_folder)
    of_run, drawing = list(run.analyses), dict.fromkeys(name for name, _ in families())
    known = [*of_run, *(name for name in drawing if name not in of_run)]
    for name in only:
        if name not in (*known, *run.tables()):
            expected = f"an analysis ({', '.join(of_run) or 'none yet'}), or one of {', '.join(known[len(of_run) :])}"
            fix = nearest(name, known, "--only {}".format) or f"--only {known[0]}"
            raise InputError("there are no such pictures", "--only", name, expected, fix)


def plot_run(
    run_folder: str | Path,
    only: Sequence[str] | None = None,
    failed: list[str] | None = None,
    formats: Sequence[str] = ("png",),
    drawable: set[str] | None = None,
) -> list[Path]:
    """Make every picture that the results allow; nothing is solved.

    Parameters
    ----------
    run_folder : folder with results.h5 and the analyses' tables
    only : names of analyses or of picture families; None for all
    failed : gets a line for each family that the results are too few or too extreme for; without it they raise
    formats : of the files, of those in `fretwave.plots.style.FORMATS`
    drawable : gets the names of `only` under which these results have pictures

    Returns
    -------
    The files written, `<analysis>_<picture>.png` in the run folder.
    """
    from ..results.reader import Run
    from . import style

    run = Run(run_folder)

    def save(name: str, figure: Figure) -> list[Path]:
        return [style.save(figure, run.folder / f"{name}.{ending}") for ending in formats]

    return [path for paths in drawn(run, save, only, failed, drawable) for path in paths]


def drawn(
    run: Run,
    save: Callable[[str, Figure], Saved],
    only: Sequence[str] | None = None,
    failed: list[str] | None = None,
    drawable: set[str] | None = None,
) -> Iterator[Saved]:
    """What `save` makes of the name and the figure of each picture; see `plot_run`."""
    from . import style

    with style.rules(), np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of ranges without a width and values without a logarithm
        for family, figures in families():
            try:
                for name, figure in figures(run):
                    named = {family, picture_of(name, run)}
                    if drawable is not None:
                        drawable |= named
                    if only is None or not named.isdisjoint(only):
                        yield save(name, figure)
            except Exception as error:
                own = (
                    figures.__module__.partition(".")[0] == "fretwave"
                )  # what a user's file raises is no defect of ours
                if failed is None or (own and not isinstance(error, OF_RESULTS)):
                    raise
                kind = "" if own else f"{type(error).__name__}: "
                failed.append(f"no picture '{family}' of these results: {kind}{error}")


def _family(name: str) -> Family:
    return cast("Family", import_module(f"{__name__}.{name}").figures)


def picture_of(picture: str, run: Run) -> str:
    """The analysis or table that a picture shows: the longest name that its own starts with; "" for none."""
    owners = [name for name in (*run.analyses, *run.tables()) if picture == name or picture.startswith(name + "_")]
    return max(owners, key=len, default="")
