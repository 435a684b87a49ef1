"""Problems of one table of a case, gathered with their places."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..errors import FretwaveError, InputError
from ..texts import nearest, toml
from .contacts import check_dof
from .toml.source import Source
from .toml.validation import at

Found = list[FretwaveError]


class Reporter:
    """Appends problems of one table."""

    def __init__(self, source: Source, path: tuple[Any, ...], found: Found) -> None:
        self.source, self.path, self.found = source, path, found

    def wrong(self, inside: tuple[Any, ...], what: str, expected: str, fix: str) -> None:
        path = (*self.path, *inside)
        measured = at(self.source.data, path)
        self.found.append(
            InputError(
                f"{self.source.name(path)} {what}",
                self.source.where(path),
                None if measured is None else toml(measured),
                expected,
                fix,
            )
        )

    def dof(self, inside: tuple[Any, ...], dof: str, dofs: Sequence[str] | None) -> None:
        check_dof(self.source, (*self.path, *inside), dof, dofs, self.found)

    def mode(self, inside: tuple[Any, ...], name: str, modes: list[str]) -> None:
        if name not in modes:
            near = nearest(name, modes) or "add such an analysis, or name another"
            self.wrong(
                inside, "is no mode analysis of this case", f"one of {', '.join(modes) or '(there is none)'}", near
            )
