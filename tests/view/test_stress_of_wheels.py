"""`fretwave stress` of a sector in a wave and of the whole wheel: the same gauges, in the frame of their sector."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models import gauged_sector
from models.csv_columns import table
from models.meshed_wheel import SECTORS

from fretwave import open_run

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


def test_a_wave_and_the_whole_wheel_have_the_same_gauges(tmp_path: Path, capfd) -> None:
    shutil.copy(gauged_sector.__file__, tmp_path / "gauged_sector.py")
    text = CASE + MODE.format(name="wave", wheel="false") + MODE.format(name="whole", wheel="true")
    (tmp_path / "case.toml").write_text(text)
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    capfd.readouterr()
    assert call("stress", tmp_path / "run") == 0
    printed = capfd.readouterr().out  # of the sector's own part of K, both faces as they move
    assert printed.count("strain energy of the stress: 1.0000 of the model's own\n") == 2
    assert "its modulus" not in printed
    wave, whole = (table(tmp_path / "run" / f"{name}_gauges.csv") for name in ("wave", "whole"))
    assert set(whole) - set(wave) == {"worst_sector"}
    assert not whole["worst_sector"].any()  # all are equal: rounding chooses none
    for name in ("near_strain", "far_strain", "stress_amplitude"):
        one, other = wave[name] / wave["amplitude"], whole[name] / whole["amplitude"]
        assert one[0] > 0
        np.testing.assert_allclose(one, one[0], rtol=1e-7)
        np.testing.assert_allclose(other, one[0], rtol=2e-5)  # each maximum is read off a parabola


DRIVEN = """
[damping]
zeta = 0.002

[[analysis]]
name = "driven"
type = "forced"
wheel = true
engine_order = 1
mistuning = { of = "all", deviations = [0.03, 0.01, -0.012, -0.002, 0.004] }
harmonics = 1
samples = 60
force = { tip = 1.0 }
observe = "tip"
levels = [1.0, 2.0]
frequency = [2336.0, 2341.0]
"""


def test_the_amplitude_of_a_driven_wheel_is_that_of_any_sector(tmp_path: Path, capfd) -> None:
    """The worst node is in the sector that moves most: beside it, the observed dof of sector 0 would say too little."""
    shutil.copy(gauged_sector.__file__, tmp_path / "gauged_sector.py")
    limits = "poisson_ratio = 0.3\nendurance_limit = 250e6\nultimate_strength = 600e6"
    (tmp_path / "case.toml").write_text(CASE.replace("poisson_ratio = 0.3", limits) + DRIVEN)
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    capfd.readouterr()
    assert call("stress", tmp_path / "run") == 0
    printed = capfd.readouterr().out
    assert "where a sector's stiffness deviates by its modulus, its stress is off by as much" in printed
    points = open_run(tmp_path / "run")["driven"]
    gauges, limit = (table(tmp_path / "run" / f"driven_{end}.csv") for end in ("gauges", "goodman"))
    np.testing.assert_array_equal(gauges["largest_amplitude"], points["largest_amplitude"])
    top = int(np.argmax(gauges["goodman"]))
    assert gauges["largest_amplitude"][top] > 1.05 * gauges["amplitude"][top]
    assert limit["at_largest_amplitude"][1] == points["largest_amplitude"][top]
    assert f"at point {top}, amplitude {points['largest_amplitude'][top]:.5g} m of any sector" in printed
    assert call("view", tmp_path / "run", "--analysis", "driven", "--point", top, "--png") == 0
    printed = capfd.readouterr().out
    assert f"(largest of all sectors {points['largest_amplitude'][top]:.6g})" in printed


LOADED = """
[reduction]
modes = 4

[preload]
loads = ["spin"]
pair_loads = false

[damping]
zeta = 0.002
"""
RESPONSE = """
[[analysis]]
name = "{name}"
type = "forced"
wheel = {wheel}
engine_order = 1
harmonics = 1
samples = 60
force = {{ tip = 1.0 }}
observe = "tip"
levels = [1.0]
frequency = [2200.0, 2201.0]
"""


def test_a_driven_wheel_keeps_the_state_at_rest_that_it_moves_about(tmp_path: Path) -> None:
    """Without it a view drew the static displacement as motion, and stress lacked what no component mode has of it."""
    shutil.copy(gauged_sector.__file__, tmp_path / "gauged_sector.py")
    text = CASE + LOADED + RESPONSE.format(name="sector", wheel="false") + RESPONSE.format(name="wheel", wheel="true")
    (tmp_path / "case.toml").write_text(text)
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    with h5py.File(tmp_path / "run" / "results.h5") as file:
        one, all_of_them = (file[name]["rest_displacement"][()] for name in ("sector", "wheel"))
    np.testing.assert_allclose(
        all_of_them.reshape(SECTORS, -1), np.tile(one, (SECTORS, 1)), atol=1e-9 * np.abs(one).max()
    )
    assert call("stress", tmp_path / "run") == 0
    sector, wheel = (table(tmp_path / "run" / f"{name}_gauges.csv") for name in ("sector", "wheel"))
    for name in ("near_mean", "far_mean", "mean_stress", "near_strain", "stress_amplitude"):
        np.testing.assert_allclose(wheel[name], sector[name], rtol=1e-7)


def test_a_run_that_lacks_the_state_at_rest_is_told(tmp_path: Path, capfd) -> None:
    """Results of versions that did not keep it: what they lack is said, not shown in silence."""
    shutil.copy(gauged_sector.__file__, tmp_path / "gauged_sector.py")
    (tmp_path / "case.toml").write_text(CASE + LOADED + RESPONSE.format(name="wheel", wheel="true"))
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    told = "note: the displacement at rest under spin is not kept"
    for kept in (True, False):
        capfd.readouterr()
        assert call("stress", tmp_path / "run") == 0
        assert call("view", tmp_path / "run", "--png", "--sectors", "0") == 0
        assert capfd.readouterr().out.count(told) == (0 if kept else 2)
        if kept:
            with h5py.File(tmp_path / "run" / "results.h5", "r+") as file:
                del file["wheel"]["rest_displacement"]


def test_the_mean_of_a_mistuned_reduced_wheel_is_told_to_be_of_tuned_sectors(tmp_path: Path, capfd) -> None:
    """Beside the unreduced wheel's mean strain it is off by less than the deviations, 2 %; a tuned wheel's is exact."""
    shutil.copy(gauged_sector.__file__, tmp_path / "gauged_sector.py")
    mistuned = 'mistuning = { of = "all", deviations = [0.02, -0.01, 0.0, -0.02, 0.01] }\n'
    response = RESPONSE.format(name="driven", wheel="true")
    text = CASE + LOADED + response.replace("harmonics = 1\n", f"harmonics = 1\n{mistuned}")
    reduced = LOADED.partition("[preload]")[0]
    for name, given in (
        ("reduced", text),
        ("whole", text.replace(reduced, "")),
        ("tuned", text.replace(mistuned, "")),
    ):
        (tmp_path / f"{name}.toml").write_text(given)
        assert call("run", tmp_path / f"{name}.toml", "--no-plots", "-q", "--out", tmp_path / name) == 0
        capfd.readouterr()
        assert call("stress", tmp_path / name) == 0
        told = "what no component mode has is that of the tuned sector"
        assert (told in capfd.readouterr().out) == (name == "reduced")
    one, other = (table(tmp_path / name / "driven_gauges.csv")["far_mean"][0] for name in ("reduced", "whole"))
    assert 1e-3 < abs(one / other - 1) < 0.02


def test_all_that_nodes_lack_is_told(tmp_path: Path, capfd) -> None:
    """The note on tuned sectors was left out beside that on a load which an earlier version has not kept."""
    builder = Path(gauged_sector.__file__).read_text()
    (tmp_path / "gauged_sector.py").write_text(
        builder.replace('{"spin": radial[free]}', '{"spin": radial[free], "more": radial[free] / 2}')
    )
    mistuned = 'mistuning = { of = "all", deviations = [0.02, -0.01, 0.0, -0.02, 0.01] }\n'
    response = RESPONSE.format(name="driven", wheel="true").replace("harmonics = 1\n", f"harmonics = 1\n{mistuned}")
    (tmp_path / "case.toml").write_text(CASE + LOADED.replace('["spin"]', '["spin", "more"]') + response)
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    with h5py.File(tmp_path / "run" / "reduction.h5", "r+") as file:
        file["load"][...] = [name.replace(b"more", b"none") for name in file["load"][()]]
    capfd.readouterr()
    assert call("stress", tmp_path / "run") == 0
    told = capfd.readouterr().out
    assert "\n  note: the displacement at rest under more is that of the component modes alone" in told
    assert "\n  note: of the displacement at rest, what no component mode has is that of the tuned sector" in told
