"""Parts of Python's work by name in PETSc's -log_view, beside the core's (src/log.h)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

#: Their names, of at most 16 letters.
EVENTS = ("FwPoint", "FwRecord", "FwTable", "FwCurve")


def register_events() -> None:
    """All at once, on all ranks: PETSc's nested formats tell events by their numbers, which must be the same there.

    Each place in the tree of such a format takes a number too, and on one rank there may be more of them: what is
    registered behind these would be told as "1198 -> 31", its part of that rank apart from those of the others.
    """
    from petsc4py import PETSc

    for name in EVENTS:
        PETSc.Log.Event(name)


@contextmanager
def event(name: str) -> Iterator[None]:
    """One of these, inside; events may lie in one another."""
    from petsc4py import PETSc

    span = PETSc.Log.Event(name)
    span.begin()
    try:
        yield
    finally:
        span.end()
