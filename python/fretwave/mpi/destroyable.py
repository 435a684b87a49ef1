"""What owns objects of PETSc: Python frees nothing of it by itself, for it does not collect on all ranks at a time."""

from __future__ import annotations

from typing import TypeVar

Own = TypeVar("Own", bound="Destroyable")


class Destroyable:
    """Owns objects of PETSc until `destroy`, which ``with`` calls at its end. Collective."""

    def destroy(self) -> None:
        """Free them. Collective."""
        raise NotImplementedError

    def __enter__(self: Own) -> Own:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()
