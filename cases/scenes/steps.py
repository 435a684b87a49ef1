"""Whether an answer depends on the steps that led to it: a scene by steps as they come, and by short ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .judge import Run, Verdict, read, reason_of
from .scene import Runner, Scene, run

SHORT = {"initial": 0.02, "maximum": 0.04}
VALUES = 7  #: between the ends at which all solutions are compared
SAME, FLOOR = 1e-5, 1e-9  #: relative error of what is compared, and damping ratios that are none
NONE = ["a run without a table"]


def by_steps(scene: Scene, folder: Path, run: Runner = run) -> Verdict:
    """Right: both runs end alike, with as many folds and the same solutions; gave up: one of them did."""
    given = {k: v for k, v in scene.analysis.items() if k != "step"} | {"errors": False, "report_at": values(scene)}
    runs = [
        run(replace(scene, analysis=given | step, timeout=2 * scene.timeout), folder / f"{scene.name}{name}")
        for step, name in (({}, ""), ({"step": SHORT}, ".short"))
    ]
    seconds = sum(done.seconds for done in runs)
    codes = [done.code for done in runs]
    if None in codes:
        return Verdict("hung", [f"exit codes {codes}"], seconds)
    if codes == [2, 2]:
        return Verdict("refused", [], seconds)
    if any(codes):
        word = "gave up" if set(codes) <= {0, 3} else "crashed"
        return Verdict(word, [f"exit codes {codes}", *(reason_of(done) for done in runs if done.code)], seconds)
    tables = [read(scene, done) for done in runs]
    reasons = compare(*tables) if all(tables) else NONE
    return Verdict("wrong" if reasons else "right", reasons, seconds)


def values(scene: Scene) -> list[float]:
    """Amplitudes or frequencies between the ends of a scene's range."""
    if "amplitude" in scene.analysis:
        return [float(a) for a in np.geomspace(*scene.analysis["amplitude"], VALUES + 2)[1:-1]]
    return [float(f) for f in np.linspace(*scene.analysis["frequency"], VALUES + 2)[1:-1]]


def compare(long: list[Run], short: list[Run]) -> list[str]:
    """What is not the same in two runs of a scene."""
    out = []
    for one, other in zip(long, short, strict=True):
        folds = [sum("fold" in event.split() for event in run.columns["event"]) for run in (one, other)]
        if folds[0] != folds[1]:
            out.append(f"folds: {folds[0]}, in short steps {folds[1]}")
        reported = [solutions(run) for run in (one, other)]
        counts = [len(table) for table in reported]
        if counts[0] != counts[1] or min(counts) < VALUES:
            out.append(f"solutions at {VALUES} values: {counts[0]}, in short steps {counts[1]}")
            continue
        off = abs(reported[0] - reported[1])
        if np.any(off > SAME * abs(reported[1]) + [FLOOR if name == "zeta" else 0 for name in columns(one)]):
            out.append(f"a solution that is off by up to {off.max(0)} in {columns(one)}")
    return out


def columns(run: Run) -> list[str]:
    """What is compared; first what is asked for."""
    return ["omega", "amplitude"] if run.method == "forced" else ["amplitude", "omega", "zeta"]


def solutions(run: Run) -> Any:
    """Those at reported values, (count, columns), in order of these values and of what was found there."""
    rows = ["report" in event.split() for event in run.columns["event"]]
    table = np.column_stack([run.columns[name][rows] for name in columns(run)])
    asked = np.array(values(run.scene)) * (2 * np.pi if run.method == "forced" else 1.0)
    place = np.argmin(abs(np.log(table[:, :1] / asked)), axis=1)
    return table[np.lexsort([*table.T[:0:-1], place])]
