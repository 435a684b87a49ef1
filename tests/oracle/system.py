"""M x'' + C x' + K x + sum_j B_j^T f_j = Re(P e^{i w t}) + p as a linear system y' = A y for each pattern of states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from .laws import Array, Law, Local, Rows

Pattern = tuple[str, ...]


class Linear(NamedTuple):
    """The system in one pattern of its contacts' states."""

    A: Array  #: y' = A y
    land: Array  #: projection of y on entering the pattern
    guards: list[tuple[int, Array, str]]  #: contact, row that has to stay above zero, state that follows
    forces: Array  #: rows of the contact forces (n_contacts, n_y)


@dataclass(frozen=True)
class System:
    """Structure, contacts and load; nothing here changes in time.

    Parameters
    ----------
    M, C, K : (n, n)
    contacts : laws, each along one direction of x
    P : (n,) complex force amplitude of Re(P e^{i omega t})
    p : (n,) static load
    omega : angular frequency of the force [rad/s]
    """

    M: Array
    C: Array
    K: Array
    contacts: Sequence[Law]
    P: npt.NDArray[Any] = field(default_factory=lambda: np.zeros(1))
    p: Array = field(default_factory=lambda: np.zeros(1))
    omega: float = 1.0

    @property
    def n_dof(self) -> int:
        """Degrees of freedom."""
        return len(self.M)

    @property
    def n_inner(self) -> int:
        """Inner states of all contacts."""
        return sum(c.inner for c in self.contacts)

    @property
    def n_state(self) -> int:
        """Entries of (x, x', s)."""
        return 2 * self.n_dof + self.n_inner

    @property
    def start(self) -> Pattern:
        """The pattern at rest."""
        return tuple(c.start for c in self.contacts)

    def extended(self, state: Array, t: float = 0.0) -> Array:
        """y of (x, x', s) at time t."""
        return np.concatenate([state, [np.cos(self.omega * t), np.sin(self.omega * t), 1.0]])

    def inner_at(self, contact: int) -> int:
        """Where a contact's inner state stands in y."""
        return 2 * self.n_dof + sum(c.inner for c in self.contacts[:contact])

    def displacement(self, direction: Any) -> Array:
        """Row over y of a direction of x: a vector (n,), or the number of a dof."""
        row = np.zeros(self.n_state + 3)
        row[: self.n_dof] = np.eye(self.n_dof)[direction] if np.ndim(direction) == 0 else direction
        return row

    def velocity(self, direction: Any) -> Array:
        """The same of x'."""
        return np.roll(self.displacement(direction), self.n_dof)

    def rows(self, contact: int) -> Rows:
        """What a law is written in."""
        unit, B = np.eye(self.n_state + 3), self.contacts[contact].B
        at = self.inner_at(contact) if self.contacts[contact].inner else -1
        return Rows(
            self.displacement(B),
            self.velocity(B),
            unit[at],
            unit[-1],
            lambda other: (self.displacement(other), self.velocity(other)),
        )

    def linear(self, pattern: Pattern) -> Linear:
        """A, landing, guards and forces of a pattern."""
        n, size = self.n_dof, self.n_state + 3
        local = [law.local(state, self.rows(j)) for j, (law, state) in enumerate(zip(self.contacts, pattern))]
        push = np.zeros((n, size))  # what acts on M x''
        push[:, :n], push[:, n : 2 * n] = -self.K, -self.C
        push[:, -3], push[:, -2], push[:, -1] = np.real(self.P), -np.imag(self.P), self.p
        for law, here in zip(self.contacts, local):
            if here.force is not None:
                push -= np.outer(law.B, here.force)
        A, land = np.zeros((size, size)), np.eye(size)
        multipliers = self._constrain(local, push, land)
        A[:n, n : 2 * n] = np.eye(n)
        A[n : 2 * n] = np.linalg.solve(self.M, push)
        A[-3, -2], A[-2, -3] = -self.omega, self.omega
        guards, forces = [], []
        for j, here in enumerate(local):
            at = self.inner_at(j)
            if here.rate is not None:
                A[at] = here.rate
            if here.landing is not None:
                land[at] = here.landing
            force = multipliers[j] if here.force is None else here.force
            forces.append(force)
            guards += [(j, row, follows) for row, follows in here.guards(force)]
        return Linear(A, land, guards, np.array(forces).reshape(len(local), size))

    def _constrain(self, local: list[Local], push: Array, land: Array) -> dict[int, Array]:
        """Rows of the forces that keep contacts from moving (B x'' = 0), taken off `push`; `land` stops them."""
        held = [j for j, here in enumerate(local) if here.force is None]
        if not held:
            return {}
        n, B = self.n_dof, np.array([self.contacts[j].B for j in held])
        MB = np.linalg.solve(self.M, B.T)
        G = B @ MB
        multipliers = np.linalg.solve(G, MB.T @ push)
        push -= B.T @ multipliers
        land[n : 2 * n, n : 2 * n] -= MB @ np.linalg.solve(G, B)
        return dict(zip(held, multipliers))
