"""`fretwave stress` of a sector in a wave and of the whole wheel: the same gauges, in the frame of their sector."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models import gauged_sector
from models.csv_columns import table

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")

CASE = """
[model]
builder = "gauged_sector.py"

[[contact]]
name = "shroud"
law = "jenkins"
tangential_stiffness = 1e6
friction_limit = 1e12

[material]
youngs_modulus = 210e9
poisson_ratio = 0.3

[[gauge]]
name = "near"
point = [0.17, 0.0, 0.015]
direction = [1.0, 0.0, 0.0]

[[gauge]]
name = "far"
point = [0.17, 0.0, 0.015]
direction = [1.0, 0.0, 0.0]
sector = 3
"""
MODE = """
[[analysis]]
name = "{name}"
type = "mode"
method = "EPMC"
nodal_diameter = 1
normalise = "tip"
harmonics = 1
samples = 60
amplitude = [1e-5, 2e-5]
wheel = {wheel}
"""


def test_a_wave_and_the_whole_wheel_have_the_same_gauges(tmp_path: Path) -> None:
    shutil.copy(gauged_sector.__file__, tmp_path / "gauged_sector.py")
    text = CASE + MODE.format(name="wave", wheel="false") + MODE.format(name="whole", wheel="true")
    (tmp_path / "case.toml").write_text(text)
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    assert call("stress", tmp_path / "run") == 0
    wave, whole = (table(tmp_path / "run" / f"{name}_gauges.csv") for name in ("wave", "whole"))
    assert set(whole) - set(wave) == {"worst_sector"}
    assert not whole["worst_sector"].any()  # all are equal: rounding chooses none
    for name in ("near_strain", "far_strain", "stress_amplitude"):
        one, other = wave[name] / wave["amplitude"], whole[name] / whole["amplitude"]
        assert one[0] > 0
        np.testing.assert_allclose(one, one[0], rtol=1e-7)
        np.testing.assert_allclose(other, one[0], rtol=2e-5)  # each maximum is read off a parabola
