"""A command line whose errors read as all others do."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, NoReturn

from ..errors import InputError
from ..mpi.guard import launched_rank

if TYPE_CHECKING:
    from _typeshed import SupportsWrite


class Parser(argparse.ArgumentParser):
    """Errors in the form of all others; under mpirun only the first rank prints."""

    def error(self, message: str) -> NoReturn:
        raise InputError(
            f"the command line is wrong: {message}", where=self.prog, fix=f"`{self.prog} --help` lists what there is"
        )

    def _print_message(self, message: str, file: SupportsWrite[str] | None = None) -> None:
        if launched_rank() == 0:
            super()._print_message(message, file)
