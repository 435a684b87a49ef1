"""The verdict on a scene's run, from its results alone: arrived, whole, finite, on the branch, as closed forms say."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field
from typing import Any

import h5py
import numpy as np

from . import path
from .distance import Distance, at_its_amplitude, distance
from .equations import Equations
from .scene import Finished, Scene

OMEGA, ZETA, ZETA_FLOOR, MOTION = (
    1e-6,
    1e-4,
    1e-9,
    1e-6,
)  #: bars of a point's errors; zeta's is relative above its floor
ZETA_MOST = 1e-8  #: what rounding may add to zeta's bar, whatever the stiffness
SECONDS = 1.5  #: for judging points of one branch, four at least


@dataclass
class Run:
    """A table of results with its equations.

    Attributes
    ----------
    columns : arrays by name
    Q : (rows, n_dof, m)
    """

    scene: Scene
    columns: dict[str, Any]
    Q: Any
    equations: Equations
    method: str

    @property
    def parameter(self) -> Any:
        """What the branch runs over: amplitude of a mode, angular frequency of a response."""
        return self.columns["omega" if self.method == "forced" else "amplitude"]

    def state(self, row: int) -> tuple[Any, float, float]:
        """Q, beta and the frequency that the equations take (w0 of EPMC)."""
        c = self.columns
        if self.method == "forced":
            return self.Q[row], 0.0, float(c["omega"][row])
        return self.Q[row], float(c["beta"][row]), float(c["omega0" if self.method == "EPMC" else "omega"][row])

    def at(self, value: float, column: str, parameter: str | None = None) -> float:
        """A column at the row nearest to a value of the parameter."""
        where = self.parameter if parameter is None else self.columns[parameter]
        return float(self.columns[column][np.argmin(abs(np.log(abs(where) / value)))])


@dataclass
class Verdict:
    """What became of a scene.

    Attributes
    ----------
    word : right, wrong, kept (gave up, with wrong points), gave up, refused, crashed, hung
    reasons : measured, one line each
    worst : largest errors of the judged points
    """

    word: str
    reasons: list[str] = field(default_factory=list)
    seconds: float = 0.0
    rows: int = 0
    judged: int = 0
    worst: dict[str, float] = field(default_factory=dict)


def read(scene: Scene, done: Finished) -> list[Run]:
    """Tables of a finished run: one of a mode, one for each level of a response."""
    file = done.folder / "results.h5"
    if not file.exists():
        return []
    with h5py.File(file, locking=False) as results:
        if "scene" not in results:
            return []
        group = results["scene"]
        columns = {name: data[()] for name, data in group["points"].items()}
        columns["event"] = np.array([text.decode() for text in columns["event"]])
        orders = sorted({int("".join(filter(str.isdigit, label.decode()))) for label in group["harmonic"][()]})
        Q = group["coefficients"][()]
    method = scene.analysis.get("method", "CNM") if scene.analysis["type"] == "mode" else "forced"
    dof = int(scene.analysis["normalise" if method != "forced" else "observe"][1:])
    C = scene.C
    for damper in scene.analysis.get("dampers", []):
        C = np.zeros(np.shape(scene.M)) if C is None else np.array(C, float)
        C[int(damper["dof"][1:]), int(damper["dof"][1:])] += damper["c"]
    runs = []
    for level in np.unique(columns["level"]) if method == "forced" else [None]:
        rows = slice(None) if level is None else columns["level"] == level
        force = np.zeros(np.shape(scene.M)[0])
        for name, value in scene.analysis.get("force", {}).items():
            force[int(name[1:])] = value * level
        eq = Equations(
            scene.M, scene.K, C, scene.contacts, orders, method, dof, force if level else None, bool(scene.preload)
        )
        runs.append(Run(scene, {k: v[rows] for k, v in columns.items()}, Q[rows], eq, method))
    return runs


def reason_of(done: Finished) -> str:
    """The reason of a give-up, as run.json or the last lines have it."""
    try:
        entries = json.loads((done.folder / "run.json").read_text())["analyses"]
        entries = entries.values() if isinstance(entries, dict) else entries
        found = [e.get("reason", "") for e in entries if e.get("reason")]
        if found and found[-1]:
            return str(found[-1])
    except (OSError, ValueError, KeyError, AttributeError):
        pass
    lines = [line.strip() for line in done.text.splitlines() if line.strip()]
    return " | ".join(lines[-3:])


def judge(scene: Scene, done: Finished) -> Verdict:
    """Verdict on a finished run; where the judge's own integration fails it says so, and does not say right."""
    try:
        return _judge(scene, done)
    except ArithmeticError as error:
        return Verdict("wrong", [f"the judge fails: {error}"], done.seconds)


@np.errstate(all="ignore")
def _judge(scene: Scene, done: Finished) -> Verdict:
    """The same; tables that hold infinities are read as they are."""
    reason = reason_of(done)
    if done.code is None:
        return Verdict("hung", [f"not ended after {scene.timeout:g} s of processor time"], done.seconds)
    if done.code == 2:
        return Verdict("right" if scene.answer == "none" else "refused", [reason], done.seconds)
    if done.code not in (0, 3) or "Traceback" in done.text:
        return Verdict("crashed", [f"exit {done.code}: {reason}"], done.seconds)
    try:
        runs = read(scene, done)
    except (OSError, KeyError) as error:
        return Verdict("crashed", [f"results cannot be read: {error!r}"], done.seconds)
    verdict = Verdict("right", [], done.seconds, sum(len(run.Q) for run in runs))
    for run in runs:
        verdict.reasons += _points(run, verdict)
    if done.code == 3:
        return _gave_up(scene, verdict, reason)
    if scene.answer != "branch":
        verdict.reasons.append(f"exit 0, but there is no answer ({scene.answer})")
    levels = len(scene.analysis.get("levels", [0]))
    if len(runs) != levels:
        verdict.reasons.append(f"{len(runs)} of {levels} branches in the table")
    for run in runs:
        verdict.reasons += path.complaints(run)
        if not path.broken(run):
            for form in scene.closed:
                verdict.reasons += form(run)
    verdict.word = "wrong" if verdict.reasons else "right"
    return verdict


def _gave_up(scene: Scene, verdict: Verdict, reason: str) -> Verdict:
    if verdict.reasons:
        verdict.word = "kept"
    elif scene.answer == "none":
        verdict.word = "right"
    elif scene.answer == "unbounded":
        levels = scene.analysis["levels"]
        named = any(f"{level:g}" in reason for level in levels)
        verdict.word = "right" if named else "gave up"
    else:
        verdict.word = "gave up"
    verdict.reasons.append(reason)
    return verdict


def _points(run: Run, verdict: Verdict) -> list[str]:
    """Errors of as many points as the time allows, the most telling first."""
    bad = path.values(run)
    if bad:
        return bad
    begin, worst, rows = time.thread_time(), None, _order(run)
    while rows and (verdict.judged < 4 or time.thread_time() - begin < SECONDS):
        row = rows.pop(0)
        found = distance(run.equations, *run.state(row), lambda d, row=row: not errors(run, row, d))
        verdict.judged += 1
        for key in ("omega", "zeta", "motion", "balance"):
            verdict.worst[key] = max(verdict.worst.get(key, 0.0), getattr(found, key))
        wrong = errors(run, row, found)
        if wrong and run.method != "forced":
            wrong = errors(run, row, found, last_digits(run, row, found))
            wrong = wrong if wrong and _off_at_its_amplitude(run, row) else []
        if wrong and (worst is None or found.motion > worst[1].motion):
            worst = (row, found, wrong)
    if worst is None:
        return []
    row, found, wrong = worst
    where = f"at {run.parameter[row]:.6g}, row {row} (residual column {run.columns['residual'][row]:.1e})"
    way = "from the solution" if found.found else "by the first Newton step, no solution found near it"
    return [f"{', '.join(wrong)} off {way}, force unbalanced {found.balance:.1e} of those acting, {where}"]


def _off_at_its_amplitude(run: Run, row: int) -> bool:
    """Whether omega, zeta or the motion is off the solution at the mode's own amplitude, or there is none."""
    held = at_its_amplitude(run.equations, *run.state(row))
    return not held.found or bool(errors(run, row, held)) or not held.motion <= MOTION


def rounding(run: Run) -> float:
    """Of zeta, by what double precision leaves of the forces of contact stiffer than the structure."""
    stiffest = max((float(np.max(c.stuck(), initial=0.0)) for c in run.scene.contacts), default=0.0)
    mass = float(np.max(run.scene.M.diagonal()))
    return float(np.finfo(float).eps * stiffest / (mass * float(run.columns["omega0"][0]) ** 2))


def last_digits(run: Run, row: int, d: Distance, times: int = 4) -> float:
    """How far zeta's error moves with the last digits of the motion, as where the static part hides what slips."""
    (Q, *rest), random = run.state(row), np.random.default_rng(0)
    steps = [np.finfo(float).eps * random.integers(-1, 2, Q.shape) for _ in range(times)]
    return max(abs(distance(run.equations, Q * (1 + step), *rest).zeta - d.zeta) for step in steps)


def errors(run: Run, row: int, d: Distance, noise: float = 0.0) -> list[str]:
    """Which errors of a point are above their bars, which rounding widens by up to `ZETA_MOST`.

    Parameters
    ----------
    noise : of zeta, by rounding
    """
    out = []
    if not d.omega <= OMEGA:
        out.append(f"omega {d.omega:.1e}")
    if run.method == "forced":
        return out if d.motion <= MOTION else [*out, f"motion {d.motion:.1e}"]
    zeta = abs(float(run.columns["zeta"][row]))
    if not d.zeta <= ZETA * zeta + ZETA_FLOOR + min(rounding(run) + noise, ZETA_MOST):
        out.append(f"zeta {d.zeta:.1e} of {zeta:.1e}")
    return out


def _order(run: Run) -> list[int]:
    """Rows: ends, largest residual, events, largest damping or amplitude, then evenly."""
    c, n = run.columns, len(run.Q)
    peak = c["amplitude" if run.method == "forced" else "zeta"]
    first = [n - 1, 0, int(np.nanargmax(c["residual"])), int(np.nanargmax(peak)), n // 2]
    events = [i for i in range(n) if c["event"][i]]
    rest = np.random.default_rng(0).permutation(n).tolist()
    return list(dict.fromkeys([*first, *events, *rest]))
