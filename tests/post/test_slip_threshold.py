"""First slip of a linear motion: where the friction bound is met by any pair, at any sample, and nowhere before."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tolerances import SOLVED

import fretwave as fw
from fretwave.post.slip_threshold import lasting_factors, slip_factor, slip_factors, slip_threshold

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


def settled_work(f: np.ndarray, factor: float) -> np.ndarray:
    """Work (n_pairs,) of one tangent in its 40th period, its slider moved sample by sample from where it is at rest."""
    t, holds = (
        factor * (f[:, 1] - f[:, 1].mean(axis=0)),
        MU * (f[:, 0].mean(axis=0) + factor * (f[:, 0] - f[:, 0].mean(axis=0))),
    )
    shift = f[:, 1].mean(axis=0)
    for _ in range(40):
        work = np.zeros(t.shape[1])
        for now, limit in zip(t, holds):
            force = np.clip(now + shift, -limit, limit)
            work += np.abs(force - now - shift) * limit
            shift = force - now
    return work


@pytest.mark.parametrize("seed", range(4))
def test_slip_lasts_where_no_slider_settles(seed: int) -> None:
    """Shakedown in closed form, against sliders that are moved through forty periods."""
    f = forces(seed, 1.0)[:, :2]
    factors = lasting_factors(f, friction=MU)
    for pair, factor in enumerate(factors):
        assert settled_work(f, 0.999 * factor)[pair] == pytest.approx(0, abs=SOLVED)
        assert settled_work(f, 1.001 * factor)[pair] > 1e-4
    assert np.all(factors > slip_factors(f, friction=MU))


def test_slip_that_lasts_in_a_circle_along_one_line() -> None:
    """Both tangents move along one line, in phase with the normal force: mu N0 / T, whatever the line."""
    tau = 2 * np.pi * np.arange(64) / 64
    part = np.array([1.5, 3.0 * np.cos(1.1), 3.0 * np.sin(1.1)])
    f = np.array([10.0, 0.4, -0.2])[:, None] + np.cos(tau)[:, None, None] * part[:, None]
    assert lasting_factors(f, friction=0.3) == pytest.approx(0.3 * 10 / 3.0, rel=1.3e-3)  # pi / 64 between directions


def test_slip_that_lasts_of_a_slider_is_its_first() -> None:
    f = np.cos(2 * np.pi * np.arange(64) / 64)[:, None, None] * np.array([[2.0, 0.5]])
    limits = np.array([3.0, 4.0])
    assert lasting_factors(f, limit=limits) == pytest.approx([1.5, 8.0], rel=SOLVED)
    assert slip_factors(f, limit=limits) == pytest.approx([1.5, 8.0], rel=SOLVED)
