"""A builder for tests: a chain of masses that only two contact pairs hold in the normal direction."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from fretwave import InputError, Pairs, Structure

STIFFNESS, AREA = 4e6, 2e-4


@dataclass(frozen=True)
class Options:
    """`weight` is that of the whole chain."""

    masses: int = 6
    mass: float = 0.5
    weight: float = 30.0
    tilt: tuple[float, float] = (0.0, 0.0)


def build(**options: Any) -> Structure:
    """Springs along the chain in x (normal, downwards), y, z; ground springs at the first mass in y and z alone."""
    o = Options(**options)
    if o.masses < 2:
        raise InputError("the chain is too short", None, o.masses, "2 or more", "lengthen it")
    if o.mass <= 0:
        raise ValueError("no mass")
    n = 3 * o.masses
    line = sp.diags(
        [np.r_[1.0, 2 * np.ones(o.masses - 2), 1.0], -np.ones(o.masses - 1), -np.ones(o.masses - 1)], [0, 1, -1]
    )
    held = sp.csr_matrix(([1.0, 1.0], ([1, 2], [1, 2])), shape=(n, n))
    weight = np.zeros(n)
    weight[::3] = o.weight / o.masses
    ends = [0, o.masses - 1]
    B = sp.csr_matrix((np.ones(6), (np.arange(6), [3 * end + axis for end in ends for axis in range(3)])), shape=(6, n))
    pads = Pairs(
        B=B,
        parameters={"normal_stiffness": np.array([1e7, 2e7]), "normal_load": o.weight / 2},
        areas=np.full(2, AREA),
        points=np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]),
        frames=np.tile(np.eye(3), (2, 1, 1)),
        faces=["pads", "pads"],
        positions=np.array([[0.0, 0.0], [0.1, 0.0]]),
    )
    return Structure(
        M=o.mass * sp.identity(n),
        K=STIFFNESS * (sp.kron(line, sp.diags([1.0, 1.0, 2.5])) + held),
        dofs={"tip": n - 2},
        pairs={"pads": pads},
        loads={"weight": weight},
        coordinates=np.column_stack([np.arange(o.masses, dtype=float), np.zeros((o.masses, 2))]),
    )
