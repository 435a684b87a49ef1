"""Hundreds of wrong command lines: every sub-command with flags, files and numbers that are not what they should be.

    OMP_NUM_THREADS=1 .venv/bin/python cases/robustness/command_lines.py --count 300 --seed 1 --table COMMAND_LINES.md
    OMP_NUM_THREADS=1 .venv/bin/python cases/robustness/command_lines.py --only 17

Each must end with a message and exit code 2 (or 1 where the machine refuses a file), or do what it says.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from random import Random

import scipy.sparse as sp

sys.path.insert(0, str(Path(__file__).parent))
from bases import SHORT, prepare, two_dof  # noqa: E402
from campaign import campaign, options  # noqa: E402
from commands import Ended, Worker  # noqa: E402
from mutations import as_toml  # noqa: E402

LIMIT = 60.0  #: processor time of one command [s]
#: Exit code 1 with a message is right where a folder cannot be written.
BAD = ("traceback", "PETSc text", "crash", "hang")
FILES = (
    "case.toml",
    "none.toml",
    "folder",
    "empty.toml",
    "binary.toml",
    "run",
    "run/results.h5",
    "meshed",
    "mass.npz",
    "stiffness.npz",
    "locked",
    "",
    "-",
    ".",
    "/",
)
NUMBERS = ("0", "-1", "1", "3", "1e30", "nan", "x", "", "99999999999999999999", "1.5", "\u00b2", "--")
NAMES = ("mode", "x", "", ",", "mode,mode", "mode,", "\u00e9", "x" * 3000, "../mode", "free_decay", "--only")
KEYS = (
    "mode.harmonics=3",
    "mode.harmonics",
    "=",
    "mode.x=1",
    "x=[",
    "model.M=1",
    "mode.harmonics=\u00b2",
    "quick.a=1",
    "",
)
SWEPT = (
    "mode.harmonics=1,2",
    "mode.harmonics=",
    "=1",
    "mode.harmonics=1,1",
    "x.y=1,2",
    "mode.step=1",
    "a=[",
    "mode.harmonics=1..3",
)
OPTIONS = (
    "-snes_rtol 1e-9",
    "-snes_rtol x",
    "x",
    "-",
    "--",
    "",
    "-snes_rtoll 1",
    "-ksp_type nonsense",
    "-snes_monitor",
)
OUTS = ("out", "locked/out", "case.toml", "case.toml/out", "/proc/out", "/dev/null", "x" * 300, "a\nb", ".", "")
CASE = {"--set": KEYS, "--only": NAMES, "--quick": None, "--nonsense": NAMES, "-n": NUMBERS, "-h": None}
LOUD = {"-q": None, "-v": None, "--quiet": None, "--verbose": None}
RUN = {**CASE, **LOUD, "--out": OUTS, "--no-plots": None, "--force": None, "--petsc": OPTIONS}
LISTS = ("1", "1,3", "0", "-1,2", "", ",", "x", "3,3", "1e-3,1e-2", "nan", "99999999999999999999", "1:3")
VECTORS = ("1,0,0", "0,0,0", "x", "1,2", "", "nan,0,0", "1e300,1e300,0")
#: Sub-commands with what they take: first words, and flags with their values (None: without).
COMMANDS: dict[str, tuple[tuple[str, ...], dict[str, tuple[str, ...] | None]]] = {
    "init": (("new", "folder", "case.toml", "locked", "", ".", "x" * 300, "/proc/x"), {"-h": None, "--nonsense": None}),
    "check": (FILES, {**CASE, "--keys": None, "--schema": None, "--no-solve": None}),
    "run": (FILES, RUN),
    "sweep": (FILES, {**RUN, "--over": SWEPT, "--groups": NUMBERS}),
    "resume": (FILES, {**LOUD, "--no-plots": None}),
    "show": (FILES, {"--json": None}),
    "plot": (FILES, {"--only": NAMES, "--format": ("png", "svg", "pdf,png", "x", "", ",", "png,png")}),
    "report": (FILES, {"--out": OUTS}),
    "probe": (
        FILES,
        {
            **{"--pairs": None, "--node": NUMBERS, "--dof": NAMES, "--analysis": NAMES, "--csv": None, "--out": OUTS},
            **{"--at": ("peak", "start", "pea", "1e9", "0.02", "row", "row 3", "nan", ""), "--steps": NUMBERS},
            "--sector": NUMBERS,
        },
    ),
    "stress": (FILES, {"--analysis": NAMES, "--out": OUTS}),
    "view": (
        FILES,
        {
            **{"--analysis": NAMES, "--point": NUMBERS, "--amplitude": NUMBERS, "--sectors": NUMBERS, "--linear": None},
            **{"--phases": NUMBERS, "--scale": NUMBERS, "--out": OUTS},
            **{"--pvd": None, "--png": None, "--gif": None, "--eye": NUMBERS},
        },
    ),
    "import": (
        ("out.h5", "locked/out.h5", "", "folder", "case.toml"),
        {
            **{
                "--mass": FILES,
                "--stiffness": FILES,
                "--damping": FILES,
                "--symmetric": ("auto", "x"),
                "--dofs": FILES,
            },
            **{
                "--coordinates": FILES,
                "--pairs": NAMES,
                "--normal": VECTORS,
                "--modes": NUMBERS,
            },
            **{"--tolerance": NUMBERS, "--name": ("tip=0", "tip", "=", "tip=x"), "--tangent": VECTORS},
            **{"--plugin": FILES, "--at-rest": FILES, "--sectors": NUMBERS, "--low": NAMES, "--high": NAMES},
            **{"--axis": ("x", "z", "w", ""), "--origin": VECTORS, "--units": ("mm-t-s", "mm", "")},
        },
    ),
    "study": (
        FILES,
        {
            **{
                "--analysis": NAMES,
                "--set": KEYS,
                "--quick": None,
                "--out": OUTS,
                "--force": None,
                "--nonsense": NAMES,
            },
            **{"--harmonics": LISTS, "--samples": LISTS, "--tolerance": LISTS, "--accuracy": LISTS, **LOUD},
            **{"--component-modes": LISTS, "--pressure-change": LISTS, "--places": NUMBERS, "--repeats": NUMBERS},
        },
    ),
    "doctor": (("", "--json", "x", "--help"), {"--nonsense": None, "--constants": None, "-h": None}),
    "nonsense": (FILES, {}),
    "": (("", "--version", "--help", "-h", "-n"), {}),
}


def command(seed: int, number: int) -> list[str]:
    """The command line of a number."""
    random = Random(f"{seed}/{number}")
    name = list(COMMANDS)[number % len(COMMANDS)]
    first, flags = COMMANDS[name]
    line = [name] if name else []
    if random.random() < 0.93:
        line.append(random.choice((first[0], first[0], first[0], *first)))
    for _ in range(random.choice((0, 1, 1, 2, 3)) if flags else 0):
        flag = random.choice(list(flags))
        values = flags[flag]
        line.append(flag)
        if values is not None and random.random() < 0.95:
            value = random.choice(values)
            line[-1:] = [f"{flag}={value}"] if random.random() < 0.3 else [flag, value]
    if name in ("resume", "show", "plot", "report", "probe", "stress", "view") and random.random() < 0.5:
        line[1:2] = [random.choice(("run", "meshed"))]
    if name == "import" and random.random() < 0.5:
        line[1:1] = ["--mass", "mass.npz", "--stiffness", "stiffness.npz"]
    if name == "run" and "--only" not in line and random.random() < 0.8:
        line += ["--only", "mode"]
    return line


def prepared(folder: Path, worker: Worker) -> None:
    """A short case, a run of it, and files that are not what they should be."""
    prepare(folder)
    (folder / "case.toml").write_text(as_toml(two_dof()), encoding="utf-8")
    (folder / "empty.toml").write_text("")
    (folder / "binary.toml").write_bytes(bytes(range(256)))
    (folder / "folder").mkdir()
    (folder / "locked").mkdir(mode=0o500)
    ended = worker.run(["run", "case.toml", "--only", "mode,free_decay", "--out", "run"], folder, LIMIT)
    assert ended.outcome == "done", ended.text
    (folder / "solid" / "case.toml").write_text(as_toml(SHORT["solid"]()), encoding="utf-8")
    meshed = ["run", "case.toml", "--only", "mode", "--set", "mode.amplitude=[1e-6, 1.1e-6]", "--out", "../meshed"]
    ended = worker.run(meshed, folder / "solid", LIMIT)
    assert ended.outcome == "done", ended.text
    for name, entries in (("mass", [1.0, 2.0, 3.0]), ("stiffness", [10.0, 20.0, 30.0])):
        sp.save_npz(folder / f"{name}.npz", sp.diags(entries, format="csr"))


def main() -> int:
    """Judge all command lines; the exit code is 1 when any ended badly."""
    told = options(__doc__, 300)
    with tempfile.TemporaryDirectory() as name, Worker() as worker:
        prepared(Path(name), worker)

        def one(number: int) -> tuple[str, str, Ended]:
            line = command(told.seed, number)
            return line[0] if line else "", str(line), worker.run(line, Path(name), LIMIT)

        return campaign(told, "command lines", one, BAD)


if __name__ == "__main__":
    sys.exit(main())
