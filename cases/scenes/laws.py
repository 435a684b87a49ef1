"""Contact laws for the judge, written from their definitions (`src/contact`), at every time of the period.

Every function takes one period of motion as coefficients (m, lanes) of waves. Lanes share their real part, which says
where states change; a motion u + 1e-30 i du gives the force's exact derivative along du in the imaginary part. Nothing
here is shared with the solver. Friction on a circle is in `pads` and `circle`.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.optimize import minimize_scalar

from .circle import TURN, zero

PANEL = 20  #: points of Gauss in a panel of tanh
FIRST = 0.0123  #: time at which a period is begun, where motions that are measured from their phase have no root


def regularised_coulomb(V, limit, eps, waves):
    """limit tanh(v / eps) at every time of the period: Gauss's quadrature on panels over which v / eps changes little.

    Parameters
    ----------
    V : (m, lanes) of the velocity
    limit, eps : numbers
    waves : callable
        (times, m) from times: 1, cos n tau, sin n tau

    Returns
    -------
    (m, lanes) integrals of f and the waves over the period
    """
    node, weight = _nodes(PANEL)
    first, count = V[:, 0].real / eps, 4 * len(V)
    middle, half, done = FIRST + TURN * (np.arange(count) + 0.5) / count, np.full(count, np.pi / count), []
    while len(half):
        tau = middle[:, None] + half[:, None] * node
        ratio = (waves(tau.ravel()) @ first).reshape(tau.shape)
        least, change = abs(ratio).min(axis=1), np.ptp(ratio, axis=1)
        # tanh is 1 beyond 20, and has its poles at i pi / 2: a panel that sees none of either converges in few points
        fine = (change < 2) | (least > 20 + change) | (half < 1e-14)
        done.append((middle[fine], half[fine]))
        middle, half = middle[~fine], half[~fine] / 2
        middle, half = np.r_[middle - half, middle + half], np.r_[half, half]
    middle, half = (np.concatenate(x) for x in zip(*done))
    tau, share = (middle[:, None] + half[:, None] * node).ravel(), (half[:, None] * weight).ravel()
    wave = waves(tau)
    ratio = wave @ (V / eps)
    # complex exponentials would overflow beyond
    inside = np.clip(ratio.real, -20.0, 20.0) + 1j * np.where(abs(ratio.real) < 20.0, ratio.imag, 0.0)
    return limit * ((wave * share[:, None]).T @ np.tanh(inside))


def jenkins(coefficients, rates, stiffness, limit, waves):
    """Elastic Coulomb slider: f = kt (u - w), |f| <= limit, at every time of the second period from rest.

    From one turning point of u to the next it sticks until |u - w| is the reach, limit / kt, and slips from there on.
    Neither those points nor the ends of sticking move the force, which has no jump: real parts say where they are.

    Parameters
    ----------
    coefficients, rates : (m, lanes) of u and of du/dtau
    stiffness, limit : numbers
    waves : callable
        (times, m) from times: 1, cos n tau, sin n tau

    Returns
    -------
    (m, lanes) integrals of f and the waves over the period
    """
    m, reach, out = len(coefficients), limit / stiffness, np.zeros_like(coefficients)

    def stretch(tau, held):
        """u - w at these times: since a time of `held`, at which the slider was dragged; from rest without one."""
        if held is None:
            return waves(tau) @ coefficients
        return _risen(waves, tau, held[0]) @ coefficients + held[1] * reach

    def first(tau, held):
        return float(stretch(np.atleast_1d(tau), held)[0, 0].real)

    def add(begin, end, force):
        tau, weight, wave = _gauss(begin, end, m, waves)
        out[...] += (wave * weight[:, None]).T @ force(tau)

    turns = _roots(lambda tau: waves(tau) @ rates[:, 0].real, m)
    turns = np.r_[turns, turns[0] + 2 * np.pi] if len(turns) else np.array([FIRST, FIRST + 2 * np.pi])
    held = None
    for second in (False, True):
        for begin, end in zip(turns[:-1], turns[1:]):
            away = first(end, held)
            side, onset = np.sign(away), end
            if abs(away) > reach:
                late = side * first(begin, held) >= reach
                onset = begin if late else zero(lambda t, h=held, s=side: first(t, h) - s * reach, begin, end)
            if second:
                add(begin, onset, lambda tau, held=held: stiffness * stretch(tau, held))
                add(onset, end, lambda tau, f=side * limit: np.full((len(tau), 1), f))
            if abs(away) > reach:
                held = (end, side)
        held = held and (held[0] - 2 * np.pi, held[1])
    return out


def _risen(waves, tau, since):
    """Waves less what they were at a time, to all digits of so small a difference (times, m)."""
    middle, half = waves((tau + since) / 2), waves((tau - since) / 2)
    constant = middle.shape[1] % 2
    out = np.zeros_like(middle)
    out[:, constant::2] = -2 * middle[:, constant + 1 :: 2] * half[:, constant + 1 :: 2]
    out[:, constant + 1 :: 2] = 2 * middle[:, constant::2] * half[:, constant + 1 :: 2]
    return out


_nodes = cache(np.polynomial.legendre.leggauss)


def _gauss(begin, end, m, waves):
    """Nodes, weights and waves of a quadrature that is exact for products of two motions."""
    nodes, weights = _nodes(4 * m + 24)
    half = (end - begin) / 2
    tau = (begin + end) / 2 + half * nodes
    return tau, half * weights, waves(tau)


def stop(coefficients, stiffness, load, waves):
    """f = max(0, load + k u) at every time of the period: from root to root by Gauss's quadrature.

    The ends of a contact do not move its force, which is zero there: only real parts say where they are.

    Parameters
    ----------
    coefficients : (m, lanes) of u
    stiffness, load : numbers
    waves : callable
        (times, m) from times: 1, cos n tau, sin n tau

    Returns
    -------
    (m, lanes) integrals of f and the waves over the period
    """
    first, out = coefficients[:, :1].real, np.zeros_like(coefficients)
    spans = closed_spans(lambda tau: load + stiffness * (waves(tau) @ first)[:, 0], len(coefficients))
    if spans == [(0.0, TURN)]:  # exactly: motions may be below the last digits of the load
        constant = len(coefficients) % 2
        out[:] = np.pi * stiffness * coefficients
        out[:constant] = TURN * (load + stiffness * coefficients[:constant])
        return out
    for begin, end in spans:
        _, weight, wave = _gauss(begin, end, len(coefficients), waves)
        out += (wave * weight[:, None]).T @ (load + stiffness * (wave @ coefficients))
    return out


def _roots(f, m):
    """Roots of f in a period: sign changes between the points of a fine grid and the extrema between them."""
    grid = FIRST + 2 * np.pi * np.arange(-1, 64 * m + 2) / (64 * m)
    value = f(grid)
    low, here, high = value[:-2], value[1:-1], value[2:]
    peak = (here - low) * (high - here) < 0
    extrema = [_extremum(f, grid[i : i + 3], np.sign(here[i]) or 1.0) for i in np.flatnonzero(peak)]
    tau = np.unique(np.r_[grid[1:-1], [x for x in extrema if FIRST < x < FIRST + 2 * np.pi]])
    value = f(tau)
    turns = np.flatnonzero((value[:-1] > 0) != (value[1:] > 0))
    return np.array([zero(lambda t: f(np.array([t]))[0], tau[i], tau[i + 1]) for i in turns])


def _extremum(f, three, sign):
    """Where sign f is least between three times: two roots may lie nearer to one another than a parabola tells."""
    found = minimize_scalar(
        lambda t: sign * f(np.array([t]))[0], bounds=(three[0], three[2]), method="bounded", options={"xatol": 1e-10}
    )
    return float(found.x)


def closed_spans(f, m):
    """Where f > 0 in a period."""
    ends = _roots(f, m)
    closed = f(np.array([FIRST]))[0] > 0
    if not len(ends):
        return [(0.0, 2 * np.pi)] if closed else []
    if closed:
        ends = np.r_[ends[-1] - 2 * np.pi, ends[:-1]]
    return list(zip(ends[::2], ends[1::2]))
