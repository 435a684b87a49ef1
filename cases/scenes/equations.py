"""The equations of a scene in NumPy: residual, exact Jacobian and distance from the branch.

    (K + s_n C + s_n^2 M) q_n + B^T F_n = P_n,    q_n = Qc_n - i Qs_n

CNM: s_n = n lambda; EPMC: s_n = i n w0 with C - 2 beta M in place of C; forced response: s_n = i n w. F by sampling
one period without the factor of the decay. Coefficients Q (n_dof, m) have the columns [0], 1c, 1s, 2c, ... of labels.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp

from . import laws, pads

STEP = 1e-30  #: of complex differentiation


@dataclass
class Contact:
    """Pairs that share a law.

    Attributes
    ----------
    B : (pairs * components, n_dof) dense or sparse, pair by pair
    parameters : numbers or (pairs,)
    """

    name: str
    law: str
    B: Any
    parameters: dict[str, Any]

    @property
    def components(self) -> int:
        return 3 if self.law.startswith("coulomb_3d") else 1

    @property
    def pairs(self) -> int:
        return self.B.shape[0] // self.components

    def full(self) -> dict[str, np.ndarray]:
        """Parameters of every pair; loads and gaps are zero unless given."""
        standard = {"normal_load": 0.0, "gap": 0.0} if self.components == 3 else {}
        return {
            k: np.broadcast_to(np.asarray(v, float), self.pairs) for k, v in {**standard, **self.parameters}.items()
        }

    def stuck(self) -> np.ndarray:
        """Stiffness of each row of B when nothing slips and what touches at rest stays closed."""
        p = self.full()
        if self.law == "jenkins":
            return p["tangential_stiffness"]
        if self.law == "regularised_coulomb":
            return np.zeros(self.pairs)
        closed = p["normal_load"] - p["normal_stiffness"] * p["gap"] > 0
        rows = [p["normal_stiffness"], p["tangential_stiffness"], p["tangential_stiffness"]]
        return np.ravel(np.where(closed, rows, 0.0), order="F")


@dataclass
class Equations:
    """A structure with contacts, and how its motion is discretised.

    Attributes
    ----------
    orders : retained harmonics
    method : "CNM", "EPMC" or "forced"
    dof : normalised
    force : (n_dof,) amplitude of cos(w t)
    balanced : the static contact force f(0) is carried by a load of its own
    """

    M: Any
    K: Any
    C: Any
    contacts: list[Contact]
    orders: list[int]
    method: str
    dof: int = 0
    force: Any = None
    balanced: bool = True
    maps: list[Any] = field(init=False)

    def __post_init__(self) -> None:
        self.M, self.K, self.C = (sp.csr_matrix(A) for A in (self.M, self.K, 0 * self.M if self.C is None else self.C))
        self.maps = [sp.csr_matrix(contact.B) for contact in self.contacts]
        self.m = sum(2 if n else 1 for n in self.orders)
        self.column = {n: sum(2 if k else 1 for k in self.orders if k < n) for n in self.orders}

    # Pieces

    def waves(self, tau):
        """1, cos n tau, sin n tau at these times (times, m)."""
        rows = [[np.cos(n * tau), np.sin(n * tau)] if n else [np.ones_like(tau)] for n in self.orders]
        return np.array(sum(rows, [])).T

    def weight(self):
        """Of the means of a function times the waves, its coefficients (m,)."""
        return np.array(sum([[2, 2] if n else [1] for n in self.orders], []))

    def complex_of(self, Q, n):
        """q_n of coefficients (rows, m[, lanes])."""
        k = self.column[n]
        return Q[:, k] - 1j * Q[:, k + 1] if n else Q[:, k].astype(complex)

    def exponent(self, n, beta, omega):
        return n * (-beta + 1j * omega) if self.method == "CNM" else 1j * n * omega

    def damping(self, beta):
        return self.C - 2 * beta * self.M if self.method == "EPMC" else self.C

    def velocity(self, U, beta, omega):
        """Coefficients of the velocity; linear in U and, for complex steps, analytic in beta and omega."""
        V = np.zeros(np.broadcast_shapes(U.shape, np.shape(beta)), dtype=np.result_type(U, beta, omega))
        for n in self.orders:
            if not n:
                continue
            k = self.column[n]
            decay, turn = (-n * beta if self.method == "CNM" else 0.0), n * omega
            V[:, k] = decay * U[:, k] + turn * U[:, k + 1]
            V[:, k + 1] = decay * U[:, k + 1] - turn * U[:, k]
        return V

    def law(self, contact, U, beta, omega):
        """Force coefficients (rows, m, lanes) for relative coefficients U (rows, m, lanes); rows pair by pair.

        Lanes are one motion with different complex steps: they share the times at which its states change.
        """
        F, p, c = np.zeros_like(U), contact.full(), contact.components
        moved = self.velocity(U, beta, omega) if contact.law == "regularised_coulomb" else U
        for pair in range(contact.pairs):
            rows = slice(c * pair, c * (pair + 1))
            integral = self.integral(contact.law, moved[rows], {k: float(v[pair]) for k, v in p.items()})
            F[rows] = self.weight()[:, None] / (2 * np.pi) * integral
        return F

    def integral(self, law, u, p):
        """Of the force of one pair and the waves over a period, (components, m, lanes)."""
        if law == "coulomb_3d":
            return pads.coulomb_3d(u, p, self.orders)
        if law == "regularised_coulomb":
            return laws.regularised_coulomb(u[0], p["friction_limit"], p["regularisation_velocity"], self.waves)[None]
        rates = self.velocity(u, 0.0, 1.0)
        return laws.jenkins(u[0], rates[0], p["tangential_stiffness"], p["friction_limit"], self.waves)[None]

    def static_load(self):
        """B^T f(0): what balances the pairs' own normal loads."""
        load = np.zeros(self.M.shape[0])
        for contact, B in zip(self.contacts, self.maps):
            if contact.components == 3 and self.balanced:
                p = contact.full()
                f = np.zeros((contact.pairs, 3))
                f[:, 0] = np.maximum(0.0, p["normal_load"] - p["normal_stiffness"] * p["gap"])
                load += B.T @ f.ravel()
        return load

    # Residual and Jacobian

    def residual(self, Q, beta, omega):
        """R (n_dof, m), and the sum of moduli of all forces that act there, by dof and order (n_dof, orders)."""
        force = np.zeros_like(Q)
        for contact, B in zip(self.contacts, self.maps):
            force += B.T @ self.law(contact, (B @ Q)[..., None].astype(complex), beta, omega)[..., 0].real
        return self.balance(Q, beta, omega, force)

    def balance(self, Q, beta, omega, contact_force):
        """The same with the contact's force (n_dof, m) given."""
        R, acting = np.zeros_like(Q), np.zeros((len(Q), len(self.orders)))
        for place, n in enumerate(self.orders):
            q, s = self.complex_of(Q, n), self.exponent(n, beta, omega)
            parts = [self.K @ q, s * (self.damping(beta) @ q), s * s * (self.M @ q), self.complex_of(contact_force, n)]
            if n == 1 and self.force is not None:
                parts.append(-np.asarray(self.force, complex))
            if n == 0:
                parts.append(-self.static_load().astype(complex))
            total, k = sum(parts), self.column[n]
            R[:, k] = total.real
            if n:
                R[:, k + 1] = -total.imag
            acting[:, place] = sum(abs(part) for part in parts)
        return R, acting

    def linearise(self, state):
        """(R, acting, J) of a state (Q, beta, omega), J = dR / d(Q, beta, omega) sparse (n_dof m, n_dof m + 2).

        The contact's part comes from a lane of complex steps for each unknown of a pair.
        """
        J, force = self._linear(*state), np.zeros_like(state[0])
        for contact, B in zip(self.contacts, self.maps):
            big = sp.kron(B, sp.identity(self.m), format="csr")
            F, D, tail = self._contact(contact, B, *state)
            force += B.T @ F
            J = J + sp.hstack([big.T @ D @ big, sp.csr_matrix(big.T @ tail)], format="csr")
        return *self.balance(*state, force), J

    def _linear(self, Q, beta, omega):
        """The part of M, C and K."""
        blocks, tail = [], np.zeros((*Q.shape, 2))
        for n in self.orders:
            s, q, C = self.exponent(n, beta, omega), self.complex_of(Q, n), self.damping(beta)
            Z, k = (self.K + s * C + s * s * self.M), self.column[n]
            by_s = C @ q + 2 * s * (self.M @ q)
            by_beta = -n * by_s if self.method == "CNM" else -2 * s * (self.M @ q) * (self.method == "EPMC")
            for j, d in enumerate((by_beta, 1j * n * by_s)):
                tail[:, k, j] = d.real
                if n:
                    tail[:, k + 1, j] = -d.imag
            real, imag = sp.coo_matrix(Z.real), sp.coo_matrix(Z.imag)
            blocks.append((real, k, k))
            if n:
                blocks += [(real, k + 1, k + 1), (imag, k, k + 1), (-imag, k + 1, k)]
        m, size = self.m, Q.size
        rows = np.concatenate([b.row * m + r for b, r, _ in blocks])
        cols = np.concatenate([b.col * m + c for b, _, c in blocks])
        J = sp.csr_matrix((np.concatenate([b.data for b, _, _ in blocks]), (rows, cols)), shape=(size, size))
        return sp.hstack([J, sp.csr_matrix(tail.reshape(size, 2))], format="csr")

    def _contact(self, contact, B, Q, beta, omega):
        """F, dF/dU (block diagonal by pairs) and dF/d(beta, omega)."""
        c, m, pairs = contact.components, self.m, contact.pairs
        lanes = c * m + 2
        lifted = np.repeat((B @ Q)[..., None].astype(complex), lanes, axis=2)
        for component in range(c):
            for k in range(m):
                lifted[component::c, k, component * m + k] += 1j * STEP
        beta, omega = (np.full(lanes, x, complex) for x in (beta, omega))
        beta[-2] += 1j * STEP
        omega[-1] += 1j * STEP
        found = self.law(contact, lifted, beta, omega).reshape(pairs, c * m, lanes)
        d = found.imag / STEP
        D = sp.block_diag(list(d[:, :, :-2]), format="csr")
        return found[:, :, 0].real.reshape(pairs * c, m), D, d[:, :, -2:].reshape(-1, 2)
