"""Scenes that nobody chose: structures, contacts and settings at random between the ends of the axes of the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg as la

from .closed import limits
from .equations import Contact
from .scene import Scene
from .structures import coulomb, forced, jenkins, mode, pad

Random = np.random.Generator


def scenes(count: int, seed: int) -> Iterator[Scene]:
    """Scene n of a seed is the same whatever the count."""
    for n in range(count):
        random = np.random.default_rng([seed, n])
        yield scene(random, [str(random.choice(["tanh", "jenkins", "pad", "stop"]))], f"{seed}_{n}")


def mixed(count: int, seed: int) -> Iterator[Scene]:
    """Two or three contacts of different laws and sizes on one structure, between dofs and to the ground."""
    for n in range(count):
        random = np.random.default_rng([seed, n, 1])
        kinds = [str(kind) for kind in random.choice(["tanh", "jenkins", "pad"], size=int(random.integers(2, 4)))]
        yield scene(random, kinds, f"{seed}_{n}")


def scene(random: Random, kinds: list[str], name: str) -> Scene:
    """One in three a response, the others modes."""
    return (response if random.random() < 0.35 else free)(random, kinds, "_".join([name, *kinds]))


def log_uniform(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def structure(random: Random) -> tuple[Any, Any]:
    """Two to six dofs: masses over a factor of ten (one in four: up to 1e6), a stiffness whose eigenvalues spread
    from 1 to 1e2 or 1e4, in axes at random."""
    n = int(random.integers(2, 7))
    spread = 1e6 if random.random() < 0.25 else 10.0
    mass = np.array([log_uniform(random, 1 / spread, 1.0) for _ in range(n)])
    Q = np.linalg.qr(random.normal(size=(n, n)))[0]
    values = [log_uniform(random, 1.0, random.choice([1e2, 1e4])) for _ in range(n)]
    M = np.diag(mass)
    root = np.sqrt(np.diag(mass))
    return M, root @ (Q * values) @ Q.T @ root


def contacts(random: Random, kinds: list[str], M: Any, K: Any) -> tuple[list[Contact], float]:
    """A contact on the last dofs, or several anywhere, and the displacement at which a state first changes."""
    if len(kinds) == 1:
        one, onset = contact(random, kinds[0], M, K)
        return [one], onset
    found, onsets = [], []
    for k, kind in enumerate(kinds):
        one, onset = contact(random, kind, M, K)
        turned = np.roll(one.B, int(random.integers(len(M))), axis=1)
        if one.components == 1 and random.random() < 0.5:  # between two dofs
            turned = turned - np.roll(turned, 1, axis=1)
        found.append(replace(one, name=f"{one.name}{k}", B=turned))
        onsets.append(onset)
    return found, min(onsets)


def contact(random: Random, kind: str, M: Any, K: Any) -> tuple[Contact, float]:
    """A contact on the last dofs, and the displacement there at which its state first changes."""
    n = len(M)
    stiff = float(K[-1, -1])
    if kind == "tanh":
        limit = stiff * log_uniform(random, 1e-3, 1e3)
        eps = log_uniform(random, 1e-6, 1.0) * limit / stiff * np.sqrt(stiff / M[-1, -1])
        return coulomb(limit, eps, np.eye(n)[-1]), limit / stiff
    kt = stiff * log_uniform(random, 1e-3, 1e6)
    limit = stiff * log_uniform(random, 1e-3, 1e3)
    if kind == "jenkins":
        rows = np.eye(n)[-int(random.integers(1, min(n, 4))) :]
        return jenkins(kt, limit, rows), limit / kt
    B = np.zeros((3, n))
    if kind == "stop":
        B[0, -1] = 1.0
        gap = log_uniform(random, 1e-3, 1e3)
        return pad(kt, 1.0, 0.0, 0.0, gap, B), gap
    B = np.hstack([np.zeros((3, n)), np.eye(3)])[:, -n:] if n >= 3 else B + np.vstack([np.eye(2), np.zeros(2)])
    mu = log_uniform(random, 1e-2, 10.0)
    return pad(kt, kt * log_uniform(random, 0.1, 1.0), mu, limit, 0.0, B), min(1.0, mu) * limit / kt


def settings(random: Random) -> dict[str, Any]:
    """Harmonics, samples from the least on, steps."""
    H = int(random.choice([1, 3, 5, 7, 9, 15]))
    samples = int(random.choice([2 * H + 2, 64, 256, 1024]))
    longest = log_uniform(random, 0.02, 0.5)
    step = {"initial": min(0.05, longest), "maximum": longest, "max_angle": random.uniform(0.2, 0.8)}
    return {"H": H, "samples": max(samples, 2 * H + 2), "step": step}


def needs_mean(kinds: list[str]) -> dict[str, Any]:
    return {"retain": "all"} if "stop" in kinds else {}


def preload(kinds: list[str]) -> bool | None:
    return True if {"pad", "stop"} & set(kinds) else None


def lowest(M: Any, K: Any) -> tuple[float, Any]:
    """Angular frequency and shape of the lowest mode without contact."""
    values, shapes = la.eigh(K, M)
    return float(np.sqrt(values[0])), shapes[:, 0]


def free(random: Random, kinds: list[str], name: str) -> Scene:
    """A mode from below the first change of state to far above it, observed where it moves most without contact."""
    M, K = structure(random)
    pairs, onset = contacts(random, kinds, M, K)
    w, shape = lowest(M, K)
    most = int(np.argmax(abs(shape)))
    first = onset * min(1e3, abs(shape[most] / shape[-1]))
    span = first * np.array([log_uniform(random, 1e-3, 0.3), log_uniform(random, 3.0, 300.0)])
    more = {**needs_mean(kinds), "normalise": f"x{most}"}
    analysis = mode(str(random.choice(["CNM", "EPMC"])), amplitude=span, **settings(random), **more)
    scene = Scene("at random", name, M, K, pairs, analysis, preload=preload(kinds))
    if "stop" in kinds and first < 1e3 * onset:  # nothing touches yet
        scene.closed = [limits(w, None, 1e-9)]
    return scene


def response(random: Random, kinds: list[str], name: str) -> Scene:
    """A response about the lowest mode without contact, 1 to 3 % damped, to a force on the last dof."""
    M, K = structure(random)
    pairs, onset = contacts(random, kinds, M, K)
    w = lowest(M, K)[0]
    C = 2 * log_uniform(random, 0.01, 0.03) / w * K
    last = f"x{len(M) - 1}"
    level = onset * float(K[-1, -1]) * log_uniform(random, 1e-2, 3.0)
    more = {**needs_mean(kinds), "force": {last: 1.0}, "observe": last, **settings(random)}
    analysis = forced(w * np.array([0.6, 1.5]), [level], **more)
    return Scene("at random", name, M, K, pairs, analysis, C=C, preload=preload(kinds))
