"""The mode that grows out of a linear one, walked by the judge's own equations: is a first point of the asked mode?"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .closed import linear_modes, near
from .distance import between, distance

LONGEST, SHORTEST = 0.1, 1e-6  #: steps, of the motion's size
TURN = 0.9  #: cosine of the angle between two steps; farther turned ones are halved
CORNER = 1 / 30  #: of the step before: what is shorter has turned a corner and need only go on
MOST = 2000  #: steps
SMALL = 1e-3  #: of the first row's amplitude, where the walk begins

State = tuple[Any, float, float]


def grown(which: int = 0, tolerance: float = 1e-6) -> Callable[[Any], list[str]]:
    """Frequency and damping of the first row are those of the mode that grows out of a stuck one (from 0)."""

    def form(run: Any) -> list[str]:
        goal = float(run.columns["amplitude"][0])
        state = _walk(run.equations, _linear(run, which, SMALL * goal), goal)
        if state is None:
            return [f"the judge does not walk from the linear mode to the amplitude {goal:g}"]
        found, exact = (complex(-beta, omega) for _, beta, omega in (run.state(0), state))
        return near("lambda of the mode grown from the linear one", found, exact, tolerance, goal)

    return form


def _linear(run: Any, which: int, amplitude: float) -> State:
    """The stuck mode at an amplitude of the normalised dof."""
    eq = run.equations
    frequencies, shapes = linear_modes(run.scene)
    Q = np.zeros((len(shapes), eq.m))
    Q[:, eq.column[1]] = shapes[:, which] * (amplitude / shapes[eq.dof, which])
    return Q, 0.0, float(frequencies[which])


def _walk(eq: Any, here: State, goal: float) -> State | None:
    """Along the branch by secants as long as they turn little, to an amplitude; None where it loses its way."""
    before, step = (here[0] * (1 - LONGEST), *here[1:]), LONGEST
    for _ in range(MOST):
        found = distance(eq, *_ahead(before, here, step))
        if not found.found or not _onwards(before, here, found.solution, step):
            step /= 2
            if step < SHORTEST:
                return None
            continue
        before, here, step = here, found.solution, min(1.3 * step, LONGEST)
        if _amplitude(eq, here) > goal:
            return _at(eq, before, here, goal)
    return None


def _difference(a: State, b: State) -> Any:
    """From a to b, in units of the motion and of the frequency."""
    dQ, dbeta, domega = (y - x for x, y in zip(a, b))
    return np.r_[dQ.ravel() / np.linalg.norm(b[0]), dbeta / abs(b[2]), domega / abs(b[2])]


def _ahead(before: State, here: State, step: float) -> State:
    return between(before, here, 1 + step / np.linalg.norm(_difference(before, here)))


def _onwards(before: State, here: State, there: State, step: float) -> bool:
    """The new step is about as long as it was meant to be and goes on."""
    old, new = _difference(before, here), _difference(here, there)
    lengths = np.linalg.norm(old), np.linalg.norm(new)
    least = TURN if lengths[1] > CORNER * lengths[0] else 0.0
    return bool(lengths[1] < 2 * step and old @ new > least * lengths[0] * lengths[1])


def _amplitude(eq: Any, state: State) -> float:
    k = eq.column[1]
    return float(np.hypot(state[0][eq.dof, k], state[0][eq.dof, k + 1]))


def _at(eq: Any, low: State, high: State, goal: float) -> State | None:
    """The point of this amplitude between two, by the secant's rule."""
    for _ in range(30):
        a, b = _amplitude(eq, low), _amplitude(eq, high)
        if abs(b / goal - 1) < 1e-9:
            return high
        found = distance(eq, *between(low, high, (goal - a) / (b - a)))
        if not found.found:
            return None
        low, high = high, found.solution
    return None
