"""The state at rest under a load: coefficients of the flow are of vibrations, and do not move it."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from command_line import call
from tolerances import SOLVED

SECTORS, LOAD, KN, KT = 5, [0.1, 4.0], 5.0, 3.0
DEVIATIONS = [0.01, -0.02, 0.03, 0.0, -0.02]
#: A mass in two directions, joined by a spring and pressed on a pad; a quarter of its stiffness is the flow's.
TEXT = f"""
[model]
dofs = ["x", "y", "nx", "ny"]
M = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
K = [[1.2, -0.3, -0.2, 0], [-0.3, 1.0, 0, 0], [-0.2, 0, 0.2, 0], [0, 0, 0, 0]]
sectors = {SECTORS}
low = ["x", "y"]
high = ["nx", "ny"]
speed_rpm = 60.0
loads_at_speed = {{ f = {{ 60 = {[*LOAD, 0.0, 0.0]} }} }}

[preload]
loads = ["f"]
pair_loads = false

[[contact]]
name = "pad"
law = "coulomb_2d"
pairs = ["y"]
tangents = ["x"]
normal_stiffness = {KN}
tangential_stiffness = {KT}
friction_coefficient = 0.5

[aerodynamics]
frequency = 0.3
influence = {{ 0 = [0.2, 0.01], 1 = [0.1, 0.0], -1 = [-0.05, 0.0] }}

[[analysis]]
name = "mode"
type = "mode"
aerodynamics = true
normalise = "x"
nodal_diameter = 1
harmonics = 2
amplitude = [0.001, 0.002]
errors = false
"""
KEYS = {
    "a sector": "",
    "a wheel": "wheel = true\n",
    "a mistuned wheel": f"wheel = true\nmistuning = {{ deviations = {DEVIATIONS} }}\n",
}


@pytest.mark.parametrize("keys", KEYS.values(), ids=KEYS)
@pytest.mark.parametrize("own", [0.2, 0.8])
def test_the_flow_does_not_move_the_state_at_rest(shared_tmp, comm, keys, own):
    """Displacements were those of K - sum_k Re L_k M; the mean of a small vibration is the state at rest.

    With 0.8 that matrix without contact is not positive: from zero the structure goes to another equilibrium.
    """
    path, out = shared_tmp / "case.toml", shared_tmp / "run"
    if comm.rank == 0:
        path.write_text(TEXT.replace("0 = [0.2,", f"0 = [{own},") + keys, encoding="utf-8")
    comm.barrier()
    assert call("run", path, "--out", out, "--no-plots", "--quiet") == 0
    K = stiffness(1 + np.array(DEVIATIONS if "mistuning" in keys else np.zeros(SECTORS)))
    expected = np.linalg.solve(K + np.kron(np.eye(SECTORS), np.diag([KT, KN])), np.tile(LOAD, SECTORS))
    with h5py.File(out / "results.h5") as file:
        labels = [label.decode() for label in file["mode/harmonic"][()]]
        rest, mean = file["mode/rest_displacement"][()], file["mode/coefficients"][0, :, labels.index("0")]
    assert rest == pytest.approx(expected[: len(rest)], rel=SOLVED)
    assert mean == pytest.approx(rest, rel=SOLVED)


def stiffness(factors: np.ndarray) -> np.ndarray:
    """Stiffness of the wheel whose sectors, as they were cut, have these factors."""
    own = np.array([[1.2, -0.3, -0.2, 0], [-0.3, 1.0, 0, 0], [-0.2, 0, 0.2, 0], [0, 0, 0, 0]])
    K = np.zeros((2 * SECTORS, 2 * SECTORS))
    for j, factor in enumerate(factors):
        places = [2 * j, 2 * j + 1, *(2 * ((j + 1) % SECTORS) + np.arange(2))]
        K[np.ix_(places, places)] += factor * own
    return K
