"""Masses on contacts at random, whose branches meet what no scene was made for."""

from __future__ import annotations

import numpy as np

import fretwave as fw

COMPONENTS = {
    "coulomb_3d": 3,
    "coulomb_3d_uncoupled": 3,
    "coulomb_2d": 2,
    "jenkins": 1,
    "unilateral_spring": 1,
    "cubic_spring": 1,
}


def parameters(law, draw):
    kn, kt = draw.uniform(2, 20), draw.uniform(1, 10)
    if law == "jenkins":
        return {"tangential_stiffness": kt, "friction_limit": draw.uniform(0.1, 1)}
    if law == "unilateral_spring":
        return {"normal_stiffness": kn, "gap": draw.uniform(0, 0.3)}
    if law == "cubic_spring":
        return {"cubic_stiffness": draw.uniform(0.1, 3)}
    return {
        "normal_stiffness": kn,
        "tangential_stiffness": kt,
        "friction_coefficient": draw.uniform(0.1, 0.9),
        "normal_load": draw.uniform(0.3, 3),
        "gap": 0.0,
    }


def contact(number, draw, n):
    """On some of the n masses, or on a mixture of them."""
    law = list(COMPONENTS)[draw.integers(len(COMPONENTS))]
    d = COMPONENTS[law]
    rows = np.eye(n)[draw.permutation(n)[:d]] if draw.random() < 0.6 else draw.normal(size=(d, n)) * 0.6
    return fw.Contact(law, rows, parameters(law, draw), f"{law}{number}")


def scene(comm, seed):
    """A nonlinear mode, or a response to a static and a harmonic force, and where it begins and ends."""
    draw = np.random.default_rng(seed)
    n = int(draw.integers(4, 8))
    root = draw.normal(size=(n, n))
    K = root @ root.T / n * 3 + np.eye(n)
    contacts = [contact(k, draw, n) for k in range(int(draw.integers(1, 4)))]
    model = fw.Model(np.eye(n), K, 0.02 * K, contacts, comm)
    mean, force = 0.5 * draw.normal(size=n), draw.normal(size=n) + 1j * draw.normal(size=n)
    harmonics = fw.Harmonics(range(int(draw.choice([1, 3, 5, 7])) + 1), int(draw.choice([64, 128, 256])))
    stuck, rest = fw.linear_modes(model, 1)[0], fw.balanced(model)
    if draw.random() < 0.65:
        given = {"force": {0: mean, 1: force}, "level": 1.0, "dof": 0}
        ends = (0.5 * stuck.omega, 1.6 * stuck.omega)
        return fw.ForcedResponse(model, harmonics, **given, reference=stuck, rest=rest), *ends[:: 1 if seed % 2 else -1]
    return fw.NonlinearMode(model, harmonics, dof=int(draw.integers(3)), start=stuck, rest=rest), 0.003, 5.0


def followed(comm, seed, **steps):
    return fw.follow(*scene(comm, seed), errors=False, steps=fw.StepControl(**steps))


def told(branch):
    """Largest amplitude, and the frequency at its end."""
    return branch["amplitude"].max(), branch["omega"][-1]
