"""A wave that decays in the family looked at is not told as stable where the flow feeds another family of it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import call
from tolerances import SOLVED

SECTORS, OMEGA, GROUND, DAMPER = 5, 3.0, 9.0, 0.02
FLOW = {0: 0.0 - 0.02j, 1: -0.1 + 0.0j, -1: 0.1 + 0.0j}
#: Masses with sliders between them, damped to the ground, and beside each another on a spring, which the flow moves.
TEXT = f"""
[model]
dofs = ["mass", "side", "next"]
M = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 0]]
K = [[1.0, 0, 0], [0, {GROUND}, 0], [0, 0, 0]]
C = [[{DAMPER}, 0, 0], [0, 0, 0], [0, 0, 0]]
sectors = {SECTORS}
low = ["mass"]
high = ["next"]

[[contact]]
name = "between"
law = "jenkins"
pairs = [["mass", "next"]]
tangential_stiffness = 1.0
friction_limit = 1.0

[aerodynamics]
frequency = {OMEGA / (2 * np.pi)!r}
dof = "side"
influence = {{ {", ".join(f"{k} = [{L.real}, {L.imag}]" for k, L in FLOW.items())} }}

[[analysis]]
name = "flutter"
type = "flutter"
normalise = "mass"
harmonics = 1
amplitude = [0.1, 3.0]
errors = false
"""


def side(diameters: int) -> complex:
    """lambda of the side mass in a wave."""
    ahead = {k: np.exp(-2j * np.pi * k * diameters / SECTORS) for k in FLOW}
    damping = -sum(L.imag / OMEGA * ahead[k] for k, L in FLOW.items())
    return max(np.roots([1.0, damping, GROUND - sum(L.real * ahead[k] for k, L in FLOW.items())]), key=np.imag)


@pytest.mark.ranks(1)
def test_families_that_are_fed_are_named_beside_waves_that_decay(tmp_path, capfd):
    path, out = tmp_path / "case.toml", tmp_path / "run"
    path.write_text(TEXT, encoding="utf-8")
    assert call("run", path, "--out", out, "--no-plots") == 0
    said = {line.split(",")[0]: line for line in capfd.readouterr().out.splitlines() if line.startswith("flutter: ND")}
    waves = json.loads((out / "run.json").read_text())["analyses"]["flutter"]["waves"]
    assert {wave["verdict"] for wave in waves} == {"stable"} and len(waves) == SECTORS
    for wave in waves:
        value = side(wave["nodal_diameter"])
        expected = [-value.real / abs(value)] if value.real > 0 else []
        assert [mode["zeta"] for mode in wave["fed"] if mode["contact"] == "stuck"] == pytest.approx(
            expected, rel=SOLVED
        )
        named = "0" if not wave["nodal_diameter"] else f"{wave['nodal_diameter']:+d}"
        assert ("gains energy by itself" in said[f"flutter: ND {named}"]) == bool(expected)
    assert 0 < sum(bool(wave["fed"]) for wave in waves) < SECTORS
