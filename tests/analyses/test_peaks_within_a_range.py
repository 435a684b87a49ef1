"""What is said of a response's peaks where it moves more at an end of the frequency range, against a closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import call
from scipy.optimize import minimize_scalar

pytestmark = pytest.mark.ranks(1)

#: Two equal masses: modes of 1 and sqrt(3) rad/s, and a contact that never slips.
K, C, KT = np.array([[2.0, -1.0], [-1.0, 2.0]]), 0.02, 1e-3
CASE = f"""
[model]
dofs = ["a", "b"]
M = [[1.0, 0.0], [0.0, 1.0]]
K = {K.tolist()}
mass_damping = {C}
[[contact]]
name = "slider"
law = "jenkins"
pairs = ["b"]
tangential_stiffness = {KT}
friction_limit = 1e9
[[analysis]]
name = "forced"
type = "forced"
harmonics = 1
force = {{ a = 1.0 }}
levels = [1.0]
frequency = [1.0, 2.0]
observe = "b"
"""


def amplitude(hertz: float) -> float:
    w = 2 * np.pi * hertz
    Z = K + np.diag([0.0, KT]) + (1j * w * C - w**2) * np.eye(2)
    return float(abs(np.linalg.solve(Z, [1.0, 0.0])[1]))


@pytest.mark.parametrize("low, high, peaks", [(0.161, 0.32, 1), (0.161, 0.22, 0), (0.1, 0.32, 2)])
def test_a_response_that_is_larger_at_an_end(tmp_path: Path, capfd, low: float, high: float, peaks: int) -> None:
    """It was said to have no peak, beside the line of one."""
    file = tmp_path / "case.toml"
    file.write_text(CASE, encoding="utf-8")
    assert call("run", file, "--no-plots", "--out", tmp_path / "run", "--set", f"forced.frequency=[{low}, {high}]") == 0
    (line,) = (text for text in capfd.readouterr().out.splitlines() if text.startswith("forced: level 1: "))
    around = (0.25, 0.3) if peaks < 2 else (0.14, 0.18)
    peak = minimize_scalar(lambda x: -amplitude(x), bounds=around, method="bounded", options={"xatol": 1e-10})
    within = f"{amplitude(peak.x):.4g} m at {peak.x:.5g} Hz"
    ends = f"a = {amplitude(low):.4g} m at {low:g} Hz: the peak is beyond (largest within it {within})"
    wanted = {0: "no peak within the frequency range", 1: ends, 2: f"at {peak.x:.5g} Hz"}[peaks]
    assert line.endswith(wanted), (line, wanted)
