"""What is in a run folder already: what this run has done, and results of earlier runs that its analyses read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..case.component_modes import choice_of
from ..case.kept import KeptOn, kept_on
from ..case.load import Case
from ..errors import InputError
from ..mpi.guard import on_first_rank
from ..results.results import has_results, open_results
from ..texts import display
from .more_modes import GREW, grown, on_these

if TYPE_CHECKING:
    from mpi4py import MPI


def status_of(name: str, folder: Path, record: Mapping[str, Any]) -> str | None:
    """Of what this run has of an analysis in its results, None for nothing. One rank only."""
    if not has_results(folder):
        return None
    with open_results(folder / "results.h5") as file:
        found = file[name].attrs if name in file else {}
        mine = found.get("run_id") == record["run_id"] and on_these(record, found)
        return str(found.get("status")) if mine else None


def check_needed(case: Case, names: Sequence[str], folder: Path, modes: int | None) -> None:
    """Analyses whose results another needs: of this run, or kept in the folder. One rank only.

    Parameters
    ----------
    modes : component modes that the run takes, None where that is not known or it reduces nothing

    Raises
    ------
    InputError
        There are no results, or they are on another number of component modes.
    """
    for name in names:
        for needed in _others(case.analyses[name].needs(), names):
            found = kept_on(folder, case, needed)
            if found is not None and (modes is None or found.modes in (None, modes)):
                continue
            none = f"no finished results of '{needed}' for this case in {display(folder)}"
            raise InputError(
                f"'{name}' needs the results of '{needed}'",
                where="--only",
                measured=none if found is None else f"those in {display(folder)} are on {found.modes} component modes",
                expected=None if found is None else f"{modes}, as the other results of this run are on",
                fix=f"--only {needed},{name}",
            )


def take_modes_of_others(
    case: Case, names: Sequence[str], folder: Path, record: dict[str, Any], comm: MPI.Comm
) -> None:
    """Into the record: as many component modes as the results that these analyses read are on. Collective.

    Raises
    ------
    InputError
        Results that are needed are on several numbers.
    """
    entry = on_first_rank(comm, lambda: _modes_of_others(case, names, folder))
    if entry is not None:
        record[GREW] = [entry]
        on_first_rank(comm, lambda: check_needed(case, names, folder, grown(record)))


def _modes_of_others(case: Case, names: Sequence[str], folder: Path) -> dict[str, Any] | None:
    """The number of component modes that results in the folder are on, where a run chooses it. One rank only.

    Of those that are needed, else of those that are compared with; the largest. None where there are none, or where
    their number was chosen for less than the case asks for now.
    """
    choice = choice_of(case) if case.reduction is not None else None
    if choice is None:
        return None
    analyses = [case.analyses[name] for name in names]
    needed = {one: kept_on(folder, case, one) for each in analyses for one in _others(each.needs(), names)}
    compared = {one: kept_on(folder, case, one) for each in analyses for one in _others(each.compares_with(), names)}
    entry = _largest({one: kept for one, kept in needed.items() if kept is not None and kept.serves(choice)})
    if entry is not None:
        return {**entry, "needed": True}
    return _largest({one: kept for one, kept in compared.items() if kept is not None and kept.serves(choice)})


def _others(read: Sequence[str], names: Sequence[str]) -> list[str]:
    return [one for one in read if one not in names]


def _largest(found: Mapping[str, KeptOn]) -> dict[str, Any] | None:
    """Entry for run.json."""
    one = max(found, key=lambda name: found[name].modes or 0, default=None)
    return None if one is None else {"analysis": one, "taken": found[one].modes}
