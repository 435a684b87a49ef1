"""Damping by mode: C = M Phi diag(2 zeta_r omega_r) Phi^T M, of a structure and of all waves of a wheel.

Phi are undamped modes of unit modal mass with every contact in one linear limit (`fretwave.model.contact.LIMITS`).
Modes without a ratio, and rigid motions, are not damped. Of a sector the r-th mode of every wave has the r-th ratio:

    C_k = 1/N sum_d C(theta_d) e^{i k theta_d},    theta_d = 2 pi d / N,

is the term on the sector k places ahead, of waves of any nodal diameter, of all their harmonics and of the whole wheel.
All modes with one ratio give C = 2 zeta M (M^-1 K)^1/2. These matrices are full, whatever M and K are: of a model of
many dofs they are made once it is reduced. SciPy alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Union

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..arrays import Array, Complex
from ..errors import InputError
from ..given import array_of, not_negative, whole
from ..texts import counted
from .contact import Contact, contact_list
from .sectors import Term, by_sector, check_number, check_square, real_csr

#: A damping ratio of all modes, of the lowest, or by the number of the mode (1 is the lowest).
Ratios = Union[float, Sequence[float], Mapping[int, float]]
#: Entries of its matrices: those of a structure of 4472 dofs, of one of 36 sectors of 745; 8 bytes each.
LARGEST = 20_000_000
#: Shift of the eigenproblem over the lowest ratio of diagonal stiffness to mass, so that rigid motions are no poles;
#: squared frequencies below RIGID times the shift are rounding of theirs.
SHIFT, RIGID = 1e-4, 1e-8
#: Of the largest 1 / (omega^2 + shift): what is smaller belongs to no mass.
MASSLESS = 1e-13
#: Modes nearer than this, relative, have no shapes of their own.
SAME = 1e-7
#: Terms of sectors far off below this share of the own sector's are rounding.
NOTHING = 1e-13


def modal_damping(
    M: Term, K: Term, ratios: Ratios, contacts: Sequence[Contact] = (), sectors: int = 0
) -> dict[int, sp.csr_matrix]:
    """{k: C_k (n_dof, n_dof)} [force s/length], on the sector k places ahead; {0: C} of a structure.

    Parameters
    ----------
    M, K : (n_dof, n_dof), or by sector
        [mass], [force/length], symmetric.
    ratios : float, sequence or {number of the mode: ratio}
        Modal damping ratios zeta_r: of all modes, of the lowest ones in turn, or of those named.
    contacts : sequence of Contact
        Closed and stuck in the modes (`fretwave.model.contact.in_limit` gives those of another limit).
    sectors : int
        Of the wheel of which M and K are one; 0 for a structure.

    Raises
    ------
    InputError
        More dofs than full matrices are made of, a mode that is not there, two ratios of modes of one frequency, a
        ratio that is negative or no number.
    """
    sectors = check_number(sectors) if whole(sectors) != 0 else 0
    n = check_square({"M": by_sector(M) or [], "K": by_sector(K) or []})
    check_size(n, sectors)
    contacts = contact_list(contacts)
    waves = range(sectors // 2 + 1) if sectors else range(1)
    found = [_of_wave(M, K, ratios, contacts, 2 * np.pi * d / (sectors or 1), d) for d in waves]
    return {0: sp.csr_matrix(found[0].real)} if not sectors else _terms(found, sectors)


def check_size(n: int, sectors: int = 0) -> None:
    """Refuse a model of so many dofs that its full matrices are not to be made."""
    most = math.isqrt(LARGEST // (sectors or 1))
    if n > most:
        fix = "add [reduction] or keep less, or damp with stiffness_damping and mass_damping"
        raise InputError("damping by mode makes full matrices", None, f"{n} dofs", f"at most {most}", fix)


def _of_wave(M: Term, K: Term, ratios: Ratios, contacts: Sequence[Contact], theta: float, diameters: int) -> Complex:
    """C(theta) (n, n), Hermitian."""
    mass, stiffness = _dense(M, theta), _dense(K, theta)
    free = _free_of(contacts, theta, len(mass))
    for contact in contacts:
        B, k = _dense(contact.B, theta), contact.stuck_stiffness().ravel()
        stiffness = stiffness + B.conj().T @ (np.where(np.isfinite(k), k, 0.0)[:, None] * B)
    omega, shapes = _modes(mass, stiffness, free)
    zeta = _of_modes(ratios, omega, f"nodal diameter {diameters}" if theta or diameters else None)
    W = (mass @ shapes) * np.sqrt(2 * zeta * omega)
    return np.asarray(W @ W.conj().T)


def _dense(given: Term, theta: float) -> Complex:
    """sum_k e^{-i k theta} A_k, real where it is."""
    total = sum(np.exp(-1j * k * theta) * real_csr(A).toarray() for k, A in by_sector(given).items())
    standing = np.isclose(np.sin(theta), 0.0, atol=1e-12)
    return np.asarray(np.real(total) if standing else total)


def _free_of(contacts: Sequence[Contact], theta: float, n: int) -> Complex | None:
    """Basis (n, n_free) of the motions that contact without any give leaves; None for all."""
    rows = [_dense(contact.B, theta)[np.isinf(contact.stuck_stiffness().ravel())] for contact in contacts]
    rigid = np.vstack(rows) if rows else np.zeros((0, n))
    return np.asarray(scipy.linalg.null_space(rigid)) if len(rigid) else None


def _modes(M: Complex, K: Complex, free: Complex | None) -> tuple[Array, Complex]:
    """Frequencies [rad/s], ascending, and shapes (n, n_modes) of unit modal mass.

    M phi = mu (K + s M) phi, mu = 1 / (omega^2 + s): the lowest modes are the most accurate, and M may be singular.
    """
    if free is not None:
        M, K = (free.conj().T @ A @ free for A in (M, K))
    if not len(M):
        return np.zeros(0), np.zeros((0 if free is None else len(free), 0), dtype=complex)
    shift = _shift(np.real(np.diagonal(M)), np.real(np.diagonal(K)))
    try:
        mu, shapes = scipy.linalg.eigh(M, K + shift * M)
    except np.linalg.LinAlgError:
        fix = "correct the model, or damp with stiffness_damping and mass_damping"
        what = "the modes that are to be damped cannot be found"
        raise InputError(what, None, "K + s M is not positive definite", "M and K of a structure", fix) from None
    mu, shapes = mu[::-1], shapes[:, ::-1]
    heavy = mu > MASSLESS * mu.max(initial=0.0)
    mu, shapes = mu[heavy], shapes[:, heavy] / np.sqrt(mu[heavy])
    square = 1 / mu - shift
    omega = np.sqrt(np.where(square > RIGID * shift, square, 0.0))
    return omega, np.asarray(shapes if free is None else free @ shapes)


def _shift(mass: Array, stiffness: Array) -> float:
    """Of the order of the lowest squared frequency or above, whatever the units of the dofs."""
    both = (mass > 0) & (stiffness > 0)
    return SHIFT * float((stiffness[both] / mass[both]).min()) if both.any() else 1.0


def _of_modes(ratios: Ratios, omega: Array, where: str | None) -> Array:
    """Damping ratio of every mode."""
    if isinstance(ratios, Mapping):
        given = dict(ratios)
    elif array_of(ratios).ndim:
        given = dict(enumerate(array_of(ratios).tolist(), 1))
    else:
        return np.full(len(omega), not_negative("damping ratio", ratios))
    zeta = np.zeros(len(omega))
    for number, ratio in given.items():
        known = whole(number)
        if known is None or not 1 <= known <= len(omega):
            fix = "leave it out, or keep more component modes"
            what = "a damping ratio is of a mode that is not there"
            raise InputError(what, where, f"mode {number!r}", f"1 to {counted(len(omega), 'mode')}", fix)
        zeta[known - 1] = not_negative(f"damping ratio of mode {number}", ratio)
    _check_apart(zeta, omega, where)
    return zeta


def _check_apart(zeta: Array, omega: Array, where: str | None) -> None:
    """Shapes of modes of one frequency may be mixed at will: only one ratio means the same for all mixtures."""
    for r in np.flatnonzero((np.diff(omega) <= SAME * omega[1:]) & (np.diff(zeta) != 0) & (omega[1:] > 0)):
        hz = omega[r] / (2 * np.pi)
        raise InputError(
            "modes of one frequency have two damping ratios",
            where,
            f"modes {r + 1} and {r + 2} at {hz:.6g} Hz, zeta {zeta[r]:g} and {zeta[r + 1]:g}",
            "one ratio, for their shapes may be mixed at will",
            f"give mode {r + 2} the ratio of mode {r + 1}",
        )


def _terms(waves: Sequence[Complex], sectors: int) -> dict[int, sp.csr_matrix]:
    """Terms of the sector from C of the waves of 0 to N/2 nodal diameters; those backward are their conjugates."""
    weights = [1 if d == 0 or 2 * d == sectors else 2 for d in range(len(waves))]
    out: dict[int, Array] = {}
    for k in range(-((sectors - 1) // 2), sectors // 2 + 1):
        turns = np.exp(2j * np.pi * k * np.arange(len(waves)) / sectors)
        out[k] = np.real(sum(w * turn * C for w, turn, C in zip(weights, turns, waves))) / sectors
    largest = abs(out[0]).max(initial=0.0)
    return {k: sp.csr_matrix(C) for k, C in out.items() if k == 0 or abs(C).max() > NOTHING * largest}
