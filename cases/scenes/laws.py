"""Contact laws for the judge, written from their definitions (DESIGN, section 6), at every time of the period.

Every function takes one period of motion as coefficients (m, lanes) of waves. Lanes share their real part, which says
where states change; a motion u + 1e-30 i du gives the force's exact derivative along du in the imaginary part. Nothing
here is shared with the solver. Friction on a circle is in `pads` and `circle`.
"""

from __future__ import annotations

from functools import cache

import numpy as np

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

    def u(tau):
        return waves(np.atleast_1d(tau)) @ coefficients

    def first(tau):
        return float((waves(np.atleast_1d(tau)) @ coefficients[:, 0].real)[0])

    def add(begin, end, force):
        tau, weight, wave = _gauss(begin, end, m, waves)
        out[...] += (wave * weight[:, None]).T @ force(tau)

    turns = _roots(lambda tau: waves(tau) @ rates[:, 0].real, m)
    turns = np.r_[turns, turns[0] + 2 * np.pi] if len(turns) else np.array([FIRST, FIRST + 2 * np.pi])
    w = 0j * coefficients[0]
    for second in (False, True):
        for begin, end in zip(turns[:-1], turns[1:]):
            away = first(end) - w[0].real
            side, onset = np.sign(away), end
            if abs(away) > reach:
                goal = w[0].real + side * reach
                late = side * (first(begin) - goal) >= 0
                onset = begin if late else zero(lambda t, g=goal: first(t) - g, begin, end)
            if second:
                add(begin, onset, lambda tau, w=w: stiffness * (u(tau) - w))
                add(onset, end, lambda tau, f=side * limit: np.full((len(tau), 1), f))
            if abs(away) > reach:
                w = u(end)[0] - side * reach
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
    for begin, end in closed_spans(lambda tau: load + stiffness * (waves(tau) @ first)[:, 0], len(coefficients)):
        _, weight, wave = _gauss(begin, end, len(coefficients), waves)
        out += (wave * weight[:, None]).T @ (load + stiffness * (wave @ coefficients))
    return out


def _roots(f, m):
    """Roots of f in a period: sign changes between the points of a fine grid and the extrema of its parabolas."""
    grid = FIRST + 2 * np.pi * np.arange(-1, 64 * m + 2) / (64 * m)
    value = f(grid)
    low, here, high = value[:-2], value[1:-1], value[2:]
    peak = (here - low) * (high - here) < 0
    bent = np.where(peak, low - 2 * here + high, 1.0)
    extrema = (grid[1:-1] + np.where(peak, (low - high) / (2 * bent), 0.0) * (grid[1] - grid[0]))[peak]
    tau = np.unique(np.r_[grid[1:-1], extrema[(extrema > FIRST) & (extrema < FIRST + 2 * np.pi)]])
    value = f(tau)
    turns = np.flatnonzero((value[:-1] > 0) != (value[1:] > 0))
    return np.array([zero(lambda t: f(np.array([t]))[0], tau[i], tau[i + 1]) for i in turns])


def closed_spans(f, m):
    """Where f > 0 in a period."""
    ends = _roots(f, m)
    closed = f(np.array([FIRST]))[0] > 0
    if not len(ends):
        return [(0.0, 2 * np.pi)] if closed else []
    if closed:
        ends = np.r_[ends[-1] - 2 * np.pi, ends[:-1]]
    return list(zip(ends[::2], ends[1::2]))
