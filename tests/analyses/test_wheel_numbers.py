"""Modes of a mistuned wheel by their numbers where the flow, or gyroscopic forces, part forward and backward waves."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from command_line import call
from models.flow_chain import OMEGA, SECTORS, wheel_of

DEVIATIONS = [0.002, -0.004, 0.003, 0.001, -0.002]
FED = {0: 0.02 - 0.06j, 1: -0.1 + 0.02j, -1: 0.12 + 0.05j}
CASES = {
    "fed forward": (FED, 0.0),
    "fed backward": ({-k: L for k, L in FED.items()}, 0.0),
    "gyroscopic": ({0: 0.0j}, 0.05),
}
MODE = f"""
[[analysis]]
name = "mode"
type = "mode"
wheel = true
mistuning = {{ deviations = {DEVIATIONS} }}
normalise = "mass"
harmonics = 1
amplitude = [0.01, 0.02]
errors = false
"""


def stuck(influence, spin: float) -> np.ndarray:
    """lambda of all motions of the wheel, all pairs stuck, by frequency."""
    j, zero, one = np.arange(SECTORS), np.zeros((SECTORS, SECTORS)), np.eye(SECTORS)
    ahead = [np.roll(one, k, axis=1) for k in range(SECTORS)]  # of the mass k places ahead
    K = np.diag(1.0 + np.array(DEVIATIONS)) + 2 * one - ahead[1] - ahead[-1]
    C = spin * (ahead[1] - ahead[-1])
    for k, L in influence.items():
        K[j, (j + k) % SECTORS] -= L.real
        C[j, (j + k) % SECTORS] -= L.imag / OMEGA
    values = np.linalg.eigvals(np.block([[zero, one], [-K, -C]]))
    return np.array(sorted(values[values.imag > 0], key=abs))


@pytest.mark.ranks(1)
@pytest.mark.parametrize("influence, spin", CASES.values(), ids=CASES)
def test_each_number_is_a_motion_of_its_own(tmp_path, influence, spin):
    """Both numbers of a pair began in standing shapes and led to one motion; of the other no number told."""
    path, found = tmp_path / "case.toml", []
    for number in range(1, SECTORS + 1):
        flow = f"aerodynamics = {str(not spin).lower()}\nlinear_mode = {number}\n"
        path.write_text(wheel_of(influence, 0.0, spin) + MODE + flow, encoding="utf-8")
        assert call("run", path, "--out", tmp_path / f"run{number}", "--no-plots", "--quiet") == 0
        with (tmp_path / f"run{number}" / "mode.csv").open(newline="") as file:
            first = next(csv.DictReader(file))
        found.append(complex(-float(first["beta"]), float(first["omega"])))
    assert found == pytest.approx(list(stuck(influence, spin)), rel=1e-6)
