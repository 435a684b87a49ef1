"""Let the disk fill up, files hit a limit and memory run out at many places; then make room, resume and compare.

    .venv/bin/python cases/robustness/full_disk.py [--out FOLDER]

A full disk is a tmpfs (root) whose free space is what is left after a ballast; a limit on the size of files stands for
a quota. Right is one message, exit 1, no traceback and no crash; and after `resume` what the uninterrupted run has.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import small_runs
from small_runs import Ended, Scene, call, clean, differences

#: Bytes of the tmpfs: a whole run and a half.
DISK = 4 << 20
#: Of a run: 436 MB of libraries and buffers to begin with, and what it works with [bytes].
MEMORY = 700e6


@contextmanager
def small_disk(place: Path) -> Iterator[Path | None]:
    """A tmpfs, None where it cannot be mounted."""
    place.mkdir(parents=True, exist_ok=True)
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", place], capture_output=True)
    try:
        yield place if mounted.returncode == 0 else None
    finally:
        if mounted.returncode == 0:
            subprocess.run(["umount", place], check=True)


def trouble(ended: Ended) -> str:
    """What is wrong with how a command ended, "" for nothing."""
    if ended.hung:
        return "hangs"
    if "Traceback" in ended.err or "Exception ignored" in ended.err:
        return "traceback"
    if ended.code not in (0, 1, 3):
        return f"exit {ended.code}"
    if ended.code == 1 and ended.err.count("error:") != 1:
        return f"{ended.err.count('error:')} messages"
    return ""


def full(scene: Scene, free: int, disk: Path, whole: Path, work_in: Path) -> tuple[str, str]:
    """A run on a disk with so many bytes free; how it ended, and what was wrong."""
    target, ballast = clean(disk / "run"), disk / "ballast"
    ballast.unlink(missing_ok=True)
    with ballast.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(DISK - free, 1))
    ended = call(scene.start(target), work_in)
    ballast.unlink()
    return f"exit {ended.code}", trouble(ended) and f"{trouble(ended)}: {ended.err[-500:]}" or after(
        scene, target, whole, work_in
    )


def limited(scene: Scene, limit: Callable[[], None], target: Path, whole: Path, work_in: Path) -> tuple[str, str]:
    """A run under a limit of the system."""
    ended = call(scene.start(clean(target)), work_in, limit, patience=60)
    return f"exit {ended.code}", trouble(ended) and f"{trouble(ended)}: {ended.err[-500:]}" or after(
        scene, target, whole, work_in
    )


def after(scene: Scene, target: Path, whole: Path, work_in: Path) -> str:
    """With room again: what a resumed run has not as the uninterrupted one."""
    plots = ["--no-plots"] if "--no-plots" in scene.command else []
    again = ["resume", str(target), *plots] if (target / "run.json").exists() else scene.start(target)
    ended = call(again, work_in)
    if ended.code != 0:
        return f"resume: exit {ended.code}: {ended.err[-300:]}"
    return "; ".join(differences(whole, target))


def size_limit(size: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


def memory_limit(more: int) -> Callable[[], None]:
    """So much more address space [bytes] than the child has now."""

    def limit() -> None:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more,) * 2)

    return limit


def main() -> int:
    """Print a table; exit code 1 when anything was not taken as it should."""
    options = small_runs.begin(__doc__, steps=12)  # places along each run
    folder = options.out
    began, rows, bad = time.monotonic(), [], 0
    with small_disk(folder / "disk") as disk:
        for scene in small_runs.scenes(folder):
            whole = clean(folder / f"whole_{scene.name}")
            assert call(scene.start(whole), folder).code == 0
            size = sum(path.stat().st_size for path in whole.rglob("*") if path.is_file())
            largest = max(path.stat().st_size for path in whole.rglob("*") if path.is_file())
            for kind in ("full disk", "size limit", "memory"):
                codes: dict[str, int] = {}
                for step in range(options.steps):
                    part = (step + 0.5) / options.steps
                    target = folder / "limited"
                    if kind == "full disk" and disk is not None:
                        code, wrong = full(scene, int(part * 2 * size), disk, whole, folder)
                    elif kind == "size limit":
                        code, wrong = limited(scene, size_limit(int(part * largest)), target, whole, folder)
                    elif kind == "memory":
                        code, wrong = limited(scene, memory_limit(int(part * MEMORY)), target, whole, folder)
                    else:
                        continue
                    codes[code] = codes.get(code, 0) + 1
                    bad += bool(wrong)
                    if wrong:
                        print(f"{scene.name}, {kind}, {part:.2f}: {wrong}", flush=True)
                rows.append(f"| {scene.name} | {kind} | {', '.join(f'{n} x {c}' for c, n in sorted(codes.items()))} |")
    print("| scene | what runs out | how it ended |\n|---|---|---|")
    print("\n".join(rows))
    print(f"{bad} not as it should be, {time.monotonic() - began:.0f} s")
    shutil.rmtree(folder / "disk", ignore_errors=True)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
