"""Contact laws for the judge, written from their definitions (DESIGN, section 6) and differentiated by complex steps.

Every function takes one period of motion as (samples, components, lanes) arrays and is analytic in it except at
changes of state, which real parts decide: a motion u + 1e-30 i du gives the force's exact derivative along du in the
imaginary part. Nothing here is shared with the solver.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.optimize import brentq

CLOSED = 1e-13  #: of a motion's size: a slider that comes back this near to its start has closed its period
MOST_PERIODS = 400
PATIENCE = 8  #: periods after which a slider that still creeps is looked for where it would come to
TINY = 1e-300
FIRST = 0.0123  #: time at which a period is begun, where motions that are measured from their phase have no root


def regularised_coulomb(v, p):
    """mu N tanh(v / eps); v (samples, 1, lanes)."""
    ratio = v / p["regularisation_velocity"]
    # Beyond 20 the tanh is 1 and its derivative 0 to 1e-17; complex exponentials would overflow there.
    inside = np.clip(ratio.real, -20.0, 20.0) + 1j * np.where(abs(ratio.real) < 20.0, ratio.imag, 0.0)
    return p["friction_limit"] * np.tanh(inside)


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
                onset = begin if late else brentq(lambda t, g=goal: first(t) - g, begin, end, xtol=1e-300, rtol=1e-15)
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
    for begin, end in _closed_spans(lambda tau: load + stiffness * (waves(tau) @ first)[:, 0], len(coefficients)):
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
    return np.array([brentq(lambda t: f(np.array([t]))[0], tau[i], tau[i + 1], xtol=1e-300, rtol=1e-15) for i in turns])


def _closed_spans(f, m):
    """Where f > 0 in a period."""
    ends = _roots(f, m)
    closed = f(np.array([FIRST]))[0] > 0
    if not len(ends):
        return [(0.0, 2 * np.pi)] if closed else []
    if closed:
        ends = np.r_[ends[-1] - 2 * np.pi, ends[:-1]]
    return list(zip(ends[::2], ends[1::2]))


def coulomb_3d(u, p, rest):
    """3-D Coulomb contact with elastic stiffness, lift-off and circular slip limit, on the period its sliders close.

    Parameters
    ----------
    u : (samples, 3, lanes), u[:, 0] > 0 closes
    p : parameters, (lanes,) each
    rest : (2, lanes) sliders in the static state; of the periods that close without slip the one nearest to it counts
    """
    normal = p["normal_load"] + p["normal_stiffness"] * (u[:, 0] - p["gap"])  # below zero where it is open
    size = abs(u[:, 1:].real).max(axis=(0, 1)) + abs(rest).max(axis=0) + TINY
    pace = abs(u.imag).max() + TINY
    w = rest + 0j * u[0, 1:]
    for period in range(MOST_PERIODS):
        start, (w, slipped) = w, _march(u, normal, w, p)
        off = w - start
        creeps = abs(off.real).max(axis=0) > CLOSED * size
        if not np.any(creeps) and (not period or abs(off.imag).max() <= 1e-10 * pace):
            break
        if period == PATIENCE:  # towards a place that it reaches only in the limit: there is none nearer to rest
            _shake_down(u, normal, w, p, rest, np.flatnonzero(creeps))
    _shake_down(u, normal, w, p, rest, np.flatnonzero(~slipped & np.any(w.real != rest, axis=0)))
    f = np.empty_like(u)
    _march(u, normal, w, p, f)
    return f


def _shake_down(u, normal, w, p, rest, lanes):
    """Sliders of these lanes to the place nearest to rest where nothing slips, if there is one."""
    for lane in lanes:
        radius = p["friction_coefficient"][lane] / p["tangential_stiffness"][lane] * _positive(normal[:, lane])
        if np.all(radius.real > 0):
            place = nearest_common(u[:, 1:, lane], radius, rest[:, lane])
            w[:, lane] = w[:, lane] if place is None else place


def _positive(x):
    return np.where(x.real > 0, x, 0.0)


def _length(d):
    square = d[0] * d[0] + d[1] * d[1]
    return np.sqrt(np.where(square.real > 0, square, TINY))


def _march(u, normal, w, p, f=None):
    """One period of sliders w (2, lanes), which the last sample's disc pulls in first: their end, and which of them
    slipped by more than rounding. Between samples u and the normal force go straight, from where it closes; only the
    direction in which the slider is pulled turns with the path."""
    kt = p["tangential_stiffness"]
    reach = p["friction_coefficient"] / kt
    slipped = np.zeros(u.shape[2], dtype=bool)
    radius, d = reach * _positive(normal[-1]), u[-1, 1:] - w
    w = np.where(_length(d).real > radius.real, u[-1, 1:] - d * (radius / _length(d)), w)
    for t in range(len(u)):
        was, now, R0, R1 = normal[t - 1], normal[t], radius, reach * _positive(normal[t])
        radius, opened, lands = R1, now.real <= 0, (was.real <= 0) & (now.real > 0)
        share = np.where(lands, now / np.where(lands, now - was, 1.0), 1.0)
        v, d = share * (u[t, 1:] - u[t - 1, 1:]), np.where(lands, 0.0, u[t - 1, 1:] - w)
        gain = u[(t + 1) % len(u), 1:] - 2 * u[t, 1:] + u[t - 1, 1:]
        sticks = (_length(d + v).real <= R1.real) & (R1.real > 0)
        with np.errstate(all="ignore"):  # lanes that do not slip
            pulled = _pulled(d, v, gain, R0, R1, lands)
        kept = np.where(opened, 0.0, np.where(sticks, d + v, np.where(R1.real > 0, pulled, 0.0)))
        w = np.where(sticks & ~lands, w, u[t, 1:] - kept)
        slipped |= (R1.real == 0) | ~sticks & (_length(d + v).real > R1.real * (1 + 1e-12))
        if f is not None:
            f[t, 0], f[t, 1:] = _positive(now), kt * kept
    return w, slipped


def _pulled(d, v, gain, R0, R1, lands):
    """The arm d = u - w at the end of a step in which it slips: u goes by v, the radius of its disc from R0 to R1.
    The next v is larger by `gain`.

    It sticks until |d + s v| = R0 + s (R1 - R0); from there tan(phi / 2) falls by exp(-x), phi the angle from v to
    the arm, x the way over the mean radius, and sinh x is summed to its third term. v is turned before towards the
    path's direction at the step's end, all the way where x is large.
    """
    rise, way = R1 - R0, _length(v)
    a, b, c = way * way - rise * rise, d[0] * v[0] + d[1] * v[1] - R0 * rise, d[0] * d[0] + d[1] * d[1] - R0 * R0
    square = b * b - a * c
    root = np.sqrt(np.where(square.real > 0, square, 0.0))
    early = b.real > 0
    s = np.where(early, -c, root - b) / np.where(early, b + root, np.where(a.real > 0, a, 1.0))
    s = np.where(lands | (s.real > 1), 1.0, np.where(s.real > 0, s, 0.0))
    at = d + s * v
    r = _length(at)
    most = 1e-12 * abs(way) + TINY  # of an arm that is none, x is large enough
    per = 2 * (1 - s) / np.where((R1 + r).real > most, R1 + r, most)
    tilt = per * (v[0] * gain[1] - v[1] * gain[0]) / (2 * way * (3 + np.sqrt(9 + (per * way) ** 2)))
    v = v + tilt * np.stack([-v[1], v[0]])
    way = _length(v)
    x = per * way
    sinh = x + x**3 / 6 + x**5 / 120
    e, n = v / way, at / r
    half = (e[0] * n[1] - e[1] * n[0]) / (1 + e[0] * n[0] + e[1] * n[1]) / (sinh + np.sqrt(1 + sinh * sinh))
    turned = (1 - half * half) * e + 2 * half * np.stack([-e[1], e[0]])
    return R1 * np.where(way.real > TINY**0.5, turned / (1 + half * half), n)


def nearest_common(centres, radii, rest):
    """The point nearest to `rest` that lies in all discs, None if none does: on one circle, or where two of them meet.

    Parameters
    ----------
    centres : (discs, 2), radii : (discs,), rest : (2,); complex parts of centres and radii are carried along
    """
    keep = _tightest(centres.real, radii.real)
    centres, radii = centres[keep], radii[keep]
    away = rest - centres
    one = centres + away * (radii / np.sqrt((away * away).sum(axis=1)))[:, None]
    candidates = [one]
    i, j = np.triu_indices(len(radii), 1)
    apart = centres[j] - centres[i]
    square = (apart * apart).sum(axis=1)
    along = (1 + (radii[i] ** 2 - radii[j] ** 2) / square) / 2
    across = radii[i] ** 2 / square - along**2
    meet = across.real >= 0
    i, apart, along, across = i[meet], apart[meet], along[meet, None], np.sqrt(across[meet])[:, None]
    turned = np.stack([-apart[:, 1], apart[:, 0]], axis=1)
    candidates += [centres[i] + along * apart + sign * across * turned for sign in (1, -1)]
    points = np.concatenate(candidates)
    distance = np.linalg.norm(points.real[:, None] - centres.real[None], axis=2) - radii.real
    size = abs(centres.real).max() + radii.real.max()
    points = points[np.all(distance <= 1e-12 * size, axis=1)]
    return None if not len(points) else points[np.argmin(np.linalg.norm(points.real - rest, axis=1))]


def _tightest(centres, radii, most=40):
    """Of many discs those nearest to excluding something: the others are redundant for a smooth motion."""
    if len(radii) <= most:
        return np.arange(len(radii))
    middle = centres[np.argmin(radii)]
    for _ in range(200):  # a point of the intersection, by projection onto the disc it is farthest outside of
        distance = np.linalg.norm(middle - centres, axis=1) - radii
        worst = int(np.argmax(distance))
        if distance[worst] <= 0:
            break
        middle = centres[worst] + (middle - centres[worst]) * radii[worst] / (distance[worst] + radii[worst])
    return np.sort(np.argsort(np.linalg.norm(middle - centres, axis=1) - radii)[-most:])
