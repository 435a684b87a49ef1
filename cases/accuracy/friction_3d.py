#!/usr/bin/env python3
"""True errors of sampled friction in three dimensions: a rubbing block against the exact oracle, by N_t.

    OMP_NUM_THREADS=1 .venv/bin/python cases/accuracy/friction_3d.py

Four ways to load one block: what is it that costs samples, the path that bends or the load that varies?
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

import fretwave as fw

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from oracle import Block, Pair, orbit_3d  # noqa: E402

SAMPLES = [64, 128, 256, 512, 1024, 2048, 4096]
H, OMEGA = 21, 3.0
#: amplitudes of the forces along the normal and both tangents [N], static load along the normal [N]
SCENES = {
    "straight, load constant": (0.0, 1.5j, 0.0),
    "straight, load varies": (0.9, 1.5j, 0.0),
    "straight, lifts off": (1.6, 1.5j, 0.0),
    "bent, load constant": (0.0, 1.5j, 1.2 - 0.7j),
    "bent, load varies": (0.9, 1.5j, 1.2 - 0.7j),
    "bent, lifts off": (1.6, 1.5j, 1.2 - 0.7j),
}


def block(normal: complex, first: complex, second: complex) -> Block:
    """Three dofs on springs, one pair of 50 and 40 N/m with 1 N on it, mu 0.4."""
    K = np.array([[20.0, 2.0, 0.0], [2.0, 15.0, 0.0], [0.0, 0.0, 6.0]])
    if normal == 0:
        K[0, 1] = K[1, 0] = 0.0  # nothing moves along the normal
    pair = Pair(np.eye(3), kn=50.0, kt=40.0, mu=0.4, N0=1.0)
    p = np.array([1.0, 0.0, 0.0])  # what the preload of 1 N is balanced by
    return Block(np.eye(3), 0.4 * np.eye(3), K, [pair], np.array([normal, first, second]), p, OMEGA)


def found(b: Block, samples: int) -> np.ndarray:
    """Fundamental of the three dofs by harmonic balance."""
    pair = b.pairs[0]
    parameters = {"normal_stiffness": pair.kn, "tangential_stiffness": pair.kt, "friction_coefficient": pair.mu}
    contact = fw.Contact("coulomb_3d", pair.B, {**parameters, "normal_load": pair.N0})
    with fw.Model(b.M, b.K, b.C, [contact], MPI.COMM_WORLD) as model:
        harmonics = fw.choose_harmonics(model, H, samples)
        force = {0: b.p, 1: b.P}
        problem = fw.ForcedResponse(model, harmonics, force, 1.0, 1, fw.linear_modes(model, 1)[0])
        first = next(iter(fw.Continuation(problem, problem.initial(OMEGA), (OMEGA / 2, 2 * OMEGA))))
        Q = problem.coefficients(first.y)
    return Q[:, 1] - 1j * Q[:, 2]


def main() -> None:
    print("| scene | events in a period | " + " | ".join(map(str, SAMPLES)) + " | order |")
    print("|---|---:|" + "---:|" * (len(SAMPLES) + 1))
    for name, forces in SCENES.items():
        b = block(*forces)
        orbit = orbit_3d(b, settle=4)
        q = orbit.harmonics(1)[:3, 1]
        errors = [np.linalg.norm(found(b, n) - q) / np.linalg.norm(q) for n in SAMPLES]
        slope = np.polyfit(np.log(SAMPLES), np.log(errors), 1)[0]
        cells = " | ".join(f"{e:.1e}" for e in errors)
        print(f"| {name} | {len(orbit.events)} | {cells} | {slope:.1f} |", flush=True)


if __name__ == "__main__":
    main()
