"""The folder of a study: every run that is solved is kept at once, so that a study that was cut off goes on."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..case.load import Case, changed_keys
from ..console import Console
from ..errors import InputError
from ..files.csv_table import write_rows
from ..files.whole import replace_text
from ..mpi.groups import Kept
from ..mpi.guard import on_first_rank
from ..mpi.interrupt import say_how_to_go_on
from ..results.runfolder import CASE_COPY, RunFolder, new_record, results_folder
from ..texts import display
from .unread import UnreadInStudy

if TYPE_CHECKING:
    from mpi4py import MPI


Solved = TypeVar("Solved")


class StudyFolder:
    """Lock, record and kept runs of a study; use ``with``. Collective.

    Parameters
    ----------
    arguments : sequence of str
        The command line, from which `fretwave resume` starts it again.
    record : dict, optional
        run.json of a study that is resumed.

    Raises
    ------
    InputError
        Another process writes into the folder, or the case has changed since.
    """

    def __init__(
        self,
        case: Case,
        options: argparse.Namespace,
        arguments: Sequence[str],
        comm: MPI.Comm,
        record: dict[str, Any] | None = None,
    ) -> None:
        self.path, self.comm = results_folder(options.out, f"{case.name}_study", comm), comm
        self.resumed = record is not None
        if record is None:
            told = {"overrides": options.overrides, "quick": options.quick, "only": [], "petsc": ""}
            given = {"path": str(case.path.resolve()), **told, "digest": case.digest, "resolved": case.resolved}
            record = comm.bcast(new_record(given, comm.size) if comm.rank == 0 else None)
            record["study"] = {"arguments": list(arguments)}
        else:
            _check_unchanged(self.path, case, record)
        record.update(status="running", ranks=comm.size)
        self.record = record
        self._folder = RunFolder(self.path, record, case.text, comm.rank == 0, self.resumed, options.force)
        self._kept = Kept(self.path / ".runs", str(record["run_id"]))
        on_first_rank(comm, self._folder.check_free)

    def __enter__(self) -> StudyFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.leave()

    def log(self, line: str) -> None:
        """A line of run.log."""
        self._folder.log(line)

    def solved(self, number: int, kind: type[Solved], solve: Callable[[], Solved | str]) -> Solved | str:
        """What a run found before, else what it finds now: a dataclass, or why there is none. Collective."""
        found = on_first_rank(self.comm, lambda: self._kept.load(number))
        if found is not None:
            return str(found["failure"]) if "failure" in found else kind(**found)
        new = solve()

        def keep() -> None:
            self._folder.start()
            plain: Any = new
            self._kept.save(number, {"failure": new} if isinstance(new, str) else dataclasses.asdict(plain))

        on_first_rank(self.comm, keep)
        say_how_to_go_on(self.comm, self.path)
        return new

    def finish(self, write: Callable[[Path], None]) -> None:
        """Write the tables, and when all are there say that the study is done. Collective."""

        def work() -> None:
            self._folder.start()
            write(self.path)
            self.record["status"] = "done"
            self._folder.close()

        on_first_rank(self.comm, work)


def publish(folder: Path, tables: Mapping[str, Sequence[Mapping[str, Any]]], text: str, console: Console) -> None:
    """Write a study's tables, ``study.csv`` the first, its text and its pictures, and say what there is. One rank only.

    Parameters
    ----------
    tables : rows by the table's name; pictures are those of the same names
    text : Markdown
    """
    from ..plots import plot_run

    for name, rows in tables.items():
        write_rows(folder / f"{name}.csv", rows)
    replace_text(folder / "study.md", text)
    pictures = plot_run(folder, list(tables))
    for line in text.splitlines():
        console.line(line)
    first, *others = (folder / f"{name}.csv" for name in tables)
    console.line(f"written: {', '.join(str(path) for path in (first, folder / 'study.md', *others, *pictures))}")


def say_unread(unread: UnreadInStudy, case: Case, name: str, folder: StudyFolder, console: Console) -> None:
    """PETSc options without effect, once for all runs; of runs that were kept nothing is known."""
    for note in () if folder.resumed else unread.notes(case, name):
        console.line(note)


def _check_unchanged(path: Path, case: Case, record: dict[str, Any]) -> None:
    changed = changed_keys(record["case"]["resolved"], case.resolved)
    if changed:
        raise InputError(
            "the case has changed since this study",
            display(path),
            "; ".join(changed[:5]),
            f"the case as kept in {display(path / CASE_COPY)}",
            "change it back, or start the study anew",
        )
