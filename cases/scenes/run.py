#!/usr/bin/env python3
"""Runs scenes through `fretwave run` and judges each by equations of its own.

Verdicts: right; wrong (exit 0, judged wrong); kept (gave up, with wrong points in the table); gave up (exit 3, its
points right); refused (exit 2); crashed; hung. The exit code is the number of wrong, kept, crashed and hung scenes.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scenes import list_contact, list_forced, list_friction, list_random  # noqa: E402
from scenes.judge import Verdict, judge, read  # noqa: E402
from scenes.scene import Finished, Runner, Scene, run  # noqa: E402
from scenes.steps import by_steps  # noqa: E402

WORDS = ["right", "wrong", "kept", "gave up", "refused", "crashed", "hung"]


def all_scenes() -> list[Scene]:
    """Every scene, each name once."""
    scenes = [s for part in (list_forced, list_friction, list_contact) for s in part.scenes()]
    names = Counter(scene.name for scene in scenes)
    assert max(names.values()) == 1, [name for name, count in names.items() if count > 1]
    return scenes


def one(scene: Scene, folder: Path, run: Runner = run) -> Verdict:
    """Run and judge a scene, and its twin beside it."""
    done = run(scene, folder / scene.name)
    verdict = judge(scene, done)
    if scene.twin is not None and verdict.word == "right":
        verdict.reasons = compare(scene, done, run(scene.twin[0], folder / f"{scene.name}.twin"))
        verdict.word = "wrong" if verdict.reasons else "right"
    return verdict


def compare(scene: Scene, done: Finished, twin: Finished, tolerance: float = 1e-9) -> list[str]:
    """What differs between a scene and its twin in other units, at the reported amplitudes."""
    base, length, time = scene.twin
    runs = [read(base, twin), read(scene, done)]
    if not all(runs):
        return [f"the twin in other units has no table (exit {twin.code})"]
    out = []
    for a in base.analysis["report_at"]:
        rows = []
        for (table,), factor in zip(runs, (1.0, length)):
            c = table.columns
            near = abs(c["amplitude"] / (a * factor) - 1) < 1e-9
            rows.append({k: c[k][near][0] for k in ("omega", "zeta")} if near.any() else {})
        if not all(rows):
            out.append(f"no report at {a:g} in one of the unit systems")
            continue
        omega, zeta = rows[1]["omega"] * time / rows[0]["omega"] - 1, rows[1]["zeta"] - rows[0]["zeta"]
        if abs(omega) > tolerance or abs(zeta) > tolerance:
            out.append(f"at {a:g} the unit systems differ by {omega:.1e} in omega and {zeta:.1e} in zeta")
    return out


def keep(file: Path, results: dict[str, tuple[Scene, Verdict]]) -> None:
    """Verdicts so far, with all measured figures."""
    rows = {name: {**vars(v), "axis": s.axis} for name, (s, v) in results.items()}
    file.write_text(json.dumps(rows, indent=1, default=float))


def recall(scene: Scene, known: dict[str, Any]) -> Verdict | None:
    """The verdict of an earlier, unfinished call."""
    row = known.get(scene.name)
    return None if row is None else Verdict(**{k: v for k, v in row.items() if k != "axis"})


def table(results: dict[str, tuple[Scene, Verdict]]) -> str:
    """Verdicts by axis, then everything that is not right, in Markdown."""
    axes = list(dict.fromkeys(scene.axis for scene, _ in results.values()))
    lines = ["| axis | scenes | " + " | ".join(WORDS) + " |", "|---|" + "---:|" * (len(WORDS) + 1)]
    for axis in [*axes, "all"]:
        words = [v.word for s, v in results.values() if axis in (s.axis, "all")]
        lines.append(f"| {axis} | {len(words)} | " + " | ".join(str(words.count(word)) for word in WORDS) + " |")
    lines += ["", "| scene | verdict | s | rows | measured |", "|---|---|---:|---:|---|"]
    for name, (_, v) in results.items():
        if v.word != "right":
            lines.append(f"| {name} | {v.word} | {v.seconds:.1f} | {v.rows} | {'; '.join(v.reasons)[:400]} |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="names, or parts of names or axes, separated by commas")
    parser.add_argument("--quick", action="store_true", help="the short list of the tests")
    parser.add_argument("--list", action="store_true", help="names and axes")
    parser.add_argument("--random", type=int, metavar="COUNT", help="as many scenes at random, not the list")
    parser.add_argument("--seed", type=int, default=1, help="of --random")
    parser.add_argument("--mixed", action="store_true", help="of --random: two or three contacts in each")
    parser.add_argument("--steps", action="store_true", help="whether answers depend on steps; nothing else is judged")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument(
        "--keep", type=Path, help="folder for cases and results; repeat one by `fretwave run KEEP/NAME/case.toml`"
    )
    parser.add_argument("--json", type=Path, help="verdicts with all measured figures")
    parser.add_argument("--go-on", action="store_true", help="take over what stands in the file of --json")
    args = parser.parse_args()
    wanted = [word for word in args.only.split(",") if word]
    if args.mixed and not args.random:
        parser.error("--mixed goes with --random")
    if args.steps and args.go_on:
        parser.error("--go-on takes over verdicts of the judge alone")
    at_random = list_random.mixed if args.mixed else list_random.scenes
    scenes = list(at_random(args.random, args.seed)) if args.random else all_scenes()
    scenes = [s for s in scenes if not args.quick or s.quick]
    scenes = [s for s in scenes if not wanted or any(w == s.name or w in s.name or w in s.axis for w in wanted)]
    if args.list:
        print("\n".join(f"{s.name:40s} {s.axis}" for s in scenes), f"\n{len(scenes)} scenes")
        return 0
    results: dict[str, tuple[Scene, Verdict]] = {}
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(args.jobs) as pool:
        folder = args.keep or Path(temporary)
        verdict_on = by_steps if args.steps else one
        known = json.loads(args.json.read_text()) if args.go_on and args.json.exists() else {}
        for scene, verdict in zip(scenes, pool.map(lambda s: recall(s, known) or verdict_on(s, folder), scenes)):
            results[scene.name] = (scene, verdict)
            if args.json:
                keep(args.json, results)
            print(
                f"{scene.name:40s} {verdict.word:8s} {verdict.seconds:6.1f} s  {'; '.join(verdict.reasons)[:300]}",
                flush=True,
            )
    print("\n" + table(results))
    return sum(v.word in ("wrong", "kept", "crashed", "hung") for _, v in results.values())


if __name__ == "__main__":
    sys.exit(main())
