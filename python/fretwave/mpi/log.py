"""Parts of Python's work by name in PETSc's -log_view, beside the core's (src/log.h)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def event(name: str) -> Iterator[None]:
    """An event of at most 16 letters, inside; events may lie in one another."""
    from petsc4py import PETSc

    span = PETSc.Log.Event(name)
    span.begin()
    try:
        yield
    finally:
        span.end()
