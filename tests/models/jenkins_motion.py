"""Motions in time of a small structure with one Jenkins element to ground, which fretwave integrates no motion of."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm


class JenkinsMotion:
    """M x'' + C x' + K x + f e_0 = 0, f of a Jenkins element on the first dof; exact for a force linear in a step."""

    def __init__(self, M, C, K, stiffness, limit):
        self.M, self.C, self.K = (np.asarray(matrix, dtype=float) for matrix in (M, C, K))
        self.stiffness, self.limit = stiffness, limit

    def amplitudes(self, x, v, omega, periods, dof, steps=400):
        """Half the swing of a dof in each period of 2 pi / omega, from the slider at rest."""
        free, held, rising = self._step(2 * np.pi / omega / steps)
        y, force = np.concatenate([x, v]), 0.0
        path = np.empty((periods, steps))
        for k in range(periods * steps):
            new = force
            for _ in range(3):  # of the force at the end
                end = free @ y + held * force + rising * (new - force)
                new = np.clip(force + self.stiffness * (end[0] - y[0]), -self.limit, self.limit)
            y, force = end, new
            path.flat[k] = y[dof]
        return np.ptp(path, axis=1) / 2

    def _step(self, h):
        """Of (x, v): its own share, that of a constant force, that of one which grows from 0 to 1."""
        n = len(self.M)
        system = np.zeros((2 * n + 2, 2 * n + 2))
        system[:n, n : 2 * n] = np.eye(n)
        system[n : 2 * n, : 2 * n] = -np.linalg.solve(self.M, np.hstack([self.K, self.C]))
        system[n : 2 * n, 2 * n] = -np.linalg.inv(self.M)[:, 0]
        system[2 * n, 2 * n + 1] = 1.0 / h
        whole = expm(h * system)
        return whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n], whole[: 2 * n, 2 * n + 1]
