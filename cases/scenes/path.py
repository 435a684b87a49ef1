"""The branch as a whole: its ends, its values, what it was asked to report, and whether it hangs together."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from .distance import between, distance

STOP = 1e-6  #: relative distance of the last row from the asked end
SAME = 1e-9  #: relative, of a reported value
BACK = 0.05  #: of a step: a later point this near to an earlier piece of the branch retraces it
SECONDS = 1.0  #: for the search for jumps
TWICE = 3  #: consecutive points that retrace
ABREAST = 6  #: corrections that bring an earlier piece abreast of a row
APART = 1e-5  #: of a step: what lies nearer is one branch
SHORT = 0.02  #: of a step: shorter ones beside it tell nothing of how it bends


def values(run: Any) -> list[str]:
    """What no table may contain, and columns that contradict the motion beside them."""
    c, out = run.columns, []
    names = ["amplitude", "omega", "frequency_hz", *([] if run.method == "forced" else ["beta", "zeta", "omega0"])]
    for name in names:
        if not np.all(np.isfinite(c[name])):
            out.append(f"{name} is not finite in {np.count_nonzero(~np.isfinite(c[name]))} rows")
    if not np.all(np.isfinite(run.Q)):
        out.append("coefficients are not finite")
    if out:
        return out
    # EPMC above zeta = 1: the free motion w0 sqrt(1 - zeta^2) does not oscillate, omega is 0
    slow = c["zeta"] >= 1 if run.method == "EPMC" else np.zeros(len(c["omega"]), bool)
    for name in ("amplitude", "omega", "omega0"):
        if name in c and np.any(c[name][~slow if name == "omega" else slice(None)] <= 0):
            out.append(f"{name} {c[name].min():.4g} is not positive")
    if np.any(c["omega"][slow] != 0):
        out.append("omega of a motion that does not oscillate is not 0")
    if out:
        return out
    eq = run.equations
    k = eq.column[1]
    moved = np.hypot(run.Q[:, eq.dof, k], run.Q[:, eq.dof, k + 1])
    if np.any(abs(moved - c["amplitude"]) > 1e-9 * abs(c["amplitude"])):
        out.append("the amplitude column is not that of the coefficients")
    if run.method != "forced":
        w0 = np.where(slow, c["omega0"], np.hypot(c["omega"], c["beta"]))
        if np.any(abs(w0 - c["omega0"]) > 1e-9 * w0) or np.any(abs(c["zeta"] - c["beta"] / w0) > 1e-9):
            out.append("omega, omega0, beta and zeta contradict one another")
    return out


def broken(run: Any) -> bool:
    """Nothing more can be read from this table."""
    return len(run.Q) == 0 or bool(values(run))


def complaints(run: Any) -> list[str]:
    """What is wrong with a branch that ended with exit 0."""
    if broken(run):
        return [] if len(run.Q) else ["no rows"]
    return [*_ends(run), *_reports(run), *_folds(run), *retraced(run), *jumps(run)]


def _asked(run: Any) -> tuple[float, float]:
    a = run.scene.analysis
    first, last = a["amplitude"] if run.method != "forced" else [2 * np.pi * f for f in a["frequency"]]
    return first, last


def _ends(run: Any) -> list[str]:
    out, p = [], run.parameter
    for what, row, value in zip(("begins", "ends"), (0, -1), _asked(run)):
        if abs(p[row] / value - 1) > STOP:
            out.append(f"the branch {what} at {p[row]:.6g} in place of {value:.6g}")
    return out


def _reports(run: Any) -> list[str]:
    """Each reported value once for every time that the rows pass it."""
    out, p = [], run.parameter
    unit = 2 * np.pi if run.method == "forced" else 1.0
    for value in run.scene.analysis.get("report_at", []):
        value *= unit
        at = abs(p / value - 1) < SAME
        rows = p[~at]
        passed = int(np.count_nonzero((rows[:-1] - value) * (rows[1:] - value) < 0))
        known = run.scene.reports.get(value / unit, max(1, passed))
        if np.count_nonzero(at & (run.columns["event"] == "report")) < known:
            out.append(f"{value:g} is there {known} times and reported {np.count_nonzero(at)} times")
    return out


def _folds(run: Any) -> list[str]:
    """Folds that are there: turns of the parameter between rows, and those known beforehand."""
    p = np.delete(run.parameter, np.flatnonzero(np.diff(run.parameter) == 0))
    turns = int(np.count_nonzero(np.diff(np.sign(np.diff(p)))))
    named = int(np.count_nonzero(run.columns["event"] == "fold"))
    known = run.scene.folds
    if known is not None and (named != known):
        return [f"{named} folds are named, {turns} turns are in the table; the branch has {known}"]
    return []


def coordinates(run: Any, mean: bool = False) -> Any:
    """Rows as points: motion over amplitude, decay and frequency over the first frequency, log amplitude.

    Of a response with its mean, of a mode without unless it is asked for.
    """
    c, n = run.columns, len(run.Q)
    if run.method == "forced":
        size = abs(run.Q).max()
        return np.column_stack([run.Q.reshape(n, -1) / size, c["omega"] / c["omega"].mean()])
    first = 1 if run.equations.orders[0] == 0 else 0
    size = np.linalg.norm(run.Q[:, :, first:].reshape(n, -1), axis=1, keepdims=True)
    motion = run.Q[:, :, 0 if mean else first :].reshape(n, -1) / size
    return np.column_stack([motion, c["beta"] / c["omega0"][0], c["omega"] / c["omega0"][0], np.log(c["amplitude"])])


def retraced(run: Any) -> list[str]:
    """Points that come back along earlier pieces of the branch, the other way."""
    z = coordinates(run, mean=True)
    rows = np.flatnonzero(np.r_[True, np.linalg.norm(np.diff(z, axis=0), axis=1) > 1e-12])
    z = z[rows]
    count = 0
    for i in range(4, len(z)):
        step = z[i] - z[i - 1]
        a, d = z[: i - 2], np.diff(z[: i - 1], axis=0)
        square = (d * d).sum(axis=1)
        along = np.clip(((z[i] - a) * d).sum(axis=1) / square, 0, 1)
        away = np.linalg.norm(z[i] - a - along[:, None] * d, axis=1)
        lengths = np.sqrt(square)
        against = d @ step < -0.9 * lengths * np.linalg.norm(step)
        near = (away < BACK * np.minimum(lengths, np.linalg.norm(step))) & against
        j = int(np.argmin(np.where(near, away, np.inf)))
        count = count + 1 if near[j] and _same_piece(run, rows, i, j, along[j]) else 0
        if count == TWICE:
            return [f"retraces its own points from {run.parameter[min(i, len(run.Q) - 1)]:.6g} on"]
    return []


def _same_piece(run: Any, rows: Any, i: int, j: int, along: float) -> bool:
    """Whether row i lies on the branch between rows j and j + 1: behind a fold pieces may be side by side.

    The earlier piece is solved abreast of the row, where the chord has no part of what lies between the two. Where it
    ends before (a corner), what lay beside the chord as long as it was there tells.
    """
    first = max(0, min(j - 1, i - 4))
    near = [run.state(int(k)) for k in rows[first : first + 4]]
    start, end, here = near[j - first], near[j - first + 1], run.state(int(rows[i]))
    chord = (end[0] - start[0]).ravel()
    square, beside = chord @ chord, 0.0
    if square == 0.0:  # rows that rounding alone tells apart
        return False
    for _ in range(ABREAST):
        found = distance(run.equations, *_by_cubic(near, j - first, along))
        if not found.found:
            return beside < BACK
        off = (here[0] - found.solution[0]).ravel()
        missed = (off @ chord) / square
        beside = float(np.linalg.norm(off - chord * missed) / np.sqrt(square))
        along += missed
        if abs(missed) < APART or not -1 < along < 2:  # beside the chord there is nothing to be solved
            break
    return beside < APART


def _by_cubic(states: list[Any], k: int, along: float) -> tuple[Any, ...]:
    """By the cubic through four states over the length of their chords, between the k-th and the next."""
    chords = [np.linalg.norm(b[0] - a[0]) for a, b in zip(states, states[1:])]
    if min(chords) < SHORT * chords[k]:  # an event beside a point: the cubic would swing
        return between(states[k], states[k + 1], along)
    at = np.r_[0, np.cumsum(chords)]
    t = at[k] + along * chords[k]
    shares = [np.prod([(t - at[m]) / (at[n] - at[m]) for m in range(4) if m != n]) for n in range(4)]
    return tuple(sum(share * state[part] for share, state in zip(shares, states)) for part in range(3))


def jumps(run: Any, most: int = 4) -> list[str]:
    """The longest and most turning steps are bisected: a branch closes in on them, two branches keep their gap."""
    z = coordinates(run)
    d = np.diff(z, axis=0)
    lengths = np.linalg.norm(d, axis=1)
    if run.Q[0].size > 400 or len(lengths) < 3:
        return []
    chords = d / np.maximum(lengths, 1e-300)[:, None]
    turn = np.r_[0, np.arccos(np.clip((chords[1:] * chords[:-1]).sum(axis=1), -1, 1))]
    weight, begin = lengths * (1 + turn), time.thread_time()
    for row in np.argsort(-weight)[:most]:
        if time.thread_time() - begin > SECONDS:
            break
        gap = _gap(run, int(row))
        if gap is not None:
            return [f"jumps between rows {row} and {row + 1}, at {run.parameter[row]:.6g}: a gap of {gap:.1e} stays"]
    return []


def _gap(run: Any, row: int, halvings: int = 14) -> float | None:
    """What is left of the chord between two rows after bisection towards its larger part, if much is left.

    A branch that folds over within it is lost by bisection: it is walked then from one end to the other, and from the
    first to the last where bisection may have gone over to another piece of it beside a fold.
    """
    eq = run.equations
    rows = ends = [run.state(row), run.state(row + 1)]
    size = np.linalg.norm(ends[0][0]) or 1.0

    def chord(a: Any, b: Any) -> float:
        return float(np.linalg.norm(a[0] - b[0]) / size + (abs(a[1] - b[1]) + abs(a[2] - b[2])) / abs(ends[0][2]))

    first = before = run.state(row - 1) if row else None
    whole = chord(*ends)
    for _ in range(halvings):
        found = distance(eq, *between(*ends, 0.5))
        if not found.found:
            return None
        parts = [chord(ends[0], found.solution), chord(found.solution, ends[1])]
        if parts[0] < parts[1]:
            before = ends[0]
        ends = [ends[0], found.solution] if parts[0] >= parts[1] else [found.solution, ends[1]]
        if max(parts) < 0.02 * whole:
            return None
    ways = [(start, *way) for start, way in ((before, ends), (first, rows)) if start is not None]
    return None if any(_walks(eq, *way, chord) for way in ways) else max(parts)


def _walks(eq: Any, before: Any, here: Any, goal: Any, chord: Any, share: float = 1 / 40, most: int = 60) -> bool:
    """Whether short steps along the secant lead from one solution to another, without a detour."""
    length = share * chord(here, goal)
    for _ in range(most):
        found = distance(eq, *between(before, here, 1 + length / chord(before, here)))
        if not found.found:
            return False
        before, here = here, found.solution
        if chord(here, goal) < 2 * length:
            return True
    return False
