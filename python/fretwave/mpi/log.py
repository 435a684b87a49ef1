"""Parts of Python's work by name in PETSc's -log_view, beside the core's (src/log.cpp names both)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def event(name: str) -> Iterator[None]:
    """One of those that the core has registered, inside; events may lie in one another."""
    from petsc4py import PETSc

    span = PETSc.Log.Event(name)
    span.begin()
    try:
        yield
    finally:
        span.end()
