"""Run a case for every value of some keys, on groups of ranks.

Every value has a run folder of its own below ``values`` (of an analysis: below its name), which can be shown, viewed
and resumed like any other; from these the sweep's results are put together.
"""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..case.checks import choose
from ..case.key_units import key_units
from ..case.load import Case, load_case
from ..case.plugins import Plugin
from ..case.toml.source import Source
from ..case.uncertainty import SEEDED, draws_of
from ..console import Estimate, Shown
from ..errors import CaseErrors, FretwaveError, InputError, NotConverged
from ..model.laws import laws
from ..mpi import groups
from ..mpi.guard import on_first_rank
from ..mpi.petsc_options import said_unread
from ..mpi.petsc_share import UNREAD
from ..post.grid import Plan
from ..results.runfolder import RECORD, new_record, read_record
from ..results.sweeps import Branch, read_branch
from ..texts import counted, display
from .more_modes import line_of_values
from .order import RunOptions, in_order

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True)
class Checked:
    """What is known of a value before it runs; only the first brings more than its hash."""

    digest: str
    units: str
    resolved: dict[str, Any] = field(default_factory=dict)
    title: str = ""
    name: str = ""
    text: str = ""
    analyses: list[str] = field(default_factory=list)
    plugins: tuple[Plugin, ...] = ()
    key_units: dict[str, str] = field(default_factory=dict)


@dataclass
class Sweep:
    """The runs of a case with each combination of some keys' values.

    Attributes
    ----------
    path : Path
        The case file.
    plan : Plan
    runner : Runner, or what else runs a case
    options : RunOptions
        As for one run; `overrides` are those that all values share.
    folder : Path
        Holds the values' runs: ``0000``, ``0001``, ...
    n_groups : int
        Groups of ranks; None for as many as there are ranks and values.
    text : str
        Of the case file, when it is not to be read again.
    where : str
        Where the values were given, when not on the command line.
    places : dict
        Where the user gave overrides that all values share, when not by ``--set``.
    """

    runner: Callable[..., Any]
    path: Path
    plan: Plan
    options: RunOptions
    folder: Path
    n_groups: int | None = None
    text: str | None = None
    where: str | None = None
    places: dict[str, str] = field(default_factory=dict)
    _time: Estimate | None = None

    def check(self, comm: MPI.Comm) -> list[Checked]:
        """Load the case with every value, several at a time. Collective.

        Raises
        ------
        CaseErrors
            All that is wrong with any of them, each thing once.
        """
        groups.group_count(comm.size, len(self.plan), self.n_groups)
        try:
            found: list[Any] = [on_first_rank(comm, lambda: self._checked(0))]  # alone: others find what it caches
        except FretwaveError as error:
            found = [error]
        others = range(1, len(self.plan))
        apart = None if groups.seen_by_all(comm, self.path) else 1
        found += groups.run(comm, others, lambda k, group: on_first_rank(group, partial(self._checked, k)), apart)
        problems = self._problems(found) or self._of_units(found)
        if problems:
            raise CaseErrors(problems, f"the sweep of {display(self.path)}")
        self.plan = replace(self.plan, units=found[0].key_units)
        return found

    def run(self, comm: MPI.Comm, run_id: str) -> list[FretwaveError | None]:
        """Run every value that is not done; gives what went wrong with each. Collective."""
        numbers = range(len(self.plan))
        return groups.run(comm, numbers, lambda k, group: self._run_value(k, group, run_id), self._apart(comm))

    def _apart(self, comm: MPI.Comm) -> int | None:
        """Groups of ranks: one where not all of them see the case and the folder. Collective."""
        places = (self.path, self.folder.parent / RECORD)
        if all([groups.seen_by_all(comm, place) for place in places]):
            return self.n_groups
        self._say(comm, "not all ranks see the files of the first one: the values are run one after the other")
        return 1

    def branches(self, analysis: str, run_id: str) -> list[Branch]:
        """What was found for an analysis, in the order of the values. One rank only."""
        found = []
        for number in range(len(self.plan)):
            record = self._record(number, run_id)
            branch = read_branch(self.value_folder(number), analysis, number, record["run_id"]) if record else None
            if record and branch is not None:
                branch.draws = draws_of(record["case"]["resolved"])
                branch.peaks = record["analyses"].get(analysis, {}).get("peaks", [])
                found.append(branch)
        return found

    def outcomes(self, run_id: str, errors: Sequence[FretwaveError | None]) -> list[dict[str, Any]]:
        """Status, reason and time of each value, for run.json. One rank only."""
        found = []
        for number, (values, error) in enumerate(zip(self.plan.values(), errors)):
            record = self._record(number, run_id) or {"selected": (), "analyses": {}}
            entries = {name: entry for name, entry in record["analyses"].items() if name in record["selected"]}
            stopped = [entry["reason"] for entry in entries.values() if entry["status"] != "done"]
            reason = "; ".join(stopped) if error is None or stopped else f"{error.what}: {error.measured}"
            status = "done" if not reason and entries else "stopped" if entries else "failed"
            times = {"wall_s": round(sum(entry["wall_s"] for entry in entries.values()), 3)}
            place = f"{self.folder.name}/{number:04d}"
            found.append({"over": values, "folder": place, "status": status, "reason": reason, **times})
        return found

    def unread(self, run_id: str, elsewhere: Container[str] = (), lead: str = "") -> tuple[list[str], list[str]]:
        """PETSc options that no value's solvers have read, and lines on them. One rank only.

        Parameters
        ----------
        elsewhere : options that are told of in another place
        lead : begins the line on options of no single analysis
        """
        records = [self._record(number, run_id) for number in range(len(self.plan))]
        told = [record[UNREAD] for record in records if record is not None and UNREAD in record]
        if not told or any(record is not None and UNREAD not in record for record in records):
            return [], []  # of a value that was gone on with it is not known
        names, lines = ([one for one in told[0][key] if all(one in own[key] for own in told)] for key in told[0])
        said = said_unread([name for name in names if name not in elsewhere])
        return names, [*lines, *([lead + said] if said else [])]

    def grew(self, run_id: str) -> list[str]:
        """A line on values that have taken more component modes than were chosen, if any. One rank only."""
        return line_of_values(self._record(number, run_id) for number in range(len(self.plan)))

    def forget_others(self) -> None:
        """Remove runs of values of an earlier sweep that had more of them. One rank only."""
        for entry in self.folder.glob("[0-9]*"):
            if re.fullmatch(r"\d{4,}", entry.name) and int(entry.name) >= len(self.plan) and (entry / RECORD).exists():
                shutil.rmtree(entry)

    def value_folder(self, number: int) -> Path:
        """Run folder of a value."""
        return self.folder / f"{number:04d}"

    def _case(self, number: int) -> Case:
        overrides = [*self.options.overrides, *self.plan.overrides()[number]]
        return load_case(self.path, overrides, self.options.quick, text=self.text)

    def _checked(self, number: int) -> Checked:
        case = self._case(number)
        names = in_order(case, choose(swept_names(case), self.options.only))
        if number:
            return Checked(case.digest, case.units.name)
        units = case.units.name
        plugins, keys = case.analyses.plugins, self._key_units(case)
        return Checked(case.digest, units, case.resolved, case.title, case.name, case.text, names, plugins, keys)

    def _key_units(self, case: Case) -> dict[str, str]:
        """Of the keys that it goes through, as the first value has the case; not of those that texts are given."""
        texts = {key for values in self.plan.values() for key, value in values.items() if isinstance(value, str)}
        source = Source(case.path, case.text)
        if self.options.quick:
            source.apply_quick()
        for assignment in [*self.options.overrides, *self.plan.overrides()[0]]:
            source.apply_set(assignment)
        return key_units(source, [key for key in self.plan.keys if key not in texts], laws(), case.units)

    def _of_units(self, found: Sequence[Checked]) -> list[FretwaveError]:
        """The tables of a sweep are in one system."""
        systems = list(dict.fromkeys(one.units for one in found))
        fix = "sweep in one system; fretwave converts no numbers"
        what, measured = "a sweep goes through several unit systems", ", ".join(systems)
        return (
            [InputError(what, self.where or "--over", measured, "the same for all values", fix)] if systems[1:] else []
        )

    def _problems(self, found: Sequence[Any]) -> list[FretwaveError]:
        """Each problem once, with the first of the values that have it."""
        numbers: dict[tuple[Any, ...], list[int]] = {}
        kept: dict[tuple[Any, ...], FretwaveError] = {}
        for number, error in enumerate(found):
            for problem in getattr(error, "problems", [error] if isinstance(error, FretwaveError) else []):
                where, own = self._place(str(problem.where), number)
                same = (problem.what, str(problem.expected), None if own else (where, str(problem.measured)))
                numbers.setdefault(same, []).append(number)
                kept.setdefault(same, InputError(problem.what, where, problem.measured, problem.expected, problem.fix))
        labels = self.plan.labels()
        for same, problem in kept.items():
            count = len(numbers[same])
            if same[2] is None and count > 1:
                seen = "" if problem.measured is None else f"{problem.measured}, and "
                problem.measured = f"{seen}with {counted(count - 1, 'more value')}"
            elif same[2] is not None and count < len(self.plan):
                problem.what = f"with {labels[numbers[same][0]]}: {problem.what}"
        return list(kept.values())

    def _place(self, where: str, number: int) -> tuple[str, bool]:
        """Where the user gave what a problem is about, and whether that is the value itself."""
        if SEEDED in where:
            return where, True
        given = where[len("--set ") :] if where.startswith("--set ") else ""
        if given in self.plan.overrides()[number]:
            return self.where or f"--over {given}", True
        return self.places.get(given, where), False

    def _record(self, number: int, run_id: str) -> dict[str, Any] | None:
        """run.json of a value when it is part of this sweep."""
        folder = self.value_folder(number)
        record = read_record(folder) if (folder / RECORD).exists() else {}
        return record if record.get("part_of") == run_id else None

    def _run_value(self, number: int, group: MPI.Comm, run_id: str) -> FretwaveError | None:
        began, label = time.perf_counter(), self.plan.labels()[number]
        earlier = on_first_rank(group, lambda: self._record(number, run_id))
        if earlier is not None and earlier["status"] != "running":
            self._say(group, f"{label}: already {earlier['status']}")
            return None
        self._time = self._time or Estimate(number / len(self.plan))  # others have taken the values before
        case = on_first_rank(group, lambda: self._case(number))
        overrides = [*self.options.overrides, *self.plan.overrides()[number]]
        options = replace(self.options, out=self.value_folder(number), overrides=overrides, plots=False)
        record = earlier or group.bcast(new_record(options.given(self.path, case), group.size))
        record.update({"part_of": run_id, "ranks": group.size, "status": "running"})
        runner = self.runner(case, options, self.value_folder(number), record, group, earlier is not None, part=True)
        try:
            runner.run()
            error: NotConverged | None = None
        except NotConverged as stopped:
            error = stopped
        except FretwaveError as failed:
            self._say(group, f"{label}: failed: {failed.what}")
            raise
        word = "done" if error is None else f"stopped: {error.measured}"
        seconds, ranks = time.perf_counter() - began, counted(group.size, "rank")
        left = self._time.left((number + 1) / len(self.plan)) if number + 1 < len(self.plan) else ""
        self._say(group, f"{label}: {word} ({', '.join(filter(None, (f'{seconds:.1f} s', ranks, left)))})")
        return error

    def _say(self, group: MPI.Comm, text: str) -> None:
        """A line from a group, from its first rank."""
        if group.rank == 0 and self.options.shown > Shown.NOTHING:
            print(text, flush=True)


#: Values that stopped are named up to so many.
NAMED = 10


def why_stopped(outcomes: Sequence[dict[str, Any]]) -> dict[int, str]:
    """Reason of each value that did not come to its end, by its number."""
    return {number: outcome["reason"] for number, outcome in enumerate(outcomes) if outcome["status"] != "done"}


def why_branches_stopped(outcomes: Sequence[dict[str, Any]], branches: Sequence[Branch]) -> dict[int, str]:
    """The same of one analysis: its own reasons, and those of values that did not come to it."""
    own = {branch.number: branch.attributes for branch in branches}
    missing = {number: outcome["reason"] for number, outcome in enumerate(outcomes) if number not in own}
    stopped = {number: str(one["reason"]) for number, one in own.items() if one["status"] != "done"}
    return dict(sorted({**missing, **stopped}.items()))


def reasons_text(plan: Plan, reasons: Mapping[int, str]) -> str:
    """Why values did not come to their end, the first of them."""
    labels = plan.labels()
    more = [f"and {counted(len(reasons) - NAMED, 'more value')}"] if len(reasons) > NAMED else []
    return "; ".join([*(f"{labels[k]}: {reasons[k]}" for k in [*reasons][:NAMED]), *more])


def swept_names(case: Case) -> list[str]:
    """Analyses that a sweep may run: all but sweeps."""
    return [name for name, analysis in case.analyses.items() if not analysis.sweeps]
