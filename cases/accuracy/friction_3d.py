#!/usr/bin/env python3
"""Friction in three dimensions against the exact oracle: the force of an imposed motion, and a block that rubs, by H.

    OMP_NUM_THREADS=1 .venv/bin/python cases/accuracy/friction_3d.py

The number of samples has no share in either: the block is solved with the least one and with 16 times as many.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

import fretwave as fw

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from oracle import Block, Pair, forces, orbit_3d  # noqa: E402

HARMONICS, OMEGA = [5, 9, 21, 41, 81], 3.0
#: amplitudes of the forces along the normal and both tangents [N], static load along the normal [N]
SCENES = {
    "straight, load constant": (0.0, 1.5j, 0.0),
    "straight, load varies": (0.9, 1.5j, 0.0),
    "straight, lifts off": (1.6, 1.5j, 0.0),
    "bent, load constant": (0.0, 1.5j, 1.2 - 0.7j),
    "bent, load varies": (0.9, 1.5j, 1.2 - 0.7j),
    "bent, lifts off": (1.6, 1.5j, 1.2 - 0.7j),
}
#: stiffnesses [N/m], and how wide paths are; the oracle takes minutes where a stiff slider turns back in a narrow one
IMPOSED = [(kt, across) for kt in (1.5, 1e2) for across in (0.3, 0.03, 0.0)] + [(1e5, 0.3), (1e9, 0.3)]
LAW = {"kn": 50.0, "kt": 40.0, "mu": 0.4, "N0": 1.0}
NAMES = {"kn": "normal_stiffness", "kt": "tangential_stiffness", "mu": "friction_coefficient", "N0": "normal_load"}


def contact(B: Any, law: dict[str, float]) -> fw.Contact:
    return fw.Contact("coulomb_3d", B, {NAMES[key]: value for key, value in law.items()})


def block(normal: complex, first: complex, second: complex) -> Block:
    """Three dofs on springs, one pair of 50 and 40 N/m with 1 N on it, mu 0.4."""
    K = np.array([[20.0, 2.0, 0.0], [2.0, 15.0, 0.0], [0.0, 0.0, 6.0]])
    if normal == 0:
        K[0, 1] = K[1, 0] = 0.0  # nothing moves along the normal
    p = np.array([1.0, 0.0, 0.0])  # what the preload of 1 N is balanced by
    pair = Pair(np.eye(3), **LAW)
    return Block(np.eye(3), 0.4 * np.eye(3), K, [pair], np.array([normal, first, second]), p, OMEGA)


def found(b: Block, H: int, samples: int) -> np.ndarray:
    """Fundamental of the three dofs by harmonic balance."""
    with fw.Model(b.M, b.K, b.C, [contact(b.pairs[0].B, LAW)], MPI.COMM_WORLD) as model:
        harmonics = fw.choose_harmonics(model, H, samples)
        problem = fw.ForcedResponse(model, harmonics, {0: b.p, 1: b.P}, 1.0, 1, fw.linear_modes(model, 1)[0])
        first = next(iter(fw.Continuation(problem, problem.initial(OMEGA), (OMEGA / 2, 2 * OMEGA))))
        Q = problem.coefficients(first.y)
    return Q[:, 1] - 1j * Q[:, 2]


def imposed(q: np.ndarray, law: dict[str, float]) -> np.ndarray:
    """Harmonics of the force (3, m) on a mass of 1 kg on a spring of 1 N/m that moves as told at 1 rad/s."""
    H = q.shape[1] // 2
    with fw.Model(np.eye(3), np.eye(3), None, [contact(np.eye(3), law)], MPI.COMM_SELF) as model:
        start = fw.LinearMode(1.0, 0.0, np.ones(3), np.zeros(3))
        problem = fw.NonlinearMode(model, fw.Harmonics(range(H + 1), 2 * H + 2), "EPMC", 0, start)
        y = problem.core.unknowns()
        y.setArray(np.concatenate([q.ravel(), [0.0, 1.0, 0.0]]))
        r = problem.residual(y).getArray(readonly=True)[: q.size].reshape(q.shape)
        n = np.repeat(np.arange(H + 1), 2)[1:]
        return np.asarray(r - (1 - n**2) * q)


def path(across: float, normal: float, H: int = 10) -> np.ndarray:
    """First tangent cos t + 0.2 cos 2t - 0.1 sin 2t, the second so many times its quarter period later."""
    q = np.zeros((3, 2 * H + 1))
    q[1, [1, 3, 4]] = 1.0, 0.2, -0.1
    q[2, 2] = across
    q[0, 1:3] = normal * np.array([0.6, 0.8])
    return q


def force_table() -> None:
    """Largest error over the largest of the force's harmonics 0 to 10, by stiffness and shape of the path."""
    print("| kt [N/m] | across / along | load constant | load varies | lifts off |\n|---:|---:|---:|---:|---:|")
    for kt, across in IMPOSED:
        cells = []
        for normal in (0.0, 0.01, 0.03):  # times 50 N/m, beside 1 N
            law, q = {**LAW, "kt": kt}, path(across, normal)
            F = forces(q, **law)
            cells.append(f"{np.abs(imposed(q, law) - F).max() / np.abs(F).max():.0e}")
        print(f"| {kt:g} | {across:g} | " + " | ".join(cells) + " |", flush=True)


def block_table() -> None:
    """Relative error of the fundamental by H, and what 16 times as many samples change of it."""
    print("\n| scene | events in a period | " + " | ".join(map(str, HARMONICS)) + " | 16 times the samples |")
    print("|---|---:|" + "---:|" * (len(HARMONICS) + 1))
    for name, amplitudes in SCENES.items():
        b = block(*amplitudes)
        orbit = orbit_3d(b, settle=4)
        q = orbit.harmonics(1)[:3, 1]
        least = [found(b, H, 2 * H + 2) for H in HARMONICS]
        errors = [np.linalg.norm(x - q) / np.linalg.norm(q) for x in least]
        changes = [
            np.linalg.norm(found(b, H, 32 * H + 32) - x) / np.linalg.norm(x) for H, x in zip(HARMONICS[:3], least)
        ]
        cells = " | ".join(f"{e:.1e}" for e in errors)
        print(f"| {name} | {len(orbit.events)} | {cells} | {max(changes):.0e} |", flush=True)


if __name__ == "__main__":
    force_table()
    block_table()
