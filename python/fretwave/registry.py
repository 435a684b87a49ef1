"""Kinds of analysis by name: those of the package, a file each in `fretwave.analyses`, and those that users add.

What a case names, results keep the name of, and pictures and tables ask about: so the list lies below all of them. It
knows no kind itself; the package's are imported when first asked for, each by its name.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, Optional

from .errors import InputError

if TYPE_CHECKING:
    from .case.analysis import AnalysisSection

ANALYSIS, LAW, FORMAT = "type of analysis", "contact law", "format of matrices"
#: What was added, and its class or function.
Added = tuple[str, Any]

_registered: dict[str, type[AnalysisSection]] = {}
_noting: list[list[Added]] = []


def kinds() -> dict[str, type[AnalysisSection]]:
    """All kinds of analysis by the `type` that a case gives them: the package's, then others as they were added."""
    own = _own()
    for name in own:
        kind_named(name)
    return {name: _registered[name] for name in (*own, *(name for name in _registered if name not in own))}


def kind_named(name: str) -> Optional[type[AnalysisSection]]:
    """The kind of this name; None where it is not known here (results may come from elsewhere)."""
    if name in _own():
        import_module(f"fretwave.analyses.{name}")
    return _registered.get(name)


@cache
def _own() -> tuple[str, ...]:
    names: tuple[str, ...] = import_module("fretwave.analyses").KINDS
    return names


def add(name: str, kind: type[AnalysisSection]) -> None:
    """Make a kind known; the same file may bring it again.

    Raises
    ------
    InputError
        Another file has brought one of this name.
    """
    kind_named(name)  # the package's own comes before another of its name
    admit(ANALYSIS, name, _registered, kind)
    _registered[name] = kind


def forget(kind: type[AnalysisSection]) -> None:
    """The inverse of `add`."""
    for name in [name for name, known in _registered.items() if known is kind]:
        del _registered[name]


@contextmanager
def noted() -> Iterator[list[Added]]:
    """Note all that is added meanwhile."""
    added: list[Added] = []
    _noting.append(added)
    try:
        yield added
    finally:
        _noting.remove(added)


def admit(what: str, name: str, known: Mapping[str, Any], new: type | Callable[..., Any]) -> None:
    """Let a class or function have a name, unless another file has given it to something else."""
    if name in known and file_of(known[name]) != file_of(new):
        places = f"{file_of(known[name])} and {file_of(new)}"
        raise InputError(f"two files register a {what} '{name}'", file_of(new), places, "each name once", "rename one")
    if any(one is known.get(name) is not new for added in _noting for _, one in added):
        what = f"the file registers a {what} '{name}' twice"
        raise InputError(what, file_of(new), name, "each name once", "rename or remove one")
    if new.__module__.partition(".")[0] == __package__:
        return  # the package's own stay, whoever asked for them first
    for added in _noting:
        added.append((what, new))


def file_of(kind: type | Callable[..., Any]) -> str:
    """The file that defines a class or function, else its module's name."""
    try:
        return inspect.getfile(kind)
    except (OSError, TypeError):
        return str(kind.__module__)
