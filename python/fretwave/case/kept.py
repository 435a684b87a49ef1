"""What a run folder keeps of its case: whether its results still follow from the case, and the case itself."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..results.file import has_results, open_results
from ..results.runfolder import CASE_COPY, read_copy, read_record
from ..results.stamp import COMMON
from ..texts import display
from .analysis import AnalysisSection
from .load import Case, changed_keys, load_case
from .observed import label_of

if TYPE_CHECKING:
    import h5py

    from .component_modes import Choice

#: Of the reduction that results are on: what the number of its component modes was chosen for, where it was.
CHOSEN_FOR = "chosen_for"


def reload_case(folder: Path, kept: bool = False) -> tuple[Case, dict[str, Any]]:
    """The case of a run and its record. One rank only.

    Parameters
    ----------
    kept : bool
        Read the copy in the folder, as the run did: then only the model can have changed.

    Raises
    ------
    InputError
        The folder holds no run, or its case has changed since.
    """
    record = read_record(folder)
    refuse_sweep(folder, record)
    given = record["case"]
    path = Path(given["path"])
    text = None if path.exists() and not kept else read_copy(folder, record)
    case = load_case(path, given["overrides"], given["quick"], text=text, plugins=given.get("plugins", ()))
    changed = changed_keys(given["resolved"], case.resolved)
    if changed:
        raise InputError(
            "the case has changed since this run",
            where=display(path),
            measured="; ".join(changed[:5]) + (f"; and {len(changed) - 5} more" if len(changed) > 5 else ""),
            expected=f"the case as kept in {display(folder / CASE_COPY)}",
            fix=f"change it back, or start anew with `fretwave run {display(path)} --out {display(folder)}`",
        )
    return case, record


def refuse_sweep(folder: Path, record: Mapping[str, Any]) -> None:
    """A sweep from the command line keeps the motion in the folders of its values.

    Raises
    ------
    InputError
        The folder is that of a sweep.
    """
    if "sweep" in record:
        one = folder / record.get("values", [{}])[0].get("folder", "values/0000")
        problem = "this is the folder of a sweep, not of one run"
        raise InputError(problem, display(folder), expected="the folder of a value", fix=f"give {display(one)}")


def described(analysis: AnalysisSection, case: Case, run_id: str, beside: Sequence[str] = ()) -> dict[str, Any]:
    """Attributes every group has: the analysis' own keys, and the values that decided its results.

    Parameters
    ----------
    beside : analyses with results that its further tables stand beside
    """
    keys = analysis.model_dump(exclude={"name", "dampers", "petsc", "step", "force", "preload"})
    section = analysis.harmonic()
    observed = section.observed() if section is analysis else None
    if observed is not None:
        keys[observed[0]] = label_of(observed[1])
    plain = {key: value for key, value in keys.items() if value is not None and not isinstance(value, dict)}
    shown = {key: json.dumps(value) if isinstance(value, list) else value for key, value in plain.items()}
    reduction = {"reduction": json.dumps({**case.reduced.plain(), **_chosen_for(case)})} if case.reduced else {}
    laws = json.dumps({contact.name: contact.info.plain() for contact in case.contacts})
    stamp = _of_tables(case.resolved, _deciding(case, analysis.name).union(beside))
    return {**shown, **reduction, "laws": laws, "run_id": run_id, "case": json.dumps(stamp)}


def _chosen_for(case: Case) -> dict[str, Any]:
    """What the number of a reduced case's component modes was chosen for; empty where it was told."""
    from .component_modes import choice_of

    choice = choice_of(case)
    return {CHOSEN_FOR: [choice.asked, choice.frequencies, choice.up_to_hz]} if choice else {}


def _deciding(case: Case, name: str) -> set[str]:
    return {*COMMON, name, *case.analyses[name].decided_by()}


def _of_tables(values: Mapping[str, Any], tables: set[str]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key.split(".")[0] in tables}


@dataclass(frozen=True)
class KeptOn:
    """The reduction that results in a run folder are on.

    Attributes
    ----------
    modes : number of component modes, None of an unreduced case
    chosen_for : accuracy [-], number of frequencies and highest frequency [Hz] that this was chosen for; empty if told
    """

    modes: int | None
    chosen_for: tuple[float, ...] = ()

    def serves(self, choice: Choice) -> bool:
        """Its number was chosen for no less than a choice asks for."""
        asked, frequencies, up_to_hz = self.chosen_for or (math.inf, 0, 0.0)
        return asked <= choice.asked and frequencies >= choice.frequencies and up_to_hz >= choice.up_to_hz


def kept_on(folder: Path, case: Case, name: str) -> KeptOn | None:
    """Of finished results of an analysis that belong to a case before it is reduced; None where there are none."""
    if not has_results(folder):
        return None
    with open_results(folder / "results.h5") as file:
        if not serves(file, replace(case, reduced=None), name):
            return None
        found = json.loads(file[name].attrs.get("reduction", "{}"))
    return KeptOn(found.get("component_modes"), tuple(found.get(CHOSEN_FOR, ())))


def stands_beside(folder: Path, case: Case, name: str) -> list[str]:
    """Analyses with results in a run folder that the further tables of one stand beside. One rank only."""
    return [one for one in case.analyses[name].beside(case) if has_analysis(folder, case, one)]


def has_analysis(folder: Path, case: Case, name: str) -> bool:
    """Whether there are finished results of an analysis in a run folder that belong to this very case."""
    if not has_results(folder):
        return False
    with open_results(folder / "results.h5") as file:
        return serves(file, case, name)


def serves(file: Mapping[str, h5py.Group], case: Case, name: str) -> bool:
    """Whether others may read the results of an analysis: finished ones that belong to the case."""
    return name in file and file[name].attrs.get("status") != "running" and belongs(file[name], case, name)


def belongs(group: h5py.Group, case: Case, name: str) -> bool:
    """Whether a group's results follow from the present model, contacts and keys of the analysis.

    Of a reduced case, on as many component modes: a run may have taken more of them than were chosen.
    """
    try:
        stored, reduction = json.loads(group.attrs["case"]), json.loads(group.attrs.get("reduction", "{}"))
    except (KeyError, ValueError):
        return False
    points, modes, deciding = group["points"], case.reduced and case.reduced.component_modes, _deciding(case, name)
    same = _of_tables(stored, deciding) == _of_tables(case.resolved, deciding)
    return bool(same and modes in (None, reduction.get("component_modes", modes)) and len(next(iter(points.values()))))
