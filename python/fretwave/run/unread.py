"""PETSc options that nothing in a run or a study has read: of analyses, of values of sweeps, of the environment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from ..case.load import Case
from ..mpi.petsc_options import AnalysisOptions, said_unread, unread_outside
from ..mpi.petsc_share import REDUCTION, RunWide
from .wide import run_wide


@dataclass
class UnreadOptions:
    """What has been read of a run's options so far, and what is told of the others.

    Attributes
    ----------
    read : set of str
        Options that something has read.
    in_sweeps : list of sequences of str
        What nothing has read in any value of a sweep, sweep by sweep.
    lines : list of str
        On options of single analyses.
    """

    read: set[str] = field(default_factory=set)
    in_sweeps: list[Sequence[str]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    @contextmanager
    def steering_reduction(self, wide: RunWide, reduced: bool) -> Iterator[None]:
        """The PETSc options of a reduction are in the database inside, and taken note of where there is one."""
        from .. import _core

        given = wide.reduction()
        if not reduced and not given:
            yield
            return
        options = AnalysisOptions(REDUCTION, [], RunWide(given))
        with options.inserted():
            yield
            self.read |= options.read(_core.unused_options)

    def of_analysis(self, options: AnalysisOptions) -> str:
        """Says what an analysis has not read of its own, at its end with its options still in the database."""
        from .. import _core

        self.read |= options.read(_core.unused_options)
        return options.unread(_core.unused_options)

    def line(self, name: str, said: str) -> str:
        """What was said of an analysis, which is kept."""
        self.lines.append(f"{name}: {said}")
        return self.lines[-1]

    def idle(self, wide: RunWide) -> list[str]:
        """Names of options of the whole run that no analysis has read."""
        left = [name for name in wide.of_all() if name not in self.read]
        return [name for name in left if all(name in names for names in self.in_sweeps)]

    def plain(self, wide: RunWide) -> dict[str, list[str]]:
        """For the record of a value of a sweep, which tells of all values."""
        return {"names": self.idle(wide), "lines": self.lines}

    def notes(self, wide: RunWide, of_run: bool) -> Iterator[str]:
        """Options without effect: those of the whole run, if it tells of them, and those of the environment."""
        yield from _notes(self.idle(wide) if of_run else [], wide)


@dataclass
class UnreadInStudy:
    """What none of a study's runs has read; all of them have the same options."""

    names: list[str] | None = None

    def after_run(self, options: AnalysisOptions) -> None:
        """At the end of a run, with its options still in the database."""
        from .. import _core

        left = options.without_effect(_core.unused_options)
        self.names = left if self.names is None else [name for name in self.names if name in left]

    def notes(self, case: Case, name: str) -> Iterator[str]:
        """Options without effect on the study of an analysis, and those of the environment."""
        yield from _notes(self.names or [], run_wide(case, [name]))


def _notes(names: Sequence[str], wide: RunWide) -> Iterator[str]:
    from .. import _core

    texts = (said_unread(names), unread_outside(_core.unused_options(), wide))
    yield from (f"note: {text}" for text in texts if text)
