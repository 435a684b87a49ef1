"""First slip of a linear motion: where the friction bound is met by any pair, at any sample, and nowhere before."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tolerances import SOLVED

import fretwave as fw
from fretwave.post.slip_threshold import slip_factor, slip_threshold

pytestmark = pytest.mark.ranks(1)
MU = np.array([0.3, 0.5, 0.2])


def forces(seed: int, swing: float, samples: int = 128) -> np.ndarray:
    """Three pairs that stick under normal loads of 8 to 12 and tangential loads below 1, all moving harmonically."""
    rng = np.random.default_rng(seed)
    tau = 2 * np.pi * np.arange(samples) / samples
    rest = np.stack([rng.uniform(8, 12, 3), rng.uniform(-0.7, 0.7, 3), rng.uniform(-0.7, 0.7, 3)])
    parts = rng.standard_normal((2, 3, 3)) * swing
    return rest + np.cos(tau)[:, None, None] * parts[0] + np.sin(tau)[:, None, None] * parts[1]


def excess(f: np.ndarray, factor: float) -> float:
    """Largest |t| - mu N over pairs and samples at a multiple of the motion."""
    g = f.mean(axis=0) + factor * (f - f.mean(axis=0))
    return float((np.hypot(g[:, 1], g[:, 2]) - MU * g[:, 0]).max())


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("swing", [1e-3, 0.2])
def test_the_friction_cone_is_met_at_the_threshold_and_not_before(seed: int, swing: float) -> None:
    f = forces(seed, swing)
    factor = slip_factor(f, friction=MU)
    assert abs(excess(f, factor)) < SOLVED
    assert max(excess(f, share * factor) for share in np.linspace(0, 0.999, 40)) < 0


def test_constant_limits() -> None:
    """The pair that reaches its limit first, whatever the sign of the force."""
    tau = 2 * np.pi * np.arange(64) / 64
    f = np.cos(tau)[:, None, None] * np.array([0.5, -2.0, 1.0])
    assert slip_factor(f, limit=np.array([1.0, 3.0, 4.0])) == pytest.approx(1.5)
    assert slip_factor(f + np.array([0.0, 1.0, 0.0]), limit=np.array([1.0, 3.0, 4.0])) == pytest.approx(1.0)
    assert slip_factor(f, limit=3.0) == pytest.approx(1.5)


def test_no_tangential_force_never_slips() -> None:
    f = np.zeros((16, 3, 1))
    f[:, 0] = 5.0
    assert slip_factor(f, friction=0.3) == np.inf


def kept(law: str, **parameters: object) -> dict[str, str]:
    """What results say of a contact 'root'."""
    case = {f"contact.root.{key}": value for key, value in {"law": law, **parameters}.items()}
    return {"case": json.dumps(case), "laws": json.dumps({"root": fw.laws()[law].plain()})}


def test_the_threshold_is_a_multiple_of_the_amplitude() -> None:
    f = {"root": forces(0, 0.1)}
    found = slip_threshold(2e-5, f, kept("coulomb_3d", friction_coefficient=MU.tolist()))
    assert found == pytest.approx(2e-5 * slip_factor(f["root"], friction=MU))
    viscous = kept("regularised_coulomb", friction_limit=5.0)
    assert np.isnan(slip_threshold(2e-5, {"root": f["root"][:, :1]}, viscous))
    assert np.isnan(slip_threshold(2e-5, f, {"case": viscous["case"]}))  # of results that do not say what the laws are


@pytest.mark.parametrize("seed", range(4))
def test_tangents_that_are_limited_one_by_one_slip_later(seed: int) -> None:
    """The largest of both tangents meets mu N at the threshold and not before."""
    f = forces(seed, 0.2)
    factor = slip_threshold(1.0, {"root": f}, kept("coulomb_3d_uncoupled", friction_coefficient=MU.tolist()))

    def over(share: float) -> float:
        g = f.mean(axis=0) + share * (f - f.mean(axis=0))
        return float((np.abs(g[:, 1:]).max(axis=1) - MU * g[:, 0]).max())

    assert abs(over(factor)) < SOLVED
    assert max(over(share * factor) for share in np.linspace(0, 0.999, 40)) < 0
    assert factor >= slip_factor(f, friction=MU)
