"""The judge's 3-D Coulomb contact over the period that its slider closes: of a motion's coefficients, with derivatives.

From landing to lift-off where the pair opens. Where it does not: the point nearest to rest from which nothing slips, if
all discs |u - w| <= R have one in common, else the only cycle. Conventions of `laws`, marching of `circle`.
"""

from __future__ import annotations

import numpy as np

from .circle import CLOSED, TURN, Slider, waves, zero
from .laws import FIRST, closed_spans, stop

ROUNDED = 1e-3  #: size of a motion that its rounding, in arms, is CLOSED of
MOST_PERIODS = 60  #: Newton steps until a slider closes its period
NO_SLIP = 1e-13  #: of a motion's size: a slider within all its discs but for this does not slip
TINY = 1e-300


def coulomb_3d(U, p, orders, rest=(0.0, 0.0)):
    """3-D Coulomb contact with elastic stiffness, lift-off and circular slip limit, on the period its slider closes.

    Parameters
    ----------
    U : (3, m, lanes), lanes with the same real part; U[0] > 0 closes
    p : parameters of the pair
    orders : of the waves
    rest : slider in the static state; of the periods that close without slip the one nearest to it counts

    Returns
    -------
    (3, m, lanes) integrals of N, T1, T2 and the waves over the period
    """
    if orders[0]:
        return coulomb_3d(np.pad(U, ((0, 0), (1, 0), (0, 0))), p, [0, *orders], rest)[:, 1:]
    kn, kt, mu = p["normal_stiffness"], p["tangential_stiffness"], p["friction_coefficient"]
    load = p["normal_load"] - kn * p["gap"]
    out = np.zeros_like(U)
    out[0] = stop(U[0], kn, load, lambda tau: waves(orders, tau))
    path = np.stack([U[1], U[2], mu * kn / kt * U[0]])
    path[2, 0] += mu / kt * load
    base = path[:, :, 0].real.copy()
    rest, base[:2, 0] = np.asarray(rest, float) - base[:2, 0], 0.0  # arms may be 1e-16 of where they are
    slider = Slider(orders, base, bool(np.any(U.imag)))
    spans = closed_spans(lambda tau: load + kn * (waves(orders, tau) @ U[0, :, 0].real), U.shape[1])
    if mu and len(spans) == 1 and spans[0][1] - spans[0][0] == TURN:
        integral, varied = _never_opens(slider, rest)
    else:
        for begin, end in spans if mu else []:
            slider.land(begin, end)
        integral, varied = slider.integral, slider.varied[:, :, 2:]
    out[1:] = kt * integral[:, :, None]
    if slider.vary:
        m = U.shape[1]
        out[1:] += 1j * kt * np.tensordot(varied.reshape(2, m, 3, m), path.imag, 2)
    return out


def _never_opens(slider, rest):
    """Integrals and derivatives of the period without slip that is nearest to rest; without one, of the only one."""
    place, varied = common_point(slider, rest)
    if place is None:
        return _cycle(slider, rest)
    m = slider.U.shape[1]
    norm = np.r_[TURN, np.full(m - 1, np.pi)]
    off, D = np.outer(place, np.eye(m)[0]), np.zeros((2, m, 3, m))
    if not slider.vary:
        return (slider.U[:2] - off) * norm, D
    for row in range(2):
        D[row, :, row] = np.diag(norm)
    D[:, 0] -= TURN * varied.reshape(2, 3, m)
    return (slider.U[:2] - off) * norm, D.reshape(2, m, 3 * m)


def _cycle(slider, rest):
    """The period that closes, by Newton on the arm at its begin, and how that arm goes with the coefficients."""
    trial, size = Slider(slider.orders, slider.U, False), abs(slider.U[2]).max() + ROUNDED * abs(slider.U).max()
    begin, end, d, last = FIRST, FIRST + TURN, slider.at(FIRST)[:2] - rest, np.inf
    for _ in range(MOST_PERIODS):
        after, A = trial.march(begin, d, np.eye(2), end)
        gain, I_A = after - d, np.eye(2) - A
        if np.hypot(*gain) <= CLOSED * size:
            break
        newton = np.hypot(*gain) < 0.9 * last and abs(np.linalg.det(I_A)) > 1e-12
        d, last = after + (A @ np.linalg.solve(I_A, gain) if newton else 0.0), np.hypot(*gain)
    slider.forget()
    start = np.zeros((2, slider.directions))
    start[:, :2] = np.eye(2)
    _, D = slider.march(begin, d, start, end)
    by = np.linalg.lstsq(np.eye(2) - D[:, :2], D[:, 2:], rcond=1e-13)[0]
    return slider.integral, slider.varied[:, :, 2:] + slider.varied[:, :, :2] @ by


def common_point(slider, rest):
    """The point nearest to rest with |u - w| <= R at all times, and its derivatives (2, 3 m); None if there is none."""
    m, size = slider.U.shape[1], abs(slider.U).max()
    grid = FIRST + TURN * np.arange(32 * slider.orders[-1] + 64) / (32 * slider.orders[-1] + 64)
    step = grid[1] - grid[0]

    def over(tau, w):
        x = slider.at(tau)
        return np.hypot(x[0] - w[0], x[1] - w[1]) - x[2]

    def order(tau, w):
        x = slider.at(tau)
        return farther(x[:2].T, w) - x[2]

    def rises(tau, w):
        x, v = slider.at(tau), slider.at(tau, slider.V)
        return (x[0] - w[0]) * v[0] + (x[1] - w[1]) * v[1] - v[2] * np.hypot(x[0] - w[0], x[1] - w[1])

    def peaks(w):
        """Times at which |u - w| - R has its maxima, the largest first."""
        value = order(grid, w)
        top = np.flatnonzero((value >= np.roll(value, 1)) & (value > np.roll(value, -1)))
        out = []
        for t in grid[top[np.argsort(-value[top])][:4]] if len(top) else grid[:1]:
            inside = rises(t - step, w) > 0 > rises(t + step, w)
            out.append(zero(lambda x: rises(x, w), t - step, t + step) if inside else t)
        return np.array(out)[np.argsort(-order(np.array(out), w))]

    def discs(times):
        x = slider.at(np.array(times))
        return x[:2].T, x[2]

    times = [peaks(rest)[0]]
    if over(times[0], rest) <= 0:
        return rest, np.zeros((2, 3 * m))
    w = nearest_common(*discs(times), rest)
    if over(peaks(w), w)[0] <= NO_SLIP * size:
        return w, _one(slider, times[0], rest)
    for _ in range(40):
        times += [t for t in peaks(w) if over(t, w) > NO_SLIP * size and min(abs(t - np.array(times))) > 1e-9]
        near = nearest_common(*discs(times), rest)
        if near is None:
            return None, None
        moved, w = np.hypot(*(near - w)), near
        if moved < 1e-6 * size:
            break
    for _ in range(20):
        pair = peaks(w)[:2]
        if len(pair) < 2:
            return None, None
        u, _ = discs(pair)
        n = (w - u) / np.linalg.norm(w - u, axis=1)[:, None]
        step_w = np.linalg.lstsq(n, -over(pair, w), rcond=1e-14)[0]
        w = w + step_w
        if np.hypot(*step_w) < 1e-15 * size:
            break
    if not (np.hypot(*step_w) < 1e-11 * size and np.hypot(*(w - near)) < 1e-4 * size):
        return None, None
    if over(peaks(w), w)[0] > 10 * NO_SLIP * size:
        return None, None
    varied = slider.variation(slider.wave(pair))[:, :, 2:]
    return w, np.linalg.lstsq(n, np.einsum("ij,ijk->ik", n, varied[:, :2]) + varied[:, 2], rcond=1e-14)[0]


def _one(slider, tau, rest):
    """Derivatives of the point of the disc at tau that is nearest to rest; tau is where |u - rest| - R is largest."""
    x, v, a = (slider.at(tau, C) for C in (slider.U, slider.V, slider.W))
    varied, late = (slider.variation(wave)[0, :, 2:] for wave in (slider.wave(tau), slider.slopes(tau)))
    away = rest - x[:2]
    far = np.hypot(*away)
    n = away / far
    across = np.eye(2) - np.outer(n, n)
    dn, nt = -across @ varied[:2] / far, -across @ v[:2] / far
    ds = -v[:2] @ dn - n @ late[:2] - late[2]
    st = -nt @ v[:2] - n @ a[:2] - a[2]
    wt = v[:2] + v[2] * n + x[2] * nt
    return varied[:2] + np.outer(n, varied[2]) + x[2] * dn - np.outer(wt, ds / st)


def nearest_common(centres, radii, rest):
    """The point nearest to `rest` that lies in all discs, None if none does: on one circle, or where two of them meet.

    Parameters
    ----------
    centres : (discs, 2), radii : (discs,), rest : (2,)
    """
    away = rest - centres
    one = centres + away * (radii / np.sqrt((away * away).sum(axis=1)))[:, None]
    candidates = [one]
    i, j = np.triu_indices(len(radii), 1)
    apart = centres[j] - centres[i]
    square = (apart * apart).sum(axis=1)
    along = (1 + (radii[i] ** 2 - radii[j] ** 2) / square) / 2
    across = radii[i] ** 2 / square - along**2
    meet = across >= 0
    i, apart, along, across = i[meet], apart[meet], along[meet, None], np.sqrt(across[meet])[:, None]
    turned = np.stack([-apart[:, 1], apart[:, 0]], axis=1)
    candidates += [centres[i] + along * apart + sign * across * turned for sign in (1, -1)]
    points = np.concatenate(candidates)
    distance = np.linalg.norm(points[:, None] - centres[None], axis=2) - radii
    size = abs(centres).max() + radii.max()
    points = points[np.all(distance <= 1e-12 * size, axis=1)]
    return None if not len(points) else points[np.argmin(farther(points, rest))]


def farther(x, w):
    """|x - w| - |w| for each of the points x (points, 2), with all digits where w is far away."""
    return ((x * x).sum(axis=1) - 2 * x @ w) / (np.linalg.norm(x - w, axis=1) + np.hypot(*w) + TINY)
