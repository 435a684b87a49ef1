"""Friction on a circle in continuous time: its force against the oracle's, on paths that bend, reverse, open."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import unknowns, whole
from mpi4py import MPI
from oracle import forces
from oracle.test_oracle_friction_3d import NEARLY_STRAIGHT

import fretwave as fw


def core(q, law, samples=0):
    """Harmonics of the force (3, m) on one pair whose components move as told."""
    H = (np.shape(q)[1] - 1) // 2
    names = {"kn": "normal_stiffness", "kt": "tangential_stiffness", "mu": "friction_coefficient", "N0": "normal_load"}
    contact = fw.Contact("coulomb_3d", np.eye(3), {names.get(key, key): value for key, value in law.items()})
    model = fw.Model(np.eye(3), np.eye(3), None, [contact], MPI.COMM_WORLD)
    start = fw.LinearMode(1.0, 0.0, np.ones(3), np.zeros(3))
    harmonics = fw.Harmonics(range(H + 1), samples or 2 * H + 2)
    problem = fw.NonlinearMode(model, harmonics, "EPMC", 0, start)
    y = unknowns(problem, np.concatenate([np.ravel(q), [0.0, 1.0, 0.0]]))
    n = np.concatenate([[0], np.repeat(np.arange(1, H + 1), 2)])
    return whole(problem.residual(y))[: np.size(q)].reshape(3, -1) - (1 - n**2) * q


def motion(seed, H, sizes):
    n = np.repeat(np.arange(H + 1), 2)[1:].clip(1)
    return np.random.default_rng(seed).standard_normal((3, 2 * H + 1)) / n**1.5 * np.reshape(sizes, (3, 1))


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    "law, H, sizes, seeds",
    [
        ({"kn": 8.0, "kt": 5.0, "mu": 0.4, "N0": 20.0}, 3, (0.5, 1, 1), 3),
        ({"kn": 8.0, "kt": 5.0, "mu": 0.4, "N0": 3.0}, 3, (0.5, 1, 1), 3),
        ({"kn": 2.0, "kt": 300.0, "mu": 0.3, "N0": 1.0, "gap": 0.1}, 3, (0.8, 0.3, 1), 1),
        ({"kn": 1e4, "kt": 2e5, "mu": 0.5, "N0": 900.0}, 2, (0.05, 1, 0.2), 1),
    ],
    ids=["closed", "opens", "gap", "stiff"],
)
def test_force_is_the_oracle_s(law, H, sizes, seeds):
    for seed in range(seeds):
        q = motion(seed, H, sizes)
        F = forces(q, **{"gap": 0.0, **law}, rest=np.zeros(2), harmonics=H)
        assert core(q, law) == pytest.approx(F, abs=1e-9 * np.abs(F).max())


#: forces(NEARLY_STRAIGHT, kn=1e6, kt=8e5, mu=0.5, N0=1.0, gap=0.0, rest=0, harmonics=5) of the oracle, which takes 15 s
PUSHED_AHEAD = np.array(  # fmt: skip
    [
        [
            9.997439570000e-01,
            -1.684725000001e-02,
            -5.055485000000e-03,
            0,
            0,
            5.075299999947e-04,
            3.623300000004e-04,
            0,
            0,
            -1.168800000055e-04,
            -4.026100000028e-05,
        ],
        [
            2.166680359493e-03,
            -1.943513858620e-01,
            -1.727323850058e-02,
            1.603753460888e-04,
            3.906210146282e-04,
            5.634159024345e-02,
            1.416556745717e-02,
            5.380292028515e-04,
            5.923038860151e-05,
            -3.504713501838e-02,
            -1.127506558464e-02,
        ],
        [
            -5.194174563551e-03,
            5.848779004427e-01,
            8.638826001511e-02,
            -9.525384099540e-04,
            -4.027010884608e-03,
            -1.690944215749e-01,
            -5.222630667008e-02,
            -4.238061178543e-03,
            7.193046690935e-04,
            1.115614493927e-01,
            3.722226224515e-02,
        ],
    ]
)


@pytest.mark.ranks(1)
def test_force_is_the_oracle_s_on_a_path_that_is_nearly_straight():
    """Where it reverses the load falls and the slider is pushed ahead: what lies beside the path grows."""
    law = {"kn": 1e6, "kt": 8e5, "mu": 0.5, "N0": 1.0}
    assert core(NEARLY_STRAIGHT, law) == pytest.approx(PUSHED_AHEAD, abs=1e-9)


@pytest.mark.ranks(1)
def test_samples_are_not_asked_for():
    law, q = {"kn": 8.0, "kt": 5.0, "mu": 0.4, "N0": 3.0}, motion(5, 3, (0.5, 1, 1))
    assert np.array_equal(core(q, law), core(q, law, samples=256))
