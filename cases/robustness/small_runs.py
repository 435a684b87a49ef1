"""Small cases for kills, full disks and damaged files, and children that run `fretwave` without its second of imports.

The parent loads fretwave once; every command is a fork of it, which can be killed, starved or fed damaged files.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

HERE = Path(__file__).parent
TWO_DOF = HERE.parent / "two_dof" / "case.toml"

SHORT = {
    "mode.harmonics": "3",
    "mode.samples": "64",
    "mode.amplitude": "[0.05, 0.3]",
    "mode.report_at": "[0.13, 0.2]",
    "mode.step.maximum": "0.3",
    "forced.harmonics": "3",
    "forced.samples": "64",
    "forced.levels": "[2.0, 8.0]",
    "forced.frequency": "[3.8, 3.95]",
    "forced.step.maximum": "0.3",
    "forced.backbone": "['mode']",
    "forced.time_points": "0",
    "free_decay.periods": "8",
    "free_decay.amplitude": "[0.3]",
}

SWEEP = """
[[analysis]]
name = "limits"
type = "sweep"
of = "mode"
over = { "contact.damper.friction_limit" = [3, 5] }
"""


def overrides(settings: dict[str, str]) -> list[str]:
    """As the command line takes them."""
    return [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]


@dataclass(frozen=True)
class Scene:
    """A command that writes into a folder, without its --out."""

    name: str
    command: list[str] = field(default_factory=list)

    def start(self, folder: Path) -> list[str]:
        return [*self.command, "--out", str(folder)]


def scenes(folder: Path) -> list[Scene]:
    """All scenes; what they need is written into a folder."""
    plain = [str(TWO_DOF), *overrides(SHORT)]
    sweep = folder / "sweep.toml"
    text = TWO_DOF.read_text(encoding="utf-8")
    mark = "# Error against run time"
    sweep.write_text(text.replace(mark, f"{SWEEP}\n{mark}"), encoding="utf-8")
    return [
        Scene("run", ["run", *plain, "--only", "mode,forced,free_decay", "--no-plots"]),
        Scene("pictures", ["run", *plain, "--only", "mode", "--set", "mode.report_at=[]"]),
        Scene(
            "sweep", ["sweep", *plain, "--only", "mode", "--over", "contact.damper.friction_limit=3,5,7", "--no-plots"]
        ),
        Scene("analysis", ["run", str(sweep), *overrides(SHORT), "--only", "limits", "--no-plots"]),
        Scene(
            "study", ["study", *plain, "--harmonics", "1,3", "--samples", "64", "--tolerance", "1e-8", "--repeats", "1"]
        ),
    ]


@dataclass
class Ended:
    """How a child ended: its exit code (negative: the signal), what it said, how long it took [s]."""

    code: int
    out: str
    err: str
    seconds: float
    hung: bool = False


def call(
    arguments: list[str],
    work_in: Path,
    before: Callable[[], None] = lambda: None,
    kill_after: float | None = None,
    patience: float = 300.0,
) -> Ended:
    """Run `fretwave` with some arguments in a fork, killed after a time [s] if it is to be."""
    out, err = work_in / "out.txt", work_in / "err.txt"
    began = time.monotonic()
    child = os.fork()
    if child == 0:
        _become(arguments, out, err, before)
    deadline = began + (patience if kill_after is None else kill_after)
    status = None
    while status is None:
        found, code = os.waitpid(child, os.WNOHANG)
        if found:
            status = code
        elif time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            status = os.waitpid(child, 0)[1]
            return Ended(-9, out.read_text(), err.read_text(), time.monotonic() - began, kill_after is None)
        else:
            time.sleep(0.001)
    code = os.waitstatus_to_exitcode(status)
    return Ended(code, out.read_text(errors="replace"), err.read_text(errors="replace"), time.monotonic() - began)


def _become(arguments: list[str], out: Path, err: Path, before: Callable[[], None]) -> None:
    """The child: never returns."""
    code = 70
    try:
        for descriptor, path in ((1, out), (2, err)):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), descriptor)
        os.closerange(3, 3)
        sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
        from fretwave import main

        before()
        code = main(arguments)
        sys.stdout.flush()
    finally:
        os._exit(code)


def load() -> None:
    """What every command needs, once, before the first fork."""
    from fretwave.plots import style  # noqa: F401


def begin(text: str, **counts: int) -> argparse.Namespace:
    """Options of a script with this docstring (its counts with their defaults, a folder), ready to fork commands."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in counts.items():
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--out", type=Path, help="where the runs stay")
    options = parser.parse_args()
    options.out = options.out or Path(tempfile.mkdtemp(prefix="robustness-"))
    options.out.mkdir(parents=True, exist_ok=True)
    load()
    return options


# Comparison with the uninterrupted run

#: Columns and values that differ from run to run.
TIMES = ("wall_s", "cpu_s")


def tables(folder: Path) -> dict[str, list[dict[str, str]]]:
    """Every CSV of a folder without its times."""
    found = {}
    for path in sorted(folder.glob("*.csv")):
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        found[path.name] = [{k: v for k, v in row.items() if k not in TIMES} for row in rows]
    return found


def datasets(file: Any) -> Iterator[tuple[str, Any]]:
    """Every dataset of a results.h5 but times."""
    names: list[str] = []
    for top in file:
        file[top].visititems(
            lambda path, item, top=top: names.append(f"{top}/{path}") if isinstance(item, h5py.Dataset) else None
        )
    for name in names:
        if name.split("/")[-1] not in TIMES:
            yield name, file[name][()]


def same(one: Any, two: Any) -> bool:
    """Equal to the last digit, nan with nan."""
    if np.shape(one) != np.shape(two):
        return False
    return bool(np.array_equal(one, two, equal_nan=np.asarray(one).dtype.kind == "f"))


def differences(whole: Path, other: Path) -> list[str]:
    """What a finished folder has not as the uninterrupted one has it."""
    wrong = []
    files = [sorted(p.name for p in folder.iterdir() if p.is_file()) for folder in (whole, other)]
    if files[0] != files[1]:
        wrong.append(f"files {sorted(set(files[0]) ^ set(files[1]))}")
    expected, found = tables(whole), tables(other)
    wrong += [f"table {name}" for name in expected if expected[name] != found.get(name)]
    if (whole / "results.h5").exists():
        with h5py.File(whole / "results.h5") as first, h5py.File(other / "results.h5") as second:
            there = dict(datasets(second))
            for name, values in datasets(first):
                if name not in there or not same(values, there.pop(name)):
                    wrong.append(f"dataset {name}")
            wrong += [f"dataset {name} is too many" for name in there]
            wrong += [f"status of {name}" for name in first if second[name].attrs["status"] != "done"]
    records = [json.loads((folder / "run.json").read_text()) for folder in (whole, other)]
    if records[1]["status"] != "done" or set(records[0]["analyses"]) != set(records[1]["analyses"]):
        wrong.append("run.json")
    return wrong


def begins_like(whole: Path, other: Path) -> list[str]:
    """What can be seen of a killed run and is not what the uninterrupted one has there."""
    from fretwave import has_results, open_results

    wrong: list[str] = []
    if not has_results(other) or not (whole / "results.h5").exists():
        return wrong
    with h5py.File(whole / "results.h5") as first, open_results(other / "results.h5") as second:
        for name, values in datasets(second):
            if name not in first or not same(
                first[name][: len(values)] if np.shape(values) else first[name][()], values
            ):
                wrong.append(f"after the kill: dataset {name}")
    return wrong


def clean(folder: Path) -> Path:
    """An empty place."""
    shutil.rmtree(folder, ignore_errors=True)
    return folder
