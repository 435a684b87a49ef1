"""``fretwave study``: error against run time over harmonics, samples, tolerance, modes: of a mode or a response."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..case.fields import LARGEST_WHOLE
from ..console import Shown
from ..run.study import COMPARED, REPEATS, run_study
from ..texts import number_in, whole_in
from .parser import Parser, add_force, add_shown
from .world import world

if TYPE_CHECKING:
    from mpi4py import MPI


def main(arguments: Sequence[str]) -> int:
    """Run a study; returns the exit code. Collective."""
    from ..mpi.interrupt import ending_in_words

    options = _parser().parse_args(arguments)
    comm = world()
    with ending_in_words(comm):
        return run_study(options, arguments, comm)


def resume_study(folder: Path, record: dict[str, Any], comm: MPI.Comm, shown: Shown) -> int:
    """Go on with a study that was cut off; returns the exit code. Collective."""
    arguments = record["study"]["arguments"]
    options = _parser().parse_args(arguments)
    options.case, options.out, options.shown = Path(record["case"]["path"]), folder, shown
    return run_study(options, arguments, comm, record)


def _list(kind: type, least: int = 1, below: float = math.inf) -> Any:
    """Numbers as the keys of [study] are: whole ones from the least up, others above 0 and below something."""
    expected = f"whole numbers from {least} up" if kind is int else "numbers above 0"
    expected += f" and below {below:g}" if below < math.inf else ""

    read = whole_in if kind is int else number_in

    def fits(value: float) -> bool:
        return least <= value <= LARGEST_WHOLE if kind is int else 0 < value < below

    def parse(text: str) -> list[Any]:
        try:
            values = [read(part) for part in text.split(",")]
        except ValueError:
            values = []
        if not values or not all(map(fits, values)):
            raise argparse.ArgumentTypeError(f"{expected} are expected, with commas between, not {text}")
        return values

    return parse


def _from(least: int) -> Any:
    def parse(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"a whole number from {least} up is expected, not {text}")
        return int(text)

    return parse


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="fretwave study",
        description="Runs a mode, a forced response or wear over harmonics, samples, tolerances, accuracies and"
        " numbers of component modes (options, else [study] of the case), each with the others at their finest, and"
        " writes error against run time as a table and a picture.",
    )
    parser.add_argument("case", type=Path, metavar="CASE", help="case file (TOML)")
    parser.add_argument(
        "--analysis",
        metavar="NAME",
        help="mode, forced response (largest level) or wear (default: the first mode)",
    )
    parser.add_argument("--set", action="append", default=[], dest="overrides", metavar="KEY=VALUE", help="as for run")
    parser.add_argument("--quick", action="store_true", help="the short form of the case")
    parser.add_argument("--harmonics", type=_list(int), metavar="H,...", help="highest harmonics to sweep")
    parser.add_argument("--samples", type=_list(int), metavar="N,...", help="time samples to sweep")
    parser.add_argument(
        "--tolerance", type=_list(float), metavar="T,...", help="tolerances to sweep (of wear: of a step)"
    )
    parser.add_argument("--accuracy", type=_list(float, below=1.0), metavar="A,...", help="accuracies to ask for")
    parser.add_argument(
        "--component-modes", type=_list(int, 0), metavar="N,...", help="numbers of component modes to sweep"
    )
    parser.add_argument(
        "--pressure-change", type=_list(float), metavar="P,...", help="of wear: largest changes of pressure in a step"
    )
    parser.add_argument(
        "--places",
        type=_from(2),
        default=COMPARED,
        metavar="N",
        help=f"amplitudes of a mode or frequencies at which runs are compared (default {COMPARED})",
    )
    parser.add_argument(
        "--repeats", type=_from(1), default=REPEATS, metavar="N", help=f"times each run is repeated (default {REPEATS})"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder (default runs/<case>_study)")
    add_shown(parser)
    add_force(parser)
    return parser
