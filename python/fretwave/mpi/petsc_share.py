"""Which analyses of a run a PETSc option is for: named by its prefix, or all whose solvers read such options."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..case.analysis import AnalysisSection

#: Beginnings of options that no analysis owns: tuned constants, linear modes, static states, bases, the reduction.
SHARED = re.compile(r"fw_|static_|stuck_|component_|modes_(eps|pep|st|bv|count)_")
#: Of them the tuned constants (`fretwave doctor --constants`).
TUNED = "fw_"
#: Of them what a reduction reads, before all analyses.
REDUCTION = "component_"
#: What follows a motion in time.
TIME_KIND = "time"
#: What options of the time integration that checks a response begin with, behind its analysis' own prefix.
TIME = "time_"
HARMONIC_KIND = "harmonics"
#: What options of such an analysis begin with, by its kind.
READ_BY = {
    HARMONIC_KIND: re.compile(r"(route|blocks)$|(snes|ksp|pc|mat|tangent|whole|npc)_"),
    TIME_KIND: re.compile(r"(ts|mass)_"),
}
#: Of the record of a sweep's value: names that nothing has read, and lines on single analyses.
UNREAD = "petsc_unread"
#: What PETSc reads as it starts, before a case is known.
AT_START = re.compile(
    r"(malloc|info|fp_trap|options_(left|view|monitor|file|string_file)|on_error|start_in_debugger|debugger|stop_for|no_signal"
    r"|mpi_return|error_output|memory_view|log_(all|trace|exclude|sync|mpe|summary|perfstubs)|get_total|check_pointer"
    r"|skip_petscrc|saws|history|version|shared_tmp|not_shared_tmp|use_gpu|device_enable|petsc_ci|citations|mpidump"
    r"|objects_dump)(?!_(snes|ksp|pc|ts|mat|route|blocks|tangent|whole|npc|mass|time)(_|$))(_|$)"  # an analysis' name
)


def choosing(
    wide: Sequence[tuple[str, str | None]], own: Sequence[tuple[str, str | None]], prefix: str, known: Sequence[str]
) -> dict[str, str | None]:
    """Options of an analysis that choose its solvers, without its prefix: the run's that are its alone, then its own.

    Of the prefixes of all analyses (`known`) one may begin with another.
    """
    mine = [pair for pair in wide if owner(pair[0], known) == prefix]
    plain = {name.removeprefix(prefix): value for name, value in [*mine, *own]}
    return {name: value for name, value in plain.items() if name in ("route", "blocks") or name.endswith("_type")}


def prefix_of(name: str) -> str:
    """Prefix of the options of the analysis of this name."""
    return name.replace("-", "_") + "_"


def kind_of(analysis: AnalysisSection) -> str:
    """By what an analysis solves: in time, by harmonic balance, or by neither."""
    if analysis.integrates() == "type":
        return TIME_KIND
    return HARMONIC_KIND if analysis.harmonic() is not None or analysis.wears else ""


def owner(name: str, prefixes: Sequence[str]) -> str:
    """The longest prefix that an option has, empty where it has none."""
    return max((prefix for prefix in prefixes if name.startswith(prefix)), key=len, default="")


@dataclass(frozen=True)
class RunWide:
    """Options that are given for a whole run (``--petsc``), of all its analyses.

    Attributes
    ----------
    pairs : sequence of (name, value)
        As they were given.
    kinds : dict
        Kind of each analysis that runs by its prefix, in their order.
    others : sequence of str
        Prefixes of the case's analyses that do not run: what is theirs is nobody else's.
    own : dict
        Options of each analysis alone by its prefix, as far as they choose its solvers (`choosing`).
    read : set of str
        Options that analyses before have read.
    """

    pairs: Sequence[tuple[str, str | None]] = ()
    kinds: Mapping[str, str] = field(default_factory=dict)
    others: Sequence[str] = ()
    own: Mapping[str, Mapping[str, str | None]] = field(default_factory=dict)
    read: Container[str] = ()

    @property
    def known(self) -> tuple[str, ...]:
        """Prefixes of all analyses of the case."""
        return (*self.kinds, *self.others)

    def of(self, prefix: str, whole: Sequence[str] = ()) -> Iterator[tuple[str, str | None]]:
        """Full names and values for one analysis; what is given to it alone comes last, and wins."""
        last = []
        for name, value in self.pairs:
            mine = owner(name, (prefix, *self.known))
            if mine == prefix:
                last.append((name, value))
            elif name in whole or SHARED.match(name):
                yield name, value
            elif not mine:
                yield prefix + name, value
        yield from last

    def reduction(self) -> list[tuple[str, str | None]]:
        """What a reduction reads."""
        return [(name, value) for name, value in self.pairs if name.startswith(REDUCTION)]

    def of_all(self) -> list[str]:
        """Names that are not of one analysis alone that runs: these tell their own."""
        return [name for name, _ in self.pairs if SHARED.match(name) or owner(name, self.known) not in self.kinds]

    def left_to_others(self, prefix: str, name: str) -> bool:
        """An option without any prefix, full name here, is for other analyses: nothing here has to read it."""
        plain, kind = name.removeprefix(prefix), self.kinds.get(prefix, "")
        if SHARED.match(name) and not name.startswith(prefix):
            return not name.startswith(TUNED)
        if plain not in dict(self.pairs):
            return False
        if plain.startswith(TIME):
            return True
        others = {its for other, its in self.kinds.items() if other != prefix and its != kind}
        return self._of_like_ones(prefix, plain) or any(its in others and r.match(plain) for its, r in READ_BY.items())

    def _of_like_ones(self, prefix: str, plain: str) -> bool:
        """Analyses of its kind before it have seen to it, or one after it that has solvers of its own will."""
        like = [other for other, its in self.kinds.items() if its == self.kinds.get(prefix)]
        place = like.index(prefix) if prefix in like else 0
        solvers = [self.own.get(other) for other in like]
        later = any(one not in solvers[: place + 1] for one in solvers[place + 1 :])
        return self.own.get(prefix) in solvers[:place] or later or (place > 0 and plain in self.read)
