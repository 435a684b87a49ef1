"""Closed forms as judges of a run: each function makes one that returns what is wrong.

Tolerances are those of the sampling or of the harmonics left out, said where they are given.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Form = Callable[[Any], list[str]]


def near(name: str, found: Any, exact: Any, tolerance: float, where: Any = None) -> list[str]:
    """One line for the largest relative difference above the tolerance."""
    found, exact = np.atleast_1d(found), np.broadcast_to(exact, np.shape(np.atleast_1d(found)))
    if not len(found):
        return [f"{name}: no row to compare with the closed form"]
    off = abs(found - exact) / np.maximum(abs(exact).max(), 1e-300)
    worst = int(np.argmax(off))
    if off[worst] <= tolerance:
        return []
    at = "" if where is None else f" at {np.atleast_1d(where)[worst]:.6g}"
    return [f"{name} {found[worst]:.8g}, closed form {exact[worst]:.8g}{at} (bar {tolerance:.0e})"]


def jenkins_stiffness(kt: float, limit: float, a: Any) -> Any:
    """Complex stiffness of a Jenkins element in one harmonic of amplitude a."""
    a = np.asarray(a, float)
    x = np.minimum(1.0, limit / (kt * a))
    th = np.arccos(1 - 2 * x)
    return kt / np.pi * (th - np.sin(2 * th) / 2) + 4j * limit / (np.pi * a) * (1 - x)


def hysteresis(m: float, k: float, stiffness: Callable[[Any], Any], tolerance: float = 2e-3) -> Form:
    """Single dof, one harmonic, complex stiffness of the contact: CNM lambda = i sqrt(k*/m), EPMC by its parts."""

    def form(run: Any) -> list[str]:
        a = run.columns["amplitude"]
        total = k + stiffness(a)
        if run.method == "CNM":
            eigen = 1j * np.sqrt(total / m)
            w0, zeta = abs(eigen), -eigen.real / abs(eigen)
        else:
            w0, zeta = np.sqrt(total.real / m), total.imag / (2 * total.real)
        c = run.columns
        return near("omega0", c["omega0"], w0, tolerance, a) + near("zeta", c["zeta"], zeta, tolerance, a)

    return form


def coulomb_slider(m: float, k: float, limit: float, tolerance: float = 2e-3, above: float = 0.0) -> Form:
    """Single dof with Coulomb friction, one harmonic, EPMC: w0 = sqrt(k/m), zeta = 2 R/(pi k a)."""

    def form(run: Any) -> list[str]:
        c = run.columns
        use = c["amplitude"] > above
        zeta = 2 * limit / (np.pi * k * c["amplitude"][use])
        return near("omega0", c["omega0"][use], np.sqrt(k / m), tolerance) + near(
            "zeta", c["zeta"][use], zeta, tolerance
        )

    return form


def limits(first: float | None = None, last: float | None = None, tolerance: float = 1e-6) -> Form:
    """Linear limits: frequency (modulus of lambda) of the first and of the last row."""

    def form(run: Any) -> list[str]:
        out = []
        for name, row, exact in (("first omega0", 0, first), ("last omega0", -1, last)):
            if exact is not None:
                out += near(name, run.columns["omega0"][row], exact, tolerance)
        return out

    return form


def damping(row: int, exact: float, tolerance: float) -> Form:
    """The damping ratio of a row."""
    return lambda run: near("zeta", run.columns["zeta"][row], exact, tolerance)


def unilateral(w1: float, w2: float, tolerance: float) -> Form:
    """Unilateral spring without gap: w = 2 w1 w2/(w1 + w2) at any amplitude."""
    return lambda run: near("omega0", run.columns["omega0"], 2 * w1 * w2 / (w1 + w2), tolerance)


def den_hartog(P: float, F: float, k: float, m: float, tolerance: float, above: float) -> Form:
    """Largest displacement of x'' + x + F sgn x' = P cos wt without stops (Den Hartog 1931), above a frequency.

    Held against the largest displacement of the harmonics that are there.
    """

    def form(run: Any) -> list[str]:
        eq, tau = run.equations, np.linspace(0, 2 * np.pi, 721)
        waves = np.array([f(n * tau) for n in eq.orders for f in ((np.cos, np.sin) if n else (np.cos,))])
        w = run.columns["omega"] / np.sqrt(k / m)
        use = w > above
        V, U = 1 / (1 - w[use] ** 2), np.sin(np.pi / w[use]) / (w[use] * (1 + np.cos(np.pi / w[use])))
        exact = np.sqrt((P / k * V) ** 2 - (F / k * U) ** 2)
        return near("largest displacement", abs(run.Q[use, 0] @ waves).max(axis=1), exact, tolerance, w[use])

    return form


def at_amplitude(a: float, exact: float, tolerance: float) -> Form:
    """Frequency (modulus of lambda) of the row nearest to an amplitude."""
    return lambda run: near("omega0", run.at(a, "omega0"), exact, tolerance, a)


def closed_modes(scene: Any, sliding: bool = False) -> Any:
    """Angular frequencies of the structure with stuck contact, or closed and sliding without friction, by LAPACK."""
    return linear_modes(scene, sliding)[0]


def linear_modes(scene: Any, sliding: bool = False) -> tuple[Any, Any]:
    """The same with their shapes, column by column.

    From K^-1: its largest eigenvalues do not feel the rounding of contact 1e14 times as stiff as the rest.
    """
    import scipy.linalg

    M, K = (np.asarray(A.toarray() if hasattr(A, "toarray") else A, float) for A in (scene.M, scene.K))
    for contact in scene.contacts:
        B = np.asarray(contact.B.toarray() if hasattr(contact.B, "toarray") else contact.B, float)
        k = np.array(contact.stuck(), float)
        if sliding:
            k[np.arange(len(k)) % contact.components > 0] = 0.0
        K = K + (B.T * k) @ B
    flexibility = scipy.linalg.cho_solve(scipy.linalg.cho_factor(K), np.eye(len(K)))
    values, shapes = scipy.linalg.eigh(M @ flexibility @ M, M)
    return 1 / np.sqrt(values[::-1]), shapes[:, ::-1]
