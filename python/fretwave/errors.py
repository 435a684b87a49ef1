"""Errors a user can act on: what, where, measured against expected, and one line that says what to do."""

from __future__ import annotations

from collections.abc import Sequence

EXIT_DONE = 0
EXIT_OTHER = 1
EXIT_BAD_INPUT = 2
EXIT_NOT_CONVERGED = 3
#: Told to end, by Ctrl-C or otherwise: as shells count SIGINT. Open MPI's mpirun answers 1 to its own Ctrl-C.
EXIT_INTERRUPTED = 130
#: Nobody reads the output any more: as shells count SIGPIPE.
EXIT_UNREAD = 141
#: Of a message: longer values are cut.
LONGEST_LINE = 1000


class FretwaveError(Exception):
    """Base of all errors raised on purpose.

    Parameters
    ----------
    what : str
        One sentence: what is wrong.
    where : str, optional
        ``file:line``, rank, continuation point: whatever finds the spot.
    measured, expected : object, optional
        The value found and the value wanted, as a user would write them.
    fix : str, optional
        One line: what to do about it.
    """

    exit_code = EXIT_OTHER
    advice = "fix"

    def __init__(
        self,
        what: str,
        where: str | None = None,
        measured: object = None,
        expected: object = None,
        fix: str | None = None,
    ) -> None:
        super().__init__(what, where, measured, expected, fix)
        self.what = what
        self.where = where
        self.measured = measured
        self.expected = expected
        self.fix = fix

    def body(self) -> str:
        """The message without its leading ``error:``."""
        rows = [
            ("where", self.where),
            ("measured", self.measured),
            ("expected", self.expected),
            (self.advice, self.fix),
        ]
        lines = [f"  {label + ':':<10}{_said(value)}" for label, value in rows if value is not None]
        return "\n".join([_said(self.what), *lines])

    def render(self) -> str:
        """The whole message as printed."""
        return f"error: {self.body()}"

    def __str__(self) -> str:
        return self.body()


def _said(value: object) -> str:
    """As a terminal can bear it: what a user wrote may be long, or hold control characters."""
    text = str(value)
    text = text if len(text) <= LONGEST_LINE else text[: LONGEST_LINE - 3] + "..."
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


class InputError(FretwaveError):
    """Something the user gave (case file, option, matrix, argument) is wrong."""

    exit_code = EXIT_BAD_INPUT


class NothingMoves(InputError):
    """Contact that sticks leaves no degree of freedom to move, so that the modes with it are none."""


class NotConverged(FretwaveError):
    """A solver stopped early; what was found until then is kept."""

    exit_code = EXIT_NOT_CONVERGED
    advice = "try"


class PetscError(FretwaveError):
    """A call of PETSc, SLEPc or MUMPS failed; `petsc_options` tells whether an option of the user did it."""


class CaseErrors(InputError):
    """All that is wrong with one case file, reported at once.

    Parameters
    ----------
    problems : sequence of FretwaveError
        At least one.
    subject : str
        What they were found in, as a user would name it (``cases/two_dof/case.toml``).
    """

    def __init__(self, problems: Sequence[FretwaveError], subject: str) -> None:
        self.problems = list(problems)
        self.subject = subject
        first = self.problems[0]
        super().__init__(first.what, first.where, first.measured, first.expected, first.fix)
        # Pickled to the other ranks: the arguments of this class, not of its parent.
        self.args = (self.problems, subject)

    def render(self) -> str:
        if len(self.problems) == 1:
            return self.problems[0].render()
        head = f"error: {len(self.problems)} things are wrong in {self.subject}"
        numbered = [f"{number}. {problem.body()}" for number, problem in enumerate(self.problems, 1)]
        return "\n\n".join([head, *numbered])

    def __str__(self) -> str:
        return self.render()


def exit_code_of(error: BaseException) -> int:
    """The process exit code that belongs to an exception."""
    if isinstance(error, KeyboardInterrupt):
        return EXIT_INTERRUPTED
    if isinstance(error, BrokenPipeError):
        return EXIT_UNREAD
    return error.exit_code if isinstance(error, FretwaveError) else EXIT_OTHER
