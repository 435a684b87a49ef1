"""The command ``fretwave``. Heavy modules are imported by the sub-command that needs them."""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import EXIT_DONE, InputError
from ..mpi.alone import launched
from ..mpi.guard import guarded, install, launched_rank, open_streams
from ..texts import display, own_version
from ..units import SYSTEMS
from .parser import Parser, add_folder, add_force, add_shown, names, run_folder
from .reading import add_reading
from .world import world

if TYPE_CHECKING:
    from argparse import _SubParsersAction

    _SubParsers = _SubParsersAction[Parser]


def main(arguments: Sequence[str | os.PathLike[str]] | None = None) -> int:
    """Entry point; returns the exit code: 0 done, 2 bad input, 3 did not converge, 130 interrupted, 141 output
    that nobody reads, 1 anything else.
    """
    open_streams()
    install()
    _leave_networks_alone()
    with _pipes_break_in_python():
        return guarded(lambda: _dispatch(sys.argv[1:] if arguments is None else _words(arguments)))


def _words(given: Sequence[str | os.PathLike[str]]) -> list[str]:
    """Of a script, in which places are paths too."""
    many = isinstance(given, Iterable) and not isinstance(given, str)
    words = [os.fspath(one) if isinstance(one, os.PathLike) else one for one in given] if many else []
    if not many or not all(isinstance(one, str) for one in words):
        fix = 'write for example main(["run", "case.toml"])'
        raise InputError(
            "the words of a command line are no list of texts", "main", repr(given), "texts and paths", fix
        )
    return words


@contextmanager
def _pipes_break_in_python() -> Iterator[None]:
    """PETSc, whoever imports it, takes a reader who has left for a fault; kept from it, Python raises an error."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})
    try:
        yield
    finally:
        try:
            if signal.SIGPIPE in signal.sigpending():
                signal.sigwait({signal.SIGPIPE})
            if threading.current_thread() is threading.main_thread():  # others may set no handler
                signal.signal(signal.SIGPIPE, signal.SIG_IGN)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _dispatch(arguments: list[str]) -> int:
    if not arguments:
        parser().print_help()
        return EXIT_DONE
    if arguments[:1] == ["doctor"]:
        from . import doctor

        return doctor.main(arguments[1:], _said_once)
    if arguments[:1] == ["study"]:
        from ..files.memory import LIBRARIES, check_room

        check_room(LIBRARIES)
        from . import study

        return int(study.main(arguments[1:]))
    lone = next((text for text in arguments if re.fullmatch("--[a-z-]+=--", text)), None)
    if lone is not None:  # argparse takes the value for the end of the options
        raise InputError("an option has the value '--'", "fretwave", lone, "a value", "give it one, or leave it out")
    options = parser().parse_args(_joined_petsc(arguments))
    code: int = options.command(options)
    return code


def _leave_networks_alone() -> None:
    """A process without a launcher speaks to nobody: Open MPI need not open fast networks to find that out (0.2 s)."""
    if not launched():
        os.environ.setdefault("OMPI_MCA_pml", "ob1")


def _said_once(text: str) -> None:
    """Print on the first rank, also before MPI is started."""
    if launched_rank() == 0:
        print(text)


def _joined_petsc(arguments: list[str]) -> list[str]:
    """``--petsc -snes_monitor`` as one word: argparse takes a value with a leading dash for an option."""
    if "--petsc" not in arguments[:-1]:
        return arguments
    place = arguments.index("--petsc")
    return [*arguments[:place], f"--petsc={arguments[place + 1]}", *arguments[place + 2 :]]


def parser() -> argparse.ArgumentParser:
    """The command line with all sub-commands."""
    top = Parser(
        prog="fretwave",
        description="Nonlinear modes, forced response and limit cycles of structures with friction contact.",
        epilog="exit codes: 0 done, 2 bad input, 3 did not converge, 130 interrupted (what was found is kept),"
        " 141 nobody reads the output any more, 1 anything else",
    )
    top.add_argument("--version", action="version", version=f"fretwave {own_version()}", help="print the version")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=Parser)
    init = commands.add_parser("init", help="write a small case with comments to begin with")
    init.add_argument("folder", type=Path, metavar="FOLDER", nargs="?", default=Path(), help="for its case.toml (here)")
    init.set_defaults(command=_init)
    _add_run(commands)
    check = commands.add_parser(
        "check",
        help="check a case and say what would run",
        description="Checks a case, solves its state at rest and says what would run: pairs that stick, slip and are"
        " open, the linear mode, the amplitude at which it expects the first pair to slip, and warnings about what"
        " looks wrong, none of which changes the exit code. Of a whole wheel of more than"
        " 20,000 dofs the state at rest is left to the run.",
    )
    _add_case(check, optional=True)
    check.add_argument("--no-solve", action="store_true", help="leave out the state at rest")
    check.add_argument(
        "--keys",
        action="store_true",
        help="list all keys and contact laws instead, with those of a case's plug-ins, in its units",
    )
    check.add_argument("--schema", action="store_true", help="print the JSON schema of case files instead, for editors")
    check.set_defaults(command=_check)
    _add_sweep(commands)
    resume = commands.add_parser("resume", help="go on with a run that was cut off, on any number of ranks")
    add_folder(resume)
    _add_no_plots(resume)
    add_shown(resume)
    resume.set_defaults(command=_resume)
    add_reading(commands)
    _add_import(commands)
    commands.add_parser("study", help="error against run time of a case over harmonics, samples and tolerance")
    commands.add_parser("doctor", help="what is installed, whether it fits together, and what to do about it")
    return top


def _add_case(command: argparse.ArgumentParser, optional: bool = False) -> None:
    count = "?" if optional else None
    command.add_argument("case", type=Path, metavar="CASE", nargs=count, help="case file (TOML)")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="overrides",
        help="override a value: mode.harmonics=7, contact.damper.friction_limit=3, 'model.M=[[1.0]]'",
    )
    command.add_argument(
        "--only", type=names, action="extend", default=[], metavar="NAME,...", help="only these analyses"
    )
    command.add_argument("--quick", action="store_true", help="the short form: overrides of the table [quick]")


def _add_no_plots(command: argparse.ArgumentParser) -> None:
    command.add_argument("--no-plots", action="store_true", help="make no pictures")


def _add_doing(command: argparse.ArgumentParser, out: str) -> None:
    """Options of what computes: where to, and how."""
    add_shown(command)
    command.add_argument("--out", type=Path, metavar="DIR", help=out)
    _add_no_plots(command)
    add_force(command)
    command.add_argument("--petsc", default="", metavar="OPTIONS", help='PETSc options: "-snes_rtol 1e-10"')


def _add_run(commands: _SubParsers) -> None:
    run = commands.add_parser("run", help="run the analyses of a case")
    _add_case(run)
    _add_doing(run, "run folder (default runs/<case>)")
    run.set_defaults(command=_run)


def _add_sweep(commands: _SubParsers) -> None:
    sweep = commands.add_parser(
        "sweep",
        help="run a case for every value of some keys, on groups of ranks",
        description="Runs the chosen analyses of a case for every value of a key, or every combination of several keys,"
        " and writes one results.h5 with these dimensions, a table for each analysis led by the keys, and summary.csv."
        " Under mpirun groups of ranks work side by side. `fretwave resume` goes on with a sweep that was cut off.",
    )
    _add_case(sweep)
    sweep.add_argument(
        "--over",
        action="append",
        default=[],
        metavar="KEY=V,V,...",
        help="values of a key, addressed as --set does: model.options.friction=0.1,0.2,0.5; once for each key;"
        " ranges with both ends: 1:200 (whole numbers), 0.1:0.5:n=5 (equal steps), 1:100:log=3 (equal ratios);"
        " whole where all are whole: 1:9:n=5",
    )
    sweep.add_argument("--groups", type=int, metavar="G", help="groups of ranks (default: as many as ranks and values)")
    _add_doing(sweep, "folder (default runs/<case>_sweep)")
    sweep.set_defaults(command=_sweep)


def _add_import(commands: _SubParsers) -> None:
    add = commands.add_parser(
        "import",
        help="bring matrices of a finite-element code into one model file",
        description="Matrices: NumPy .npz, Matrix Market, MATLAB .mat (5 to 7.3), PETSc binary, CalculiX .sti/.mas,"
        " Abaqus .mtx, with extras Ansys .full and Nastran .op4; FILE:NAME picks a variable."
        ' In a case: [model] file = "OUT.h5".',
    )
    add.add_argument(
        "out",
        type=Path,
        metavar="OUT.h5",
        help="model file to write, or CalculiX' deck: sector.inp takes sector.mas and sector.sti beside it and writes"
        " sector.h5",
    )
    _add_matrices(add)
    _add_pairs(add)
    _add_sector(add)
    add.add_argument("--name", action="append", default=[], metavar="NAME=DOF", help="name a dof: tip=n17y; it is kept")
    add.add_argument("--units", metavar="SYSTEM", help=f"unit system of all numbers: {', '.join(SYSTEMS)}")
    add.add_argument("--modes", type=int, default=6, metavar="N", help="frequencies to report (default 6)")
    add.set_defaults(command=_import)


def _add_matrices(add: argparse.ArgumentParser) -> None:
    add.add_argument("--mass", metavar="FILE", help="mass matrix")
    add.add_argument("--stiffness", metavar="FILE", help="stiffness matrix")
    add.add_argument("--damping", metavar="FILE", help="viscous damping matrix")
    add.add_argument("--plugin", type=Path, action="append", default=[], metavar="FILE.py", help="a reader of your own")
    add.add_argument("--symmetric", choices=("auto", "lower", "upper", "full"), default="auto", help="what files hold")
    add.add_argument("--dofs", type=Path, metavar="FILE", help="node and direction of each row (.dof, or CSV)")
    add.add_argument(
        "--coordinates",
        type=Path,
        metavar="FILE",
        help="nodes, sets, elements, surfaces: CSV, .npz, input deck, Ansys .cdb or .rst; a Nastran deck's nodes",
    )


def _add_pairs(add: argparse.ArgumentParser) -> None:
    add.add_argument(
        "--pairs",
        nargs="+",
        action="append",
        default=[],
        metavar="[NAME=]SET",
        help="contact: two node sets or surfaces (where meshes differ, nodes of the first on faces of the second), "
        "SET GROUND, SET SET@next (the next sector's), or one CSV of node_a,node_b,nx,ny,nz,area",
    )
    add.add_argument(
        "--normal",
        metavar="X,Y,Z",
        help="from the first set to the second, --normal=-1,0,0 with a minus first (default: out of the first one's"
        " faces; without elements, and with @next, along the circumference)",
    )
    add.add_argument(
        "--at-rest",
        type=Path,
        metavar="FILE",
        help="CalculiX' results of a static step with *CONTACT FILE (.frd, or .dat): loads and gaps of the pairs, into"
        " MODEL_CONTACT.csv",
    )
    add.add_argument("--tangent", metavar="X,Y,Z", help="first tangent (default: the axis most across the normals)")
    add.add_argument(
        "--tolerance",
        type=float,
        metavar="LENGTH",
        help="largest distance of two nodes of a pair, of a node and a face, or of a sector's faces (default: 1e-6 of"
        " the mesh's diagonal)",
    )


def _add_sector(add: argparse.ArgumentParser) -> None:
    sector = add.add_argument_group(
        "a sector of a wheel",
        "The low face turned by 360/N degrees about the axis is the high face; the next sector begins there.",
    )
    sector.add_argument("--sectors", type=int, metavar="N", help="the mesh is one of N equal sectors")
    sector.add_argument("--low", metavar="SET", help="nodes of its low face")
    sector.add_argument("--high", metavar="SET", help="nodes of its high face")
    sector.add_argument("--axis", choices=("x", "y", "z"), help="of the wheel")
    sector.add_argument("--origin", metavar="X,Y,Z", help="a point of the axis, to be the origin (default 0,0,0)")


def _init(options: argparse.Namespace) -> int:
    from .init import write_template

    if launched_rank() == 0:
        path = display(write_template(options.folder))
        print(f"written: {path}\nnext: `fretwave check {path}`, then `fretwave run {path}`")
    return EXIT_DONE


def _run(options: argparse.Namespace) -> int:
    comm = world()
    from ..mpi.interrupt import ending_in_words
    from ..run.order import RunOptions
    from ..run.runner import run_case

    with ending_in_words(comm):
        return run_case(options.case, RunOptions.of(options), comm)


def _sweep(options: argparse.Namespace) -> int:
    comm = world()
    from ..mpi.interrupt import ending_in_words
    from ..run.order import RunOptions
    from ..run.sweep_plan import plan_of
    from .sweep import sweep_case

    with ending_in_words(comm):
        return sweep_case(options.case, RunOptions.of(options), plan_of(options.over), options.groups, comm)


def _resume(options: argparse.Namespace) -> int:
    run_folder(options.folder)
    comm = world()
    from ..files.lock import check_free
    from ..mpi.guard import on_first_rank
    from ..mpi.interrupt import ending_in_words, say_how_to_go_on
    from ..results.runfolder import read_record
    from ..run.runner import resume_run
    from .sweep import resume_sweep

    record = on_first_rank(comm, lambda: read_record(options.folder))
    on_first_rank(comm, lambda: check_free(options.folder))
    with ending_in_words(comm):
        say_how_to_go_on(comm, options.folder)
        if "study" in record:
            from .study import resume_study

            return resume_study(options.folder, record, comm, options.shown)
        if "sweep" in record:
            return resume_sweep(options.folder, record, comm, not options.no_plots, options.shown)
        return resume_run(options.folder, comm, not options.no_plots, options.shown)


def _check(options: argparse.Namespace) -> int:
    if options.keys:
        from .keys import key_lines

        _said_once("\n".join(key_lines(options.case)))
        return EXIT_DONE
    if options.schema:
        from .keys import schema_text

        _said_once(schema_text(options.case).removesuffix("\n"))
        return EXIT_DONE
    if options.case is None:
        raise InputError("no case is given", "fretwave check", fix="`fretwave check cases/two_dof/case.toml`")
    comm = world()
    from .check import check_case

    return check_case(options.case, options.overrides, options.only, options.quick, comm, not options.no_solve)


def _import(options: argparse.Namespace) -> int:
    comm = world()
    from .import_model import import_model

    return import_model(options, comm)
