"""PETSc options of a case: put under the analysis' prefix, taken back after it, and refused when nothing reads them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from ..errors import InputError, PetscError
from ..texts import nearest, shortened
from .petsc_share import AT_START, SHARED, TIME, RunWide, owner
from .petsc_time import unread_in_time
from .petsc_values import ENVIRONMENT, check_value, names_of, parse

#: Names to suggest for a misspelt option; PETSc has many more.
COMMON = (
    *("snes_rtol", "snes_atol", "snes_stol", "snes_max_it", "snes_monitor", "snes_converged_reason"),
    *("snes_linesearch_type", "snes_type", "ksp_type", "ksp_rtol", "ksp_max_it", "ksp_monitor"),
    *("route", "blocks", "pc_type", "pc_factor_mat_solver_type", "mat_mumps_icntl_14"),
    *("ts_type", "ts_rtol", "ts_atol", "ts_monitor"),
)


#: Options of PETSc itself, which it reads at its end: the same for all analyses.
LOGS = ("log_view", "log_view_memory")
#: Formats of the former that say what was called by what.
NESTED = ("ascii_xml", "ascii_flamegraph")
#: With that by which every solver lists its options as it is made, ours among them.
WHOLE = (*LOGS, "help")

#: What a complaint of PETSc says of the value it wants.
WANTED = (
    ("no numeric value", "a number"),
    ("no integer value", "a whole number of 32 bits"),
    ("logical value", "true or false"),
    ("nable to find|nknown type|not found|nknown option", "a name that PETSc knows (its manual lists them)"),
    ("pen file|pen viewer", "a file that can be opened"),
)


def outside() -> dict[str, str | None]:
    """What stands in PETSc's database: from PETSC_OPTIONS, .petscrc or a script."""
    from petsc4py import PETSc

    database: Any = PETSc.Options()
    return {name: value or None for name, value in database.getAll().items()}


class AnalysisOptions:
    """Options of one analysis in PETSc's database; its work is a stage of -log_view by its name.

    Parameters
    ----------
    prefix : str
        Put before every name that has it not yet.
    texts : sequence of str
        Option strings, the later one wins.
    wide : RunWide
        What is given for all analyses of a run; `texts` win.
    """

    def __init__(self, prefix: str, texts: Sequence[str], wide: RunWide | None = None) -> None:
        self.prefix, self.wide = prefix, wide or RunWide()
        self.pairs = dict(self.wide.of(prefix, WHOLE))
        #: What was in the database before and is read here too.
        self.outside: dict[str, str | None] = {}
        for text in texts:
            for name, value in parse(text):
                own = name if name in WHOLE or name.startswith(prefix) or SHARED.match(name) else prefix + name
                self.pairs[own] = value

    @contextmanager
    def inserted(self) -> Iterator[None]:
        """The options are in the database inside."""
        from petsc4py import PETSc

        from .._core import begin_log

        database: Any = PETSc.Options()
        before = outside()
        self._take_up(before)
        for name, value in self.pairs.items():
            database.setValue(name, value)
        if not set(LOGS).isdisjoint(self.pairs):
            begin_log(not set((self.pairs.get("log_view") or "").split(":")).isdisjoint(NESTED))
        stage = PETSc.Log.Stage(self.prefix.rstrip("_"))
        stage.push()
        try:
            yield
        except (PetscError, PETSc.Error) as error:
            if not self.given:
                raise
            raise self._blamed(str(error).rstrip().splitlines()[-1]) from error
        finally:
            stage.pop()
            for name in self.pairs:
                if name in before:
                    database.setValue(name, before[name])
                elif name not in LOGS:
                    database.delValue(name)

    @property
    def given(self) -> dict[str, str | None]:
        """All that the solvers of this analysis may read."""
        return {**self.outside, **self.pairs}

    def _take_up(self, before: Mapping[str, str | None]) -> None:
        """Options of the environment that are this analysis' or shared: held to the same rules as its own."""
        prefixes = (self.prefix, *self.wide.known)
        mine = {n: v for n, v in before.items() if owner(n, prefixes) == self.prefix or SHARED.match(n)}
        for name, value in mine.items():
            if name not in self.pairs:
                check_value(name, value, ENVIRONMENT)
                self.outside[name] = value

    def _blamed(self, complaint: str) -> InputError:
        """PETSc failed under the user's options: the one that its complaint speaks of, or all."""
        plain = {name.removeprefix(self.prefix): value or "" for name, value in self.given.items()}
        words = re.split(r"[\s,;:'\"()]+", complaint)
        named = [name for name, value in plain.items() if name in words or (value and value in words)]
        shown = named or list(plain)
        wanted = next((text for rule, text in WANTED if re.search(rule, complaint)), None)
        bound = re.search(r"must be ([\w<>=. -]+)", complaint)
        return InputError(
            f"PETSc does not take {' or '.join(f'-{name}' for name in shown)}"
            + ("" if len(shown) == 1 else " (one of them, or all together)"),
            where=f"PETSc options of '{self.prefix.rstrip('_')}'",
            measured=shortened(" ".join(f"-{name} {plain[name]}".strip() for name in shown)),
            expected=wanted
            or (f"a value that is {bound.group(1).strip(' .')}" if bound else "what the solvers in use can do"),
            fix="correct the value, or remove the option",
        )

    def check_used(self, unused: Callable[[], Sequence[str]], where: str, later: str = "") -> None:
        """Refuse options that nothing has read until the first point was solved.

        Those that begin with `later`, if that is given, are of a solver that comes in after all points.

        Raises
        ------
        InputError
            An option is misspelt, or belongs to a solver that is not in use.
        """
        wrong = [
            name
            for name in self._unread(unused)
            if not (later and name.startswith(self.prefix + later)) and not self.wide.left_to_others(self.prefix, name)
        ]
        if wrong:
            raise self._without_reader(wrong, where)

    def check_in_time(self, where: str, whole: bool) -> None:
        """Refuse misspelt options of a time integration before anything is solved: of the `whole` analysis, or a part.

        Raises
        ------
        InputError
            As of `check_used`.
        """
        plain = {self._plain(name): value for name, value in self.pairs.items() if name.startswith(self.prefix)}
        begin = "" if whole else TIME
        given = {name.removeprefix(begin): value for name, value in plain.items() if name.startswith(begin)}
        wrong = unread_in_time(given)
        if wrong:
            raise self._without_reader([begin + name for name in wrong], where)

    def _without_reader(self, wrong: Sequence[str], where: str) -> InputError:
        plain = wrong[0].removeprefix(self.prefix)
        begin = TIME if plain.startswith(TIME) else ""
        return InputError(
            f"no solver reads the PETSc option -{plain}",
            where=where,
            measured=", ".join(f"-{name.removeprefix(self.prefix)}" for name in wrong),
            expected="options of the solvers in use (a prefix is added by fretwave)",
            fix="remove it: this solver is not in use here (`-snes_view` shows those that are)"
            if plain in COMMON
            else nearest(plain.removeprefix(begin), (*COMMON, *_tuned()), f"did you mean `-{begin}{{}}`?".format)
            or "remove it; `-snes_view` shows the solvers in use",
        )

    def unread(self, unused: Callable[[], Sequence[str]]) -> str:
        """Says at the end which options no solver has read; empty where all were, or may be by other analyses."""
        return said_unread(self.without_effect(unused))

    def without_effect(self, unused: Callable[[], Sequence[str]]) -> list[str]:
        """Names, without the prefix, of options that no solver has read and that are for no other analysis."""
        own = {name for name in self.pairs if SHARED.match(name)} - {name for name, _ in self.wide.pairs}
        left = [name for name in self._unread(unused) if name in own or not self.wide.left_to_others(self.prefix, name)]
        return [self._plain(name) for name in left]

    def read(self, unused: Callable[[], Sequence[str]]) -> set[str]:
        """Names, as they were given, of what solvers have read here."""
        return {one for name in {*self.given} - {*self._unread(unused)} for one in (name, self._plain(name))}

    def _plain(self, name: str) -> str:
        return name.removeprefix(self.prefix)  # of an analysis that is named like a shared one, too

    def _unread(self, unused: Callable[[], Sequence[str]]) -> list[str]:
        """Names of options that nothing has read; tuned constants are read where they come in, or never."""
        if not self.given:
            return []
        names, tuned = set(names_of(unused())), _tuned()
        return [name for name in self.given if name in names and name not in WHOLE and name not in tuned]


def said_unread(names: Sequence[str], of: str = "") -> str:
    """Empty where there are none."""
    return f"PETSc options{of} that no solver has read: {', '.join(f'-{name}' for name in names)}" if names else ""


def unread_outside(unused: Sequence[str], wide: RunWide) -> str:
    """Says at the end of a run which options of the environment nothing has read; empty where all were."""
    tuned = _tuned()
    names = [
        name
        for name in names_of(unused)
        if name not in WHOLE and name not in tuned and not AT_START.match(name) and not owner(name, wide.known)
    ]
    example = "" if names and SHARED.match(names[0]) else next(iter(wide.kinds), "")
    own = f" (an analysis' own begin with its name: -{example}{names[0]})" if names and example else ""
    return said_unread(names, f" of {ENVIRONMENT},") + own if names else ""


def _tuned() -> set[str]:
    """Names of the core's tuned constants."""
    from .. import _core

    return {option for option, _, _ in _core.tuned_constants()}
