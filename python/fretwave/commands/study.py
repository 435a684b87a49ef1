"""``fretwave study``: error against run time over harmonics, samples, tolerance, modes: of a mode or a response."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..console import Shown
from ..run.study import COMPARED, REPEATS, run_study
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


def _list(kind: type) -> Any:
    def parse(text: str) -> list[Any]:
        return [kind(part) for part in text.split(",")]

    parse.__name__ = f"list of {kind.__name__}"
    return parse


def _several(text: str) -> int:
    if not text.isdecimal() or int(text) < 2:
        raise argparse.ArgumentTypeError(f"a whole number from 2 up is expected, not {text}")
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="fretwave study", description=__doc__)
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
    parser.add_argument("--accuracy", type=_list(float), metavar="A,...", help="accuracies to ask for")
    parser.add_argument(
        "--component-modes", type=_list(int), metavar="N,...", help="numbers of component modes to sweep"
    )
    parser.add_argument(
        "--pressure-change", type=_list(float), metavar="P,...", help="of wear: largest changes of pressure in a step"
    )
    parser.add_argument(
        "--places",
        type=_several,
        default=COMPARED,
        metavar="N",
        help=f"amplitudes of a mode or frequencies at which runs are compared (default {COMPARED})",
    )
    parser.add_argument("--repeats", type=int, default=REPEATS, help="times each run is repeated (default 3)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder (default runs/<case>_study)")
    add_shown(parser)
    add_force(parser)
    return parser
