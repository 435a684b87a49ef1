"""PETSc options of a case: put under the analysis' prefix, taken back after it, and refused when nothing reads them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from ..errors import InputError, PetscError
from ..texts import nearest, shortened

#: Names to suggest for a misspelt option; PETSc has many more.
COMMON = (
    *("snes_rtol", "snes_atol", "snes_stol", "snes_max_it", "snes_monitor", "snes_converged_reason"),
    *("snes_linesearch_type", "snes_type", "ksp_type", "ksp_rtol", "ksp_max_it", "ksp_monitor"),
    *("pc_type", "pc_factor_mat_solver_type", "mat_mumps_icntl_14", "ts_type", "ts_rtol", "ts_atol", "ts_monitor"),
)


#: Options of PETSc itself, which it reads at its end: the same for all analyses.
LOGS = ("log_view", "log_view_memory")
#: Formats of the former that say what was called by what.
NESTED = ("ascii_xml", "ascii_flamegraph")
#: With that by which every solver lists its options as it is made, ours among them.
WHOLE = (*LOGS, "help")
#: What options of the time integration that checks a response begin with, behind its analysis' own prefix.
TIME = "time_"
#: What tuned constants of the core begin with: no analysis' own (`fretwave doctor --constants`).
TUNED = "fw_"

#: What a complaint of PETSc says of the value it wants.
WANTED = (
    ("no numeric value", "a number"),
    ("no integer value", "a whole number of 32 bits"),
    ("logical value", "true or false"),
    ("nable to find|nknown type|not found|nknown option", "a name that PETSc knows (its manual lists them)"),
    ("pen file|pen viewer", "a file that can be opened"),
)


#: Options whose value PETSc takes as it comes: what their name ends with, what is right, and in words.
RULES: tuple[tuple[str, Callable[[float], bool], str], ...] = (
    ("_rtol", lambda value: 0 <= value < 1, "a number from 0 to below 1"),
    ("_atol", lambda value: 0 <= value < math.inf, "a finite number from 0 up"),
    ("_stol", lambda value: 0 <= value < math.inf, "a finite number from 0 up"),
    ("_max_it", lambda value: value >= 0 and value == int(value), "a whole number from 0 up"),
    ("_max_steps", lambda value: value >= 0 and value == int(value), "a whole number from 0 up"),
    ("ts_dt", lambda value: 0 < value < math.inf, "a finite number above 0"),
)


def complaint(name: str, value: str | None) -> str | None:
    """What was expected of an option's value; None when it may be right."""
    if name.endswith("_type") and value is None:
        return "the name of a type"
    rules = (
        ((name, lambda value: 0 < value < math.inf, "a finite number above 0"),) if name.startswith(TUNED) else RULES
    )
    for ending, right, expected in rules:
        if name.endswith(ending):
            try:
                return None if value is not None and right(float(value)) else expected
            except (ValueError, OverflowError):
                return expected
    return None


def parse(text: str) -> list[tuple[str, str | None]]:
    """``-name value -flag`` as pairs; a negative number is a value."""
    pairs: list[tuple[str, str | None]] = []
    for word in text.split():
        if re.match(r"-[A-Za-z_]", word):
            pairs.append((word.lstrip("-"), None))
        elif pairs and pairs[-1][1] is None:
            pairs[-1] = (pairs[-1][0], word)
        else:
            raise InputError(
                "these are no PETSc options",
                "--petsc",
                shortened(text),
                "'-name value' pairs",
                'for example --petsc "-snes_rtol 1e-9"',
            )
    for name, value in pairs:
        expected = complaint(name, value)
        if expected is not None:
            raise InputError(
                f"the PETSc option -{name} has a wrong value",
                "--petsc, or petsc = ... of an analysis",
                f"-{name} {shortened(value or '')}".strip(),
                expected,
                "correct the value, or remove the option",
            )
    return pairs


class AnalysisOptions:
    """Options of one analysis in PETSc's database; its work is a stage of -log_view by its name.

    Parameters
    ----------
    prefix : str
        Put before every name that has it not yet.
    texts : sequence of str
        Option strings, the later one wins.
    """

    def __init__(self, prefix: str, texts: Sequence[str]) -> None:
        self.prefix = prefix
        self.pairs = {}
        for text in texts:
            for name, value in parse(text):
                own = name if name in WHOLE or name.startswith((prefix, TUNED)) else prefix + name
                self.pairs[own] = value

    @contextmanager
    def inserted(self) -> Iterator[None]:
        """The options are in the database inside."""
        from petsc4py import PETSc

        from .._core import begin_log

        database: Any = PETSc.Options()
        for name, value in self.pairs.items():
            database.setValue(name, value)
        if not set(LOGS).isdisjoint(self.pairs):
            begin_log(not set((self.pairs.get("log_view") or "").split(":")).isdisjoint(NESTED))
        stage = PETSc.Log.Stage(self.prefix.rstrip("_"))
        stage.push()
        try:
            yield
        except (PetscError, PETSc.Error) as error:
            if not self.pairs:
                raise
            raise self._blamed(str(error).rstrip().splitlines()[-1]) from error
        finally:
            stage.pop()
            for name in self.pairs:
                if name not in LOGS:
                    database.delValue(name)

    def _blamed(self, complaint: str) -> InputError:
        """PETSc failed under the user's options: the one that its complaint speaks of, or all."""
        plain = {name.removeprefix(self.prefix): value or "" for name, value in self.pairs.items()}
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
        wrong = [name for name in self._unread(unused) if not (later and name.startswith(self.prefix + later))]
        if not wrong:
            return
        plain = wrong[0].removeprefix(self.prefix)
        raise InputError(
            f"no solver reads the PETSc option -{plain}",
            where=where,
            measured=", ".join(f"-{name.removeprefix(self.prefix)}" for name in wrong),
            expected="options of the solvers in use (a prefix is added by fretwave)",
            fix="remove it: this solver is not in use here (`-snes_view` shows those that are)"
            if plain in COMMON
            else nearest(plain, (*COMMON, *_tuned()), "did you mean `-{}`?".format)
            or "remove it; `-snes_view` shows the solvers in use",
        )

    def unread(self, unused: Callable[[], Sequence[str]]) -> str:
        """Says at the end which options no solver has read; empty where all were."""
        names = [f"-{name.removeprefix(self.prefix)}" for name in self._unread(unused)]
        return f"PETSc options that no solver has read: {', '.join(names)}" if names else ""

    def _unread(self, unused: Callable[[], Sequence[str]]) -> list[str]:
        """Names of options that nothing has read; tuned constants are read where they come in, or never."""
        if not self.pairs:
            return []
        names, tuned = {re.split(r"[ =]", text.lstrip("-"))[0] for text in unused()}, _tuned()
        return [name for name in self.pairs if name in names and name not in WHOLE and name not in tuned]


def _tuned() -> set[str]:
    """Names of the core's tuned constants."""
    from .. import _core

    return {option for option, _, _ in _core.tuned_constants()}
