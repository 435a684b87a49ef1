"""Contact laws for the judge, written from their definitions (DESIGN, section 6) and differentiated by complex steps.

Every function takes one period of motion as (samples, components, lanes) arrays and is analytic in it except at
changes of state, which real parts decide: a motion u + 1e-30 i du gives the force's exact derivative along du in the
imaginary part. Nothing here is shared with the solver.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

CLOSED = 1e-13  #: of a motion's size: a slider that comes back this near to its start has closed its period
MOST_PERIODS = 400
TINY = 1e-300


def regularised_coulomb(v, p):
    """mu N tanh(v / eps); v (samples, 1, lanes)."""
    ratio = v / p["regularisation_velocity"]
    # Beyond 20 the tanh is 1 and its derivative 0 to 1e-17; complex exponentials would overflow there.
    inside = np.clip(ratio.real, -20.0, 20.0) + 1j * np.where(abs(ratio.real) < 20.0, ratio.imag, 0.0)
    return p["friction_limit"] * np.tanh(inside)


def jenkins(u, p, rest):
    """Elastic Coulomb slider: f = kt (u - w), |f| <= limit; read on the second period from the rest state."""
    kt, limit = p["tangential_stiffness"], p["friction_limit"]
    w, f = rest[0] + 0j * u[0, 0], np.empty_like(u)
    for _ in range(2):
        for t in range(len(u)):
            trial = kt * (u[t, 0] - w)
            slips = (abs(trial.real) > limit) | (limit == 0)
            f[t, 0] = np.where(slips, np.sign(trial.real) * limit, trial)
            w = np.where(slips, u[t, 0] - f[t, 0] / kt, w)
    return f


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
    nodes, weights = np.polynomial.legendre.leggauss(4 * len(coefficients) + 24)
    for begin, end in _closed_spans(lambda tau: load + stiffness * (waves(tau) @ first)[:, 0], len(coefficients)):
        tau, half = (begin + end) / 2 + (end - begin) / 2 * nodes, (end - begin) / 2
        wave = waves(tau)
        out += half * (wave * weights[:, None]).T @ (load + stiffness * (wave @ coefficients))
    return out


def _closed_spans(f, m):
    """Where f > 0 in a period: between its roots, looked for between the extrema of a fine grid's parabolas."""
    grid = 2 * np.pi * np.arange(64 * m + 1) / (64 * m)
    value = f(grid)
    low, here, high = value[:-2], value[1:-1], value[2:]
    peak = (here - low) * (high - here) < 0
    bent = np.where(peak, low - 2 * here + high, 1.0)
    extrema = grid[1:-1] + np.where(peak, (low - high) / (2 * bent), 0.0) * grid[1]
    tau = np.unique(np.r_[grid, extrema[peak]])
    value = f(tau)
    turns = np.flatnonzero((value[:-1] > 0) != (value[1:] > 0))
    if not len(turns):
        return [(0.0, 2 * np.pi)] if value[0] > 0 else []
    ends = [brentq(lambda t: f(np.array([t]))[0], tau[i], tau[i + 1], xtol=1e-300, rtol=1e-15) for i in turns]
    if value[0] > 0:
        ends = [ends[-1] - 2 * np.pi, *ends[:-1]]
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
        if np.all(abs(off.real).max(axis=0) <= CLOSED * size) and (not period or abs(off.imag).max() <= 1e-10 * pace):
            break
    left = ~slipped & np.any(w.real != rest, axis=0)
    for lane in np.flatnonzero(left):
        radius = p["friction_coefficient"][lane] / p["tangential_stiffness"][lane] * _positive(normal[:, lane])
        w[:, lane] = nearest_common(u[:, 1:, lane], radius, rest[:, lane])
    f = np.empty_like(u)
    _march(u, normal, w, p, f)
    return f


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
    """The point nearest to `rest` that lies in all discs: on one circle, or where two of them meet.

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
    return points[np.argmin(np.linalg.norm(points.real - rest, axis=1))]


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
