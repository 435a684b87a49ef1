"""Faults on one rank of a run: each must end in a failed step, or in one message and an exit, never in a hang.

Every run of the command line lets one rank of 2 or 3 fail at a named place (`src/fault.h`): an exception of its own
(error), bad input, no memory, or a value that is no number or a block that is singular (value). Prints the table of
FAULTS.md:

    .venv/bin/python cases/robustness/faults.py [--only TEXT]

Exit code 0 if no run hangs, prints a traceback or a second message, or takes a fault for a good result.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))
from models.wear_case import write_case  # noqa: E402 (the suite's cheap case of wear)

#: A run that takes longer hangs [s].
LIMIT = 150.0
TWO_DOF, WHEEL = ROOT / "cases/two_dof/case.toml", ROOT / "cases/blisk_lumped/case.toml"
KRYLOV = '"-route krylov -blocks {}"'

#: Overrides that leave a few points of each case.
SHORT = {
    "two_dof": [
        *("--set", "mode.harmonics=3", "--set", "mode.samples=64", "--set", "mode.amplitude=[0.02,0.1]"),
        *("--set", "mode.report_at=[0.05]", "--set", "forced.harmonics=3", "--set", "forced.samples=64"),
        *("--set", "forced.levels=[2.0]", "--set", "forced.frequency=[3.2,3.6]", "--set", "forced.time_points=0"),
    ],
    "chain": [
        *("--set", "mode.samples=64", "--set", "mode.amplitude=[2e-7,2.6e-6]"),
        *("--set", "one.amplitude=[2.5e-6]", "--set", "one.cycles=0.5"),
    ],
    "blisk": [
        *("--set", "mode_wheel.harmonics=1", "--set", "mode_wheel.samples=48", "--set", "mode_wheel.report_at=[]"),
        *("--set", "mode_wheel.amplitude=[1e-4,2e-4]", "--set", 'mode_wheel.petsc="-route krylov"'),
    ],
}


@dataclass(frozen=True)
class Fault:
    """`count`: at which pass of the place. `step`: a failed step and no more, so the run goes on."""

    scene: str
    place: str
    kind: str
    count: int
    rank: int
    ranks: int = 2

    @property
    def step(self) -> bool:
        return self.kind == "value"


#: scene: (place, kind, pass, rank) on 2 ranks.
ON_TWO = {
    "direct": [
        ("contact force", "error", 1, 0),
        ("contact force", "error", 20, 1),
        ("contact force", "memory", 7, 1),
        ("contact force", "input", 30, 0),
        ("contact force", "value", 25, 1),
        ("contact tangents", "error", 3, 1),
        ("contact tangents", "value", 5, 1),
        ("summary", "error", 2, 1),
        ("summary", "memory", 1, 0),
        ("contact samples", "error", 1, 1),
        ("record", "error", 3, 1),
        ("record", "memory", 2, 0),
        ("model", "error", 1, 1),
        ("model", "memory", 1, 0),
    ],
    "krylov": [
        ("harmonic block", "value", 2, 0),
        ("harmonic block", "value", 1, 1),
        ("harmonic block", "memory", 3, 1),
        ("harmonic block", "error", 4, 0),
        ("pair correction", "memory", 1, 1),
        ("contact tangents", "memory", 2, 0),
    ],
    "sparse": [
        ("sparse block", "value", 2, 1),
        ("sparse block", "memory", 1, 0),
        ("condensed system", "value", 1, 0),
        ("condensed system", "memory", 1, 0),
        ("settle", "error", 1, 1),
        ("settle", "memory", 1, 0),
    ],
    "wear": [
        ("wear", "error", 2, 1),
        ("wear", "memory", 3, 0),
        ("wearing", "error", 2, 1),
        ("contact force", "value", 60, 0),
    ],
    "study": [("contact force", "error", 50, 1), ("wearing", "error", 3, 0), ("wear", "memory", 4, 1)],
    "wheel": [("wave block", "value", 1, 0), ("wave block", "value", 10, 1), ("wave block", "memory", 2, 1)],
    "forced": [("contact force", "error", 15, 1), ("contact force", "value", 12, 1)],
}
ON_THREE = [
    ("direct", "contact force", "error", 5, 2),
    ("direct", "record", "error", 2, 2),
    ("krylov", "harmonic block", "value", 2, 1),
    ("wear", "wearing", "memory", 1, 2),
    ("study", "contact force", "error", 60, 2),
    ("wheel", "wave block", "value", 1, 2),
]


def faults() -> Iterator[Fault]:
    for scene, found in ON_TWO.items():
        for row in found:
            yield Fault(scene, *row)
    for row in ON_THREE:
        yield Fault(*row, ranks=3)


def arguments(scene: str, folder: Path) -> list[str]:
    """The command of a scene, its case written into the folder if it has none of its own."""
    chain = str(folder / "case.toml")
    if scene in ("sparse", "wear", "study"):
        write_case(folder)
    out = ["--no-plots", "--out", str(folder / "out")]
    oscillator = ["run", str(TWO_DOF), *SHORT["two_dof"], *out, "--only"]
    return {
        "direct": [*oscillator, "mode"],
        "krylov": [*oscillator, "mode", "--set", f"mode.petsc={KRYLOV.format('dense')}"],
        "forced": [*oscillator, "forced"],
        "sparse": [
            "run",
            chain,
            *SHORT["chain"],
            *out,
            "--only",
            "mode",
            "--set",
            f"mode.petsc={KRYLOV.format('sparse')}",
        ],
        "wear": ["run", chain, *SHORT["chain"], *out, "--only", "mode,one"],
        "study": ["study", chain, *SHORT["chain"], "--analysis", "one", "--tolerance", "1e-2,1e-3", *out[1:]],
        "wheel": ["run", str(WHEEL), *SHORT["blisk"], *out, "--only", "mode_wheel"],
    }[scene]


@dataclass(frozen=True)
class Found:
    code: int | None  #: None: still running after `LIMIT`
    message: float | None  #: from the fault to its message [s]; None: there is none
    end: float | None  #: from the fault to the end of mpirun [s]; None: the fault was not met
    messages: int
    traceback: bool
    said: str


def run(fault: Fault, folder: Path) -> Found:
    seen = folder / "seen"
    spec = f"{fault.place}:{fault.kind}:{fault.count}:{fault.rank}"
    runtime = {"OMP_NUM_THREADS": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1"}
    if os.geteuid() == 0:
        runtime |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    environment = {**os.environ, **runtime, "FRETWAVE_FAULT": spec, "FRETWAVE_FAULT_SEEN": str(seen)}
    command = ["mpirun", "-n", str(fault.ranks), sys.executable, "-m", "fretwave", *arguments(fault.scene, folder)]
    process = subprocess.Popen(
        command, env=environment, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    late = threading.Event()
    timer = threading.Timer(LIMIT, lambda: (late.set(), process.terminate()))
    timer.start()
    said, traceback = [], False
    assert process.stdout is not None
    for line in process.stdout:
        traceback |= line.startswith("Traceback")
        if line.startswith("error:"):
            said.append((time.time(), line[7:].strip()))
    process.wait()
    timer.cancel()
    struck = seen.stat().st_mtime if seen.exists() else None
    end = None if struck is None else time.time() - struck
    message = None if struck is None or not said else said[0][0] - struck
    return Found(
        None if late.is_set() else process.returncode, message, end, len(said), traceback, said[0][1] if said else ""
    )


def judge(fault: Fault, found: Found) -> str:
    """What is wrong, or nothing."""
    if found.code is None:
        return "hangs"
    if found.end is None:
        return "the fault was not met"
    if found.traceback:
        return "traceback"
    if found.messages > 1:
        return f"{found.messages} messages"
    if fault.step:
        return "" if found.code in (0, 3) else f"exit {found.code} after a failed step"
    if found.code == 0 and fault.scene != "study":  # a study notes what failed and goes on
        return "exit 0 in spite of the fault"
    return "" if found.code or fault.scene == "study" else "no exit code"


def row(fault: Fault, found: Found, wrong: str) -> str:
    times = ["" if t is None else f"{t:.1f}" for t in (found.message, found.end)]
    outcome = wrong or ("failed step" if fault.step else "one message" if found.messages else "noted, goes on")
    cells = [fault.scene, fault.place, fault.kind, fault.count, f"{fault.rank} of {fault.ranks}"]
    return "| " + " | ".join(str(c) for c in [*cells, found.code, *times, outcome, found.said[:90]]) + " |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="faults whose row contains this text")
    options = parser.parse_args()
    print("| scene | place | kind | pass | rank | exit | message [s] | end [s] | outcome | message |")
    print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
    count = bad = 0
    slowest = 0.0
    for fault in faults():
        if options.only not in f"{fault.scene} {fault.place} {fault.kind} {fault.rank} of {fault.ranks}":
            continue
        with tempfile.TemporaryDirectory() as folder:
            found = run(fault, Path(folder))
        wrong = judge(fault, found)
        count, bad = count + 1, bad + bool(wrong)
        slowest = max(slowest, found.message or 0.0)
        print(row(fault, found, wrong), flush=True)
    print(f"\n{count} faults, {bad} that end badly; slowest message {slowest:.1f} s after its fault")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
