"""`fretwave check` of a forced response under forces of the flow: level of first slip against the linear response."""

from __future__ import annotations

import re

import numpy as np
import pytest
from command_line import call
from models.flow_chain import LIMIT, OMEGA, SECTORS, case_of

#: The flow shifts frequencies by 2 %, of a damping ratio near 0.1 %.
SHIFTS = {0: 0.08 - 0.004j, 1: -0.01 + 0.0005j, -1: 0.01 + 0.0005j}
#: What it does unlike in both directions damps the backward wave, and nothing else does anything.
UNLIKE = {1: -0.01 + 0.0j, -1: 0.01 + 0.0j}
DEVIATIONS = [0.01, -0.02, 0.015, 0.005, -0.01]
CASES = {
    "a sector": (SHIFTS, 1, "", [0.0] * SECTORS),
    "a wheel": (SHIFTS, -1, "wheel = true", [0.0] * SECTORS),
    "a mistuned wheel": (SHIFTS, 1, f"wheel = true\nmistuning = {{ deviations = {DEVIATIONS} }}", DEVIATIONS),
    "damped unlike": (UNLIKE, -1, "", [0.0] * SECTORS),
}


def first_slip(influence, order: int, deviations: list[float]) -> tuple[float, float]:
    """Least level at which a slider reaches its limit while all stick, and its frequency [Hz]: a dense scan."""
    j = np.arange(SECTORS)
    K, C, B = np.diag(1.0 + np.array(deviations)), np.zeros((SECTORS, SECTORS)), np.zeros((SECTORS, SECTORS))
    B[j, j], B[j, (j + 1) % SECTORS] = -1.0, 1.0
    K = K + B.T @ B
    for k, L in influence.items():
        K[j, (j + k) % SECTORS] -= L.real
        C[j, (j + k) % SECTORS] -= L.imag / OMEGA
    force, hertz = np.exp(-2j * np.pi * order * j / SECTORS), np.linspace(0.2, 0.3, 20001)
    omega = 2 * np.pi * hertz[:, None, None]
    X = np.linalg.solve(K + 1j * omega * C - omega**2 * np.eye(SECTORS), force[None, :, None])
    stretched = np.abs(B @ X)[:, :, 0].max(axis=1)
    return LIMIT / stretched.max(), hertz[np.argmax(stretched)]


@pytest.mark.ranks(1)
@pytest.mark.parametrize("influence, order, keys, deviations", CASES.values(), ids=CASES)
def test_first_slip_is_expected_where_the_response_under_the_flow_peaks(
    tmp_path, capfd, influence, order, keys, deviations
):
    """It was looked for at frequencies without the flow: three times the level and `no level is expected to slip`."""
    path = tmp_path / "case.toml"
    path.write_text(case_of(influence, order, f"aerodynamics = true\n{keys}"), encoding="utf-8")
    assert call("check", path) == 0
    said = capfd.readouterr().out
    found = re.search(r"first slip expected at level (\S+) \((\S+) Hz", said)
    assert found, said
    assert [float(text) for text in found.groups()] == pytest.approx(first_slip(influence, order, deviations), rel=5e-3)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("keys, said", [("", 1), ("aerodynamics = true", 0)], ids=["without", "with"])
def test_it_is_said_that_the_flow_is_left_out(tmp_path, capfd, keys: str, said: int) -> None:
    """As the run's last words say it."""
    (tmp_path / "case.toml").write_text(case_of(SHIFTS, 1, keys), encoding="utf-8")
    assert call("check", tmp_path / "case.toml", "--no-solve") == 0
    assert capfd.readouterr().out.count("    left out: the forces of the flow (aerodynamics = false)\n") == said
