"""How far a reported point is from the branch: the smallest change that solves the scene's equations.

The equations have one unknown more than rows (the amplitude of a mode, the frequency of a response). Their Newton step
of least norm is, to first order, the vector to the nearest solution; its parts in omega, zeta and the motion are the
point's errors, whatever the residual was scaled by. A point that is off is iterated to its solution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

DENSE = 700  #: unknowns up to which the step comes from singular values
ENOUGH = 12  #: Newton steps
HELD, BALANCED = 3, 1e-8  #: Newton steps at one amplitude, and what they may leave of the largest force


@dataclass
class Distance:
    """Errors of a point.

    Attributes
    ----------
    omega : relative
    zeta : absolute, of beta / |lambda|
    motion : of the coefficients of harmonics above 0, relative to their norm, the amplitude's change along
    balance : largest residual force over the sum of moduli of the forces that act there
    found : a solution was reached; else the errors are those of the first step
    """

    omega: float
    zeta: float
    motion: float
    balance: float
    found: bool
    solution: tuple = ()


def ratio(beta, omega, method):
    """zeta = beta / w0."""
    return beta / np.hypot(beta, omega) if method == "CNM" else beta / omega


def at_its_amplitude(eq, Q, beta, omega):
    """Errors of a mode's solution at its own amplitude: in corners, where a branch is steep in all else, the nearest
    solution lies at another one, and omega and zeta of the two are far apart. Steps go on until they are in the last
    digits that forces have; `found` says whether the forces balance there."""
    start, size = (Q, beta, omega), np.linalg.norm(_dynamic(eq, Q)) or 1.0
    now, balance = start, None
    for _ in range(HELD):
        R, acting, J = eq.linearise(now)
        balance = _balance(eq, R, acting) if balance is None else balance
        now = _take(now, least_step(eq, J, R, now, size, held=True), 1.0)
    return _errors(eq, start, now, size, balance, _norm(*eq.residual(*now)) < BALANCED)


def distance(eq, Q, beta, omega, enough=None):
    """Errors of coefficients Q (n_dof, m) with decay beta and frequency omega (EPMC: w0; forced: beta = 0).

    Parameters
    ----------
    enough : callable, optional
        Says whether the first step is small enough to need no iteration.
    """
    start = now = (Q, beta, omega)
    size = np.linalg.norm(_dynamic(eq, Q)) or 1.0
    R, acting, J = eq.linearise(now)
    balance, least, errors = _balance(eq, R, acting), _norm(R, acting), None
    for _ in range(ENOUGH):
        step = least_step(eq, J, R, now, size)
        if errors is None:
            errors = _errors(eq, start, _take(now, step, 1.0), size, balance, False)
            if enough is not None and enough(errors):
                errors.found = True
                return errors
        now, norm = _search(eq, now, step, _norm(R, acting))
        if norm is None:
            return errors
        small = step_size(step, now, size)
        if small < 1e-9 and (norm < 1e-9 or norm < 1e-3 * least or small < 1e-11):
            found = _errors(eq, start, now, size, balance, True)
            found.solution = now
            return found
        R, acting, J = eq.linearise(now)
    return errors


def _search(eq, now, step, before):
    """The largest of a few shares of the step that lowers the residual; None when none does."""
    for share in (1.0, 0.5, 0.25, 0.1, 0.02):
        trial = _take(now, step, share)
        norm = _norm(*eq.residual(*trial))
        if np.isfinite(norm) and (norm < before or norm < 1e-12):
            return trial, norm
    return now, None


def step_size(step, now, size):
    dQ, dbeta, domega = step
    return np.linalg.norm(dQ) / size + np.hypot(dbeta, domega) / abs(now[2])


def between(a, b, share):
    """The state at a share of the way from one to another; beyond it for more than 1."""
    return tuple(x + share * (y - x) for x, y in zip(a, b))


def _take(now, step, share):
    return tuple(x + share * dx for x, dx in zip(now, step))


def _dynamic(eq, Q):
    return Q[:, 1:] if eq.orders[0] == 0 else Q


def _norm(R, acting):
    """Residual force over the largest force, each order by itself."""
    force = abs(acting).max()
    return float(abs(R).max() / force) if force else 0.0


def _balance(eq, R, acting):
    worst = 0.0
    floor = 1e-9 * abs(acting).max()
    for place, n in enumerate(eq.orders):
        k = eq.column[n]
        moduli = np.hypot(R[:, k], R[:, k + 1]) if n else abs(R[:, k])
        worst = max(worst, float((moduli / np.maximum(acting[:, place], floor)).max()))
    return worst


def _errors(eq, start, end, size, balance, found):
    domega = abs(end[2] - start[2]) / abs(end[2]) if end[2] else np.inf
    dzeta = abs(ratio(end[1], end[2], eq.method) - ratio(start[1], start[2], eq.method))
    motion = np.linalg.norm(_dynamic(eq, end[0] - start[0])) / size
    return Distance(float(domega), float(dzeta), float(motion), balance, found)


def least_step(eq, J, R, now, size, held=False):
    """Least-norm solution of J d = -R in units of the motion's size and of omega. For a mode the normalised
    coefficient's sine stays zero; its cosine, the amplitude, is free unless held.

    Returns
    -------
    (dQ, dbeta, domega)
    """
    Q, _, omega = now
    n, forced = Q.size, eq.method == "forced"
    columns = np.r_[np.full(n, size), abs(omega), abs(omega)]
    J = J @ sp.diags(columns)
    J.data[~np.isfinite(J.data)] = 0.0  # at a kink it has no value; whether the step is good the residual tells
    if forced:
        J = sp.hstack([J[:, :n], J[:, n + 1 :]], format="csr")
    else:
        k = eq.dof * eq.m + eq.column[1]
        for fixed in (k + 1, k) if held else (k + 1,):
            J = sp.vstack([J, sp.csr_matrix(([size], ([0], [fixed])), shape=(1, n + 2))], format="csr")
    right = -np.r_[R.ravel(), np.zeros(J.shape[0] - n)]
    scale = 1.0 / np.maximum(abs(J).max(axis=1).toarray().ravel(), 1e-300)
    J, right = (sp.diags(scale) @ J).tocsr(), scale * right
    solve = _dense if J.shape[0] <= DENSE else spla.spsolve if held else _bordered
    d = solve(J, right)
    dQ = (d[:n] * size).reshape(Q.shape)
    tail = d[n:] * abs(omega)
    return (dQ, 0.0, tail[0]) if forced else (dQ, tail[0], tail[1])


def _dense(J, right):
    return np.linalg.lstsq(J.toarray(), right, rcond=1e-15)[0]


def _bordered(J, right):
    """One solution and the null vector by a bordered sparse system; the first less its part along the second."""
    rng = np.random.default_rng(0)
    row = sp.csr_matrix(rng.standard_normal((1, J.shape[1])))
    factor = spla.splu(sp.vstack([J, row], format="csc"))
    one = factor.solve(np.r_[right, 0.0])
    null = factor.solve(np.r_[np.zeros(J.shape[0]), 1.0])
    return one - null * (null @ one) / (null @ null)
