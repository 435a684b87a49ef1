"""A pair of 3-D Coulomb contact under imposed motion, and pairs in a small mode, that several tests share."""

from __future__ import annotations

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from models.core_models import chain, everywhere, unknowns
from mpi4py import MPI

import fretwave as fw

KN, KT, MU = 2.0, 1.5, 0.4
SAMPLES = 64
LAWS = ["coulomb_3d", "coulomb_3d_uncoupled"]
#: On several ranks each must draw the same examples.
DRAWN = settings(max_examples=25, deadline=None, derandomize=True, database=None)
motions = st.lists(st.floats(-2.0, 2.0), min_size=21, max_size=21).map(lambda q: np.reshape(q, (3, 7)))
loads = st.floats(0.0, 3.0)


def pair(law="coulomb_3d", B=((1, 0, 0), (0, 1, 0), (0, 0, 1)), **changes):
    parameters = {"normal_stiffness": KN, "tangential_stiffness": KT, "friction_coefficient": MU, "normal_load": 1.0}
    return fw.Contact(law, np.array(B, dtype=float), {**parameters, **changes})


def imposed(contact, q, orders=(0, 1, 2, 3), samples=SAMPLES):
    """A problem and its unknowns for the motion with coefficients q (dofs, m), frequency 1, no decay."""
    n = np.shape(contact.B)[1]
    model = fw.Model(np.eye(n), np.eye(n), None, [contact], MPI.COMM_WORLD)
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics(orders, samples), "EPMC", 0, start)
    return problem, unknowns(problem, np.concatenate([np.ravel(q), [0.0, 1.0, 0.0]]))


def period(contact, q, **options):
    """u, f (samples, 3) of a single pair over one period, on every rank."""
    problem, y = imposed(contact, q, **options)
    found = everywhere(problem, problem.contact_period(y))[0]
    return found["u"][:, :, 0], found["f"][:, :, 0]


def motion(normal=(0,), tangent=(0,), other=(0,)):
    """Coefficients (3, 7) from the leading ones of each direction."""
    q = np.zeros((3, 7))
    for row, values in zip(q, (normal, tangent, other)):
        row[: len(values)] = values
    return q


#: Motions of a pair that never opens: which sliders close its period.
STEADY = {
    "shakedown on one disc": motion((0, 0.05), (1.0, 0.1), (0.3, 0, 0.1)),
    "shakedown on two discs": motion((0, 0, 0.02), (0.2, 0, 0, 0.05), (0.1, 0.24, 0.03)),
    "cycle near its onset": motion((0, 0, 0.02), (0.02, 0, 0.29), (0.05, 0.17)),
    "cycle": motion((0, 0.1, 0.1), (0.3, 0, 0.5, 0.2), (0.2, 0.6)),
}


def random_map(pairs, n, seed=3):
    return 0.5 * np.random.default_rng(seed).standard_normal((3 * pairs, n))


def random_mode(law, method, seed, n=5):
    """A mode problem of 3 pairs seen through a full B, and a point where they stick, slip and open."""
    rng = np.random.default_rng(seed)
    model = fw.Model(np.eye(n), chain(n), 0.02 * chain(n), [pair(law, random_map(3, n))], MPI.COMM_WORLD)
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2], 32), method, 0, start)
    return problem, np.concatenate([0.5 * rng.standard_normal(5 * n), [0.05, 1.1, -0.2]])
