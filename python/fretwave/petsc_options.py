"""PETSc options of a case: put under the analysis' prefix, taken back after it, and refused when nothing reads them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from .errors import InputError
from .source import nearest

#: Names to suggest for a misspelt option; PETSc has many more.
COMMON = (
    *("snes_rtol", "snes_atol", "snes_stol", "snes_max_it", "snes_monitor", "snes_converged_reason"),
    *("snes_linesearch_type", "snes_type", "ksp_type", "ksp_rtol", "ksp_max_it", "ksp_monitor"),
    *("pc_type", "pc_factor_mat_solver_type", "mat_mumps_icntl_14", "ts_type", "ts_rtol", "ts_atol", "ts_monitor"),
)


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
                text,
                "'-name value' pairs",
                'for example --petsc "-snes_rtol 1e-9"',
            )
    return pairs


class AnalysisOptions:
    """Options of one analysis in PETSc's database.

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
                self.pairs[name if name.startswith(prefix) else prefix + name] = value

    @contextmanager
    def inserted(self) -> Iterator[None]:
        """The options are in the database inside."""
        from petsc4py import PETSc

        database: Any = PETSc.Options()
        for name, value in self.pairs.items():
            database.setValue(name, value)
        try:
            yield
        finally:
            for name in self.pairs:
                database.delValue(name)

    def check_used(self, unused: Callable[[], Sequence[str]], where: str) -> None:
        """Refuse options that nothing has read until the first point was solved.

        Raises
        ------
        InputError
            An option is misspelt, or belongs to a solver that is not in use.
        """
        if not self.pairs:
            return
        names = {re.split(r"[ =]", text.lstrip("-"))[0] for text in unused()}
        wrong = [name for name in self.pairs if name in names]
        if not wrong:
            return
        plain = wrong[0][len(self.prefix) :]
        raise InputError(
            f"no solver reads the PETSc option -{plain}",
            where=where,
            measured=", ".join(f"-{name[len(self.prefix) :]}" for name in wrong),
            expected="options of the solvers in use (a prefix is added by fretwave)",
            fix=nearest(plain, COMMON, "did you mean `-{}`?".format)
            or "remove it; `-snes_view` shows the solvers in use",
        )
