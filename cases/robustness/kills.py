"""Kill runs, sweeps and studies at random times, at writes and within writes; resume; compare with the uninterrupted.

.venv/bin/python cases/robustness/kills.py [--count 300] [--seed 1] [--out FOLDER]
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import small_runs
from small_runs import Scene, begins_like, call, clean, differences

KINDS = ("random", "at a write", "torn write")
#: The calls by which files change.
CALLS = ("write", "pwrite", "replace", "ftruncate", "fsync", "unlink")


class Counting:
    """Counts the calls that change files, and kills the process at one of them.

    Parameters
    ----------
    at : int
        Number of the call to die at, -1 for none: only counts, and leaves the count in a file.
    torn : bool
        Half of what that call is to write is written first.
    """

    def __init__(self, at: int, torn: bool, note: Path | None = None) -> None:
        self.at, self.torn, self.note, self.count = at, torn, note, 0

    def install(self) -> None:
        """In the child."""
        for name in CALLS:
            setattr(os, name, self._wrapped(getattr(os, name)))

    def _wrapped(self, real: Callable[..., Any]) -> Callable[..., Any]:
        writes = os.write, os.pwrite

        def counted(*arguments: Any, **named: Any) -> Any:
            if self.count == self.at:
                if self.torn and real in writes:
                    real(arguments[0], bytes(arguments[1])[: len(arguments[1]) // 2], *arguments[2:])
                os.kill(os.getpid(), signal.SIGKILL)
            self.count += 1
            if self.note is not None:
                self.note.open("ab").write(b".")
            return real(*arguments, **named)

        return counted


def count_calls(scene: Scene, folder: Path) -> int:
    """How many calls of an uninterrupted run change files."""
    note = folder / "count.bin"
    note.unlink(missing_ok=True)
    ended = call(scene.start(clean(folder / "counted")), folder, Counting(-1, False, note).install)
    assert ended.code == 0, ended.err
    return note.stat().st_size


def one_kill(
    scene: Scene, kind: str, whole: Path, seconds: float, calls: int, random: np.random.Generator, folder: Path
) -> tuple[list[str], int]:
    """What was wrong after a kill and after going on, and how often it was killed."""
    target, kills, wrong = clean(folder / "killed"), 0, []
    arguments = scene.start(target)
    for _ in range(1 + int(random.integers(2))):  # half of them are killed again while they go on
        if kind == "random":
            ended = call(arguments, folder, kill_after=float(random.uniform(0, seconds)))
        else:
            counting = Counting(int(random.integers(calls)), kind == "torn write")
            ended = call(arguments, folder, counting.install)
        if ended.code != -9:
            if ended.code != 0:
                wrong.append(f"exit {ended.code}: {ended.err.strip()[:300]}")
            break
        kills += 1
        wrong += begins_like(whole, target)
        if (target / "results.h5").exists() or list(target.glob(".*.rows")):
            shown = call(["show", str(target)], folder)
            wrong += [] if shown.code == 0 else [f"show: exit {shown.code}: {shown.err.strip()[:300]}"]
        arguments = ["resume", str(target), *(["--no-plots"] if "--no-plots" in scene.command else [])]
        if not (target / "run.json").exists():
            arguments = scene.start(target)  # killed before anything was written
    if kills and not wrong:
        ended = call(arguments, folder)
        if ended.code != 0:
            wrong.append(f"resume: exit {ended.code}: {ended.err.strip()[:300]}")
    return wrong or differences(whole, target), kills


def main() -> int:
    """Print a table of kills; exit code 1 when any was not survived."""
    options = small_runs.begin(__doc__, count=300, seed=1)
    folder = options.out
    random, began = np.random.default_rng(options.seed), time.monotonic()
    known, done, bad = [], Counter[tuple[str, str]](), Counter[tuple[str, str]]()
    for scene in small_runs.scenes(folder):
        whole = clean(folder / f"whole_{scene.name}")
        ended = call(scene.start(whole), folder)
        assert ended.code == 0, ended.err
        known.append((scene, whole, ended.seconds, count_calls(scene, folder)))
        print(f"{scene.name}: {ended.seconds:.1f} s, {known[-1][3]} writes", flush=True)
    while sum(done.values()) < options.count:
        scene, whole, seconds, calls = known[int(random.integers(len(known)))]
        kind = KINDS[int(random.integers(3))]
        wrong, kills = one_kill(scene, kind, whole, seconds, calls, random, folder)
        done[scene.name, kind] += kills
        bad[scene.name, kind] += bool(wrong)
        for text in wrong:
            print(f"{scene.name}, {kind}, after {sum(done.values())} kills: {text}", flush=True)
        print(f"\r{sum(done.values())} kills", end="", file=sys.stderr, flush=True)
    print("| scene | writes | " + " | ".join(KINDS) + " | not survived |\n|---|---|---|---|---|---|")
    for scene, _, _, calls in known:
        each = [done[scene.name, kind] for kind in KINDS]
        print(f"| {scene.name} | {calls} | {' | '.join(map(str, each))} | {sum(bad[scene.name, k] for k in KINDS)} |")
    print(f"{sum(done.values())} kills, {sum(bad.values())} not survived, {time.monotonic() - began:.0f} s")
    return int(sum(bad.values()) > 0)


if __name__ == "__main__":
    raise SystemExit(main())
