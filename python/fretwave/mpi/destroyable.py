"""What owns objects of PETSc: Python frees nothing of it by itself, for it does not collect on all ranks at a time."""

from __future__ import annotations

from contextlib import ExitStack
from types import TracebackType
from typing import NoReturn, Protocol, TypeVar

from ..errors import FretwaveError, InputError

Own = TypeVar("Own", bound="Destroyable")


class HasDestroy(Protocol):
    """A vector, matrix or solver of PETSc, or what owns some."""

    def destroy(self) -> object: ...


Thing = TypeVar("Thing", bound=HasDestroy)


class Owned(ExitStack):
    """Things of PETSc that live until the end of a ``with`` block: ``y = own(x.duplicate())``. Collective.

    What Python drops without `destroy` PETSc keeps, on several ranks and on one, until it is told to look for it.
    """

    def __call__(self, thing: Thing) -> Thing:
        self.callback(thing.destroy)
        return thing

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """An exception of one rank alone must reach the others before it waits for them."""
        if kind is not None and not issubclass(kind, FretwaveError):
            self.pop_all()
        super().__exit__(kind, error, trace)


def destroyed(what: str) -> InputError:
    """Something is asked of what was freed."""
    return InputError(f"{what} has been destroyed", fix="do this before its destroy(), or within its `with` block")


class Destroyed:
    """Stands in place of what was freed: whoever asks it for anything is told."""

    def __init__(self, what: str) -> None:
        self._what = what

    def __getattr__(self, name: str) -> NoReturn:
        raise AttributeError(name) if name.startswith("_") else destroyed(self._what)


class Destroyable:
    """Owns objects of PETSc until `destroy`, which ``with`` calls at its end. Collective."""

    def destroy(self) -> None:
        """Free them. Collective."""
        raise NotImplementedError

    def __enter__(self: Own) -> Own:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()
