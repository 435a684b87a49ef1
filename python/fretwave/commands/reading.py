"""Sub-commands that read results and solve nothing: show, report, plot, probe, stress, view."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import EXIT_DONE, InputError
from ..mpi.guard import launched_rank
from ..texts import display, nearest
from .parser import Parser, add_folder, file_to_write, names, run_folder
from .world import world_if_any

if TYPE_CHECKING:
    from argparse import _SubParsersAction

    from mpi4py import MPI

    _SubParsers = _SubParsersAction[Parser]


def add_reading(commands: _SubParsers) -> None:
    """All of them."""
    show = commands.add_parser(
        "show",
        help="show the results of a run",
        description="Prints a line for each analysis: points, range, largest damping or response, folds, largest"
        " estimated error; then what the command line had changed, limit cycles, and why an analysis is not complete."
        " --json has the same with all digits: folder, title, status, ranks, started, units, notes, and analyses, each"
        " with name, type, method, status, reason, points, unit, range, peak, folds, error, wall_s, limit_cycles,"
        " overrides, notes.",
    )
    add_folder(show)
    show.add_argument("--json", action="store_true", help="the same for programs: one JSON object")
    show.set_defaults(command=_show)
    report = commands.add_parser(
        "report",
        help="a run on one page of HTML, to be read, printed or sent",
        description="Writes one file that needs nothing beside it: model, settings, checks, results with their errors,"
        " why branches ended, pictures, versions and digests. Also of a run that is not finished.",
    )
    add_folder(report)
    report.add_argument("--out", type=Path, metavar="FILE", help="file to write (default: report.html in the folder)")
    report.set_defaults(command=_report)
    plot = commands.add_parser("plot", help="make the pictures of a run again")
    add_folder(plot)
    plot.add_argument(
        "--only", type=names, action="extend", default=[], metavar="NAME,...", help="analyses or kinds of picture"
    )
    plot.add_argument(
        "--format", type=names, default=["png"], metavar="NAME,...", help="png, svg, pdf, or several (default: png)"
    )
    plot.set_defaults(command=_plot)
    _add_probe(commands)
    _add_stress(commands)
    _add_view(commands)


def _add_probe(commands: _SubParsers) -> None:
    probe = commands.add_parser(
        "probe",
        help="contact pairs, a node or a dof at one point of a branch",
        description="--pairs: a CSV with work per period, normal force (and pressure where areas are known), slip, gap"
        " and shares of stick, slip and open of each contact pair. --node, --dof: amplitude and phase of each harmonic"
        " along x, y, z; a reduced model is expanded, of a wheel one sector is looked at. CSV goes to standard output,"
        " with a line on which point it is on standard error.",
    )
    add_folder(probe)
    what = probe.add_mutually_exclusive_group(required=True)
    what.add_argument("--pairs", action="store_true", help="a table of all contact pairs")
    what.add_argument("--node", type=int, metavar="N", help="a node, in the mesh's own numbers, else counted from 0")
    what.add_argument("--dof", metavar="NAME", help="a dof of the model that was solved")
    probe.add_argument("--analysis", metavar="NAME", help="mode, forced response or wear (default: the first)")
    probe.add_argument(
        "--at",
        nargs="+",
        default=["peak"],
        metavar="POINT",
        help="peak (largest damping, or response; default), start, end, an amplitude (the nearest point around"
        " the places where it is passed), or row N",
    )
    probe.add_argument("--sector", type=int, metavar="J", help="of a wheel, of --node (default 0)")
    probe.add_argument("--csv", action="store_true", help="the harmonics of --node or --dof as CSV")
    probe.add_argument("--steps", type=int, metavar="N", help="in their place the motion at N instants of the period")
    probe.add_argument("--out", type=Path, metavar="FILE", help="write the CSV here")
    probe.set_defaults(command=_probe)


def _add_stress(commands: _SubParsers) -> None:
    stress = commands.add_parser(
        "stress",
        help="strain gauges, the worst stress and Goodman's limit over a branch",
        description="Writes <analysis>_gauges.csv: at every point of a branch the strain amplitude of each [[gauge]] of"
        " the case over the period, and, with [material], the worst node with its von Mises stress amplitude, mean"
        " stress and Goodman's factor; and <analysis>_goodman.csv: the amplitude (of a forced response the level) at"
        " which that reaches 1. Both tables may be added to the case file after the run. A reduced model is expanded.",
    )
    add_folder(stress)
    stress.add_argument("--analysis", metavar="NAME", help="mode or forced response (default: all)")
    stress.add_argument("--out", type=Path, metavar="FILE", help="write the first of both tables here alone")
    stress.set_defaults(command=_stress)


def _add_view(commands: _SubParsers) -> None:
    view = commands.add_parser(
        "view",
        help="the motion over a period and the contact for ParaView, or as a picture or animation",
        description="Writes <analysis>.vtkhdf, the mesh with its displacement at phases of the period, and"
        " <analysis>_contact.vtkhdf, the faces of the contact with pressure, traction, status and work (ParaView 5.12)."
        " --pvd: a series of files of the outer faces for any ParaView; --png, --gif: without it."
        " Several points follow each other."
        " Of a sector the whole wheel is written, sector by sector."
        " Of wear without --point: <analysis>_wear.vtkhdf, the pairs with worn depth and pressure over wear cycles.",
    )
    add_folder(view)
    view.add_argument("--analysis", metavar="NAME", help="mode, forced response or wear (default: the first)")
    which = view.add_mutually_exclusive_group()
    which.add_argument("--point", type=int, nargs="+", default=[], metavar="N", help="points of the branch")
    which.add_argument(
        "--amplitude",
        type=float,
        nargs="+",
        default=[],
        metavar="A",
        help="nearest kept points around the places where they are passed, in the case's units",
    )
    view.add_argument("--sectors", type=int, nargs="+", default=[], metavar="J", help="of a wheel (default: all)")
    view.add_argument("--phases", type=int, default=32, metavar="N", help="steps of a period (default 32)")
    view.add_argument("--scale", default="auto", metavar="X", help="enlargement in the field warp (default auto)")
    view.add_argument("--linear", action="store_true", help="eight linear hexahedra for each triquadratic one")
    view.add_argument("--pvd", action="store_true", help="<analysis>.pvd with a .vtu per step: ParaView 5.11 plays it")
    view.add_argument("--png", action="store_true", help="a picture at the largest displacement of the first point")
    view.add_argument("--gif", action="store_true", help="an animation of its period")
    view.add_argument(
        "--eye", type=float, nargs=2, metavar=("AZ", "EL"), help="of pictures: azimuth and elevation [degrees]"
    )
    view.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="file to write (default: in the run folder); .png, .gif and .pvd are as --png, --gif and --pvd",
    )
    view.set_defaults(command=_view)


def _show(options: argparse.Namespace) -> int:
    run_folder(options.folder)
    from .show import show_run

    if launched_rank() == 0:
        show_run(options.folder, options.json)
    return EXIT_DONE


def _report(options: argparse.Namespace) -> int:
    run_folder(options.folder)
    out = file_to_write(options.out, "report.html")
    comm = world_if_any()  # what reads the case loads MPI, which all ranks must start
    from ..report.report import report_run

    def write() -> None:
        path = report_run(options.folder, out)
        print(f"{display(path)}: {path.stat().st_size / 1e6:.2g} MB")

    _on_first_rank(comm, write)
    return EXIT_DONE


def _plot(options: argparse.Namespace) -> int:
    formats = _formats(options.format)
    run_folder(options.folder)
    comm = world_if_any()  # a file of plug-ins may load MPI
    from ..console import Console
    from ..results.results import open_results
    from ..run.pictures import plot

    def draw() -> None:
        if not (options.folder / "study.csv").exists():
            open_results(options.folder / "results.h5").close()
        plot(options.folder, Console(True), options.only or None, formats)

    _on_first_rank(comm, draw)
    return EXIT_DONE


def _formats(asked: list[str]) -> list[str]:
    """Endings of pictures, in small letters."""
    from ..plots.style import FORMATS

    given = [name.lower().lstrip(".") for name in asked]
    for name in given:
        if name not in FORMATS:
            fix = nearest(name, list(FORMATS)) or "--format svg"
            raise InputError("there is no such format of pictures", "--format", name, ", ".join(FORMATS), fix)
    return given or ["png"]


def _probe(options: argparse.Namespace) -> int:
    run_folder(options.folder)
    comm = world_if_any()
    from .probe import probe

    options.out = file_to_write(options.out, "probe.csv")
    _on_first_rank(comm, lambda: probe(options))
    return EXIT_DONE


def _stress(options: argparse.Namespace) -> int:
    run_folder(options.folder)
    comm = world_if_any()
    from .stress import stress

    out = file_to_write(options.out, "gauges.csv")
    _on_first_rank(comm, lambda: stress(options.folder, options.analysis, out))
    return EXIT_DONE


def _view(options: argparse.Namespace) -> int:
    run_folder(options.folder)
    comm = world_if_any()
    from ..view.options import ViewOptions
    from ..view.run import view_run

    ending = options.out.suffix.lower() if options.out else ""
    chosen = ViewOptions.checked(
        options.scale,
        options.phases,
        analysis=options.analysis,
        points=options.point,
        amplitudes=options.amplitude,
        linear=options.linear,
        sectors=options.sectors,
        out=file_to_write(options.out, "motion.vtkhdf"),
        png=options.png or ending == ".png",
        gif=options.gif or ending == ".gif",
        pvd=options.pvd or ending == ".pvd",
        eye=tuple(options.eye) if options.eye else None,
    )
    _on_first_rank(comm, lambda: view_run(options.folder, chosen))
    return EXIT_DONE


def _on_first_rank(comm: MPI.Comm | None, work: Callable[[], object]) -> None:
    """What reads results, on one rank; also where there is no MPI."""
    if comm is None:
        work()
        return
    from ..mpi.guard import on_first_rank

    on_first_rank(comm, work)
