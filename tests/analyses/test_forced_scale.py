"""A forced response where the reference mode is one that the force does not move, against a closed form."""

from __future__ import annotations

import numpy as np
import pytest
from models.solved_case import tables_of
from tolerances import SOLVED

#: A component mode of unit mass (a coordinate in sqrt(mass) length) and beside it a dof in lengths, on one slider.
M, K, KT = 1e-6, 2.0, 0.5


def case(zeta: float) -> str:
    c = 2 * zeta * np.sqrt((K + KT) * M)
    return f"""
[model]
dofs = ["across", "tip"]
M = [[1.0, 0.0], [0.0, {M}]]
K = [[1e5, 0.0], [0.0, {K}]]
C = [[1e-3, 0.0], [0.0, {c!r}]]
[[contact]]
name = "slider"
law = "jenkins"
pairs = ["tip"]
tangential_stiffness = {KT}
friction_limit = 1e9
[[analysis]]
name = "forced"
type = "forced"
harmonics = 1
samples = 32
force = {{ tip = 0.3 }}
levels = [1.0]
frequency = [200.0, 300.0]
observe = "tip"
"""


@pytest.mark.parametrize("zeta", [1e-2, 1e-4, 1e-5])
def test_a_resonance_is_not_taken_for_growth_without_bound(tmp_path_factory, comm, zeta: float) -> None:
    """The peak of a damped oscillator, F / (2 zeta k sqrt(1 - zeta^2)) at omega0 sqrt(1 - 2 zeta^2)."""
    folder = comm.bcast(tmp_path_factory.mktemp("forced") if comm.rank == 0 else None)
    (table,) = tables_of(case(zeta), folder, comm, "forced")
    (peak,) = np.flatnonzero(table["event"] == "peak")
    k = K + KT
    assert table["amplitude"][peak] == pytest.approx(0.3 / (2 * zeta * k * np.sqrt(1 - zeta**2)), rel=SOLVED)
    assert table["omega"][peak] == pytest.approx(np.sqrt(k / M * (1 - 2 * zeta**2)), rel=SOLVED)
    assert table["frequency_hz"][-1] == pytest.approx(300.0, rel=SOLVED)
