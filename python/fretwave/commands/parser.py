"""A command line whose errors read as all others do."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from ..console import Shown
from ..errors import InputError
from ..files.place import expect_place
from ..mpi.guard import launched_rank
from ..texts import display, is_there

if TYPE_CHECKING:
    from _typeshed import SupportsWrite


#: What `argparse` says of places that stay empty.
REQUIRED = "the following arguments are required: "


class Parser(argparse.ArgumentParser):
    """Errors in the form of all others; under mpirun only the first rank prints."""

    def parse_known_args(self, args=None, namespace=None):  # type: ignore[no-untyped-def]
        """Of a sub-command too: what it does not know is told by itself."""
        self._given = list(args or [])
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        fix, (_, required, missing) = f"`{self.prog} --help` lists what there is", message.partition(REQUIRED)
        if required and self._takes_several():
            places = missing.replace(",", "")
            fix = f"`{self.prog} {places} ...`: before the options, one of several values takes what stands behind"
        raise InputError(f"the command line is wrong: {message}", where=self.prog, fix=fix)

    def _takes_several(self) -> bool:
        """Whether an option of several values is given."""
        many = [action for action in self._actions if action.nargs in ("+", "*")]
        return any(option in self._given for action in many for option in action.option_strings)

    def _print_message(self, message: str, file: SupportsWrite[str] | None = None) -> None:
        if launched_rank() == 0:
            super()._print_message(message, file)


def add_shown(command: argparse.ArgumentParser) -> None:
    """Options of what computes: how much it prints."""
    either = command.add_mutually_exclusive_group()
    for names, shown, said in (
        (("-q", "--quiet"), Shown.NOTHING, "print nothing but what went wrong"),
        (("-v", "--verbose"), Shown.ALL, "print every point and what else is in run.log"),
    ):
        either.add_argument(*names, action="store_const", dest="shown", const=shown, default=Shown.SHORT, help=said)


def add_force(command: argparse.ArgumentParser) -> None:
    """Option of what writes into a folder."""
    said = "replace results of another case in the folder (default: refused)"
    command.add_argument("--force", action="store_true", help=said)


def add_folder(command: argparse.ArgumentParser) -> None:
    """Argument of what reads or goes on with a run."""
    command.add_argument("folder", type=Path, metavar="RUNDIR", help="folder of the run")


def run_folder(path: Path) -> Path:
    """The folder of a run; what is in it is looked at later."""
    if is_there(path) and not path.is_dir():
        raise InputError("this is a file, not the folder of a run", display(path), fix="give the folder it is in")
    return path


def names(text: str) -> list[str]:
    """Of a list with commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def file_to_write(path: Path | None, example: str) -> Path | None:
    """Where a file goes that the command line names; a folder is refused, and what lies in a file or in no folder."""
    if path is not None and is_there(path) and path.is_dir():
        raise InputError("this is a folder", "--out", display(path), "a file to write", f"--out {path / example}")
    if path is not None:
        expect_place(path, f"--out {example}")
        if not is_there(path.parent):
            what, where = "the file cannot be written: its folder is not there", display(path.parent)
            raise InputError(what, "--out", where, "a folder that exists", f"`mkdir -p {where}`, or --out {example}")
    return path
