"""What a run says of a case with forces of the flow: where they are left out, and of bounds that they break."""

from __future__ import annotations

import re

import numpy as np
import pytest
from command_line import call
from models.flow_chain import OMEGA, SECTORS, case_of, wheel_of

from fretwave.case.load import load_case
from fretwave.errors import CaseErrors

DEVIATIONS = [-0.14, -0.21, -0.12, -0.37, -0.14]
RATIOS = {-2: 0.01, -1: 0.01, 0: 0.01, 1: 0.06, 2: 0.01}
#: Waves other than the driven one are damped less.
FLOW = {
    k: complex(np.mean([-2j * RATIOS[d] * OMEGA**2 * np.exp(2j * np.pi * k * d / SECTORS) for d in RATIOS]))
    for k in RATIOS
}


def amplification() -> float:
    """Largest amplitude of the mistuned chain over that of the tuned one, all pairs stuck: a dense scan."""
    j, one = np.arange(SECTORS), np.eye(SECTORS)
    K, C = 3 * one - np.roll(one, 1, axis=1) - np.roll(one, -1, axis=1), np.zeros((SECTORS, SECTORS))
    for k, L in FLOW.items():
        K[j, (j + k) % SECTORS] -= L.real
        C[j, (j + k) % SECTORS] -= L.imag / OMEGA
    omega, force = 2 * np.pi * np.linspace(0.2, 0.35, 12001)[:, None, None], np.exp(-2j * np.pi * j / SECTORS)
    Z = K + 1j * omega * C - omega**2 * one
    after, before = (np.linalg.solve(Z + np.diag(own), force[None, :, None]) for own in (DEVIATIONS, np.zeros(SECTORS)))
    return float(np.abs(after).max() / np.abs(before).max())


@pytest.mark.ranks(1)
def test_an_amplification_beyond_whitehead_is_no_contradiction(tmp_path, capfd):
    keys = f"aerodynamics = true\nwheel = true\nmistuning = {{ deviations = {DEVIATIONS} }}"
    path, bound = tmp_path / "case.toml", (1 + np.sqrt(SECTORS)) / 2
    wide = case_of(FLOW, 1, keys).replace("[1e-4, 10.0]", "[1e-4]").replace("[0.2, 0.3]", "[0.2, 0.35]")
    path.write_text(wide, encoding="utf-8")
    assert call("run", path, "--out", tmp_path / "run", "--no-plots") == 0
    said = capfd.readouterr().out
    found = re.search(r"in sector \d, (\S+) times the tuned .* \(Whitehead's bound 1.618 is of waves that", said)
    assert found and float(found.group(1)) == pytest.approx(amplification(), rel=1e-3), said
    assert amplification() > bound


LINEAR = """
[[analysis]]
name = "linear"
type = "linear"
modes = 1
"""


@pytest.mark.ranks(1)
@pytest.mark.parametrize("flow", [True, False], ids=["with flow", "without"])
def test_forces_of_the_flow_that_do_not_act_are_told_as_left_out(tmp_path, capfd, flow):
    path = tmp_path / "case.toml"
    path.write_text(case_of(FLOW, 1, f"aerodynamics = {str(flow).lower()}", 0.05), encoding="utf-8")
    assert call("run", path, "--out", tmp_path / "run", "--no-plots") == 0
    assert ("the forces of the flow (aerodynamics = false)" in capfd.readouterr().out) == (not flow)


@pytest.mark.ranks(1)
def test_linear_modes_are_told_to_be_without_the_flow(tmp_path, capfd):
    path = tmp_path / "case.toml"
    path.write_text(wheel_of(FLOW) + LINEAR, encoding="utf-8")
    assert call("run", path, "--out", tmp_path / "run", "--no-plots") == 0
    assert 'the forces of the flow (type = "linear" has none)' in capfd.readouterr().out


MODE = '[[analysis]]\nname = "mode"\ntype = "mode"\nnormalise = "mass"\namplitude = [0.2, 1.0]\nharmonics = 1\n'
ACTS = "aerodynamics = true\n"
ASKED = {
    "mode": (f"{wheel_of({})}{MODE}{ACTS}nodal_diameter = 2\n", "2"),
    "forced": (case_of({}, 2, ACTS), "2"),
    "mistuned": (case_of({}, 1, f"{ACTS}wheel = true\nmistuning = {{ standard_deviation = 0.01 }}"), "-2, 0, 2"),
    "damped": (case_of({}, 4, ACTS), ""),
    "without flow": (case_of({}, 2), ""),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("text, missing", ASKED.values(), ids=ASKED)
def test_a_wave_without_damping_is_asked_for_by_every_analysis(tmp_path, text, missing):
    """The flow did nothing to it, and nothing was said."""
    path = tmp_path / "case.toml"
    path.write_text(text.replace("influence = {  }", "damping = { 1 = -0.01, -1 = 0.02 }"), encoding="utf-8")
    if not missing:
        assert load_case(path).aerodynamics.damping == {"1": -0.01, "-1": 0.02}
        return
    with pytest.raises(CaseErrors, match=f"damping of nodal diameters {missing} in"):
        load_case(path)


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    "keys",
    [f"{ACTS}nodal_diameter = 1", f"{ACTS}nodal_diameter = 1\nwheel = true", "nodal_diameter = 1"],
    ids=["a wave", "a wheel", "no flow"],
)
def test_a_mode_in_one_wave_tells_that_others_are_not_looked_at(tmp_path, capfd, keys):
    path = tmp_path / "case.toml"
    path.write_text(f"{wheel_of(FLOW)}{MODE.replace('1.0]', '0.3]')}{keys}\n", encoding="utf-8")
    assert call("run", path, "--out", tmp_path / "run", "--no-plots") == 0
    told = "against waves of other nodal diameters" in capfd.readouterr().out
    assert told == (ACTS in keys and "wheel" not in keys)
