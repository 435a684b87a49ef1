"""What `type = "linear"` says of a C with a gyroscopic part: by how much it moves the frequencies that are told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tolerances import ROUNDING

from fretwave.analyses.parts.gyroscopic import gyroscopic_lines, gyroscopic_shift
from fretwave.cyclic.sector import Sector
from fretwave.model.modes import linear_modes
from fretwave.run.order import RunOptions
from fretwave.run.runner import run_case

#: A mass on equal springs along x and y in a turning frame: w = sqrt(k / m + Omega^2) +- Omega (Foucault's pendulum).
SPRING, SPEED = 100.0, 0.5
CASE = """
[model]
dofs = ["x", "y"]
M = [[1.0, 0.0], [0.0, 1.0]]
K = [[100.0, 0.0], [0.0, 100.0]]
C = [[0.2, {minus}], [{plus}, 0.2]]

[[analysis]]
name = "linear"
type = "linear"
modes = 2
"""


@pytest.mark.parametrize(("minus", "plus", "said"), [(-1.0, 1.0, True), (0.1, 0.1, False)])
def test_it_is_said_by_how_much(shared_tmp: Path, comm, minus: float, plus: float, said: bool) -> None:
    path, out = shared_tmp / "case.toml", shared_tmp / "run"
    if comm.rank == 0:
        path.write_text(CASE.format(minus=minus, plus=plus))
    comm.barrier()
    assert run_case(path, RunOptions(out=out, plots=False), comm) == 0
    comm.barrier()
    share = np.sqrt(1 + SPEED**2 / SPRING) + SPEED / np.sqrt(SPRING) - 1
    assert (f"it moves their frequencies by up to {100 * share:.2g} %" in (out / "run.log").read_text()) == said


def drawn(seed: int, sectors: int, n: int) -> Sector:
    """A sector with random terms to its neighbours, and a C of which all is gyroscopic."""
    random = np.random.default_rng(seed)
    link, own = random.normal(size=(n, n)), random.normal(size=(n, n))
    turn, beside = random.normal(size=(2, n, n))
    K = {0: 100 * np.eye(n) + own @ own.T + 20 * np.eye(n), 1: link, -1: link.T}
    return Sector(np.eye(n), K, sectors, {0: turn - turn.T, 1: beside, -1: -beside.T})


def moved(M: np.ndarray, K: np.ndarray, C: np.ndarray) -> float:
    """From all eigenvalues of s^2 M + s C + K, and of it without C."""
    n = len(M)
    s = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))
    without = np.sqrt(np.linalg.eigvalsh(K))  # M is 1
    return float(np.max(np.abs(np.sort(s.imag[s.imag > 0]) / without - 1)))


@pytest.mark.parametrize("diameters", [0, 1, -2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_all_modes_of_a_wave_give_it_exactly(comm, seed: int, diameters: int) -> None:
    sector, theta = drawn(seed, 6, 3), 2 * np.pi * diameters / 6
    with sector.model(diameters, comm) as model:
        modes = linear_modes(model, 3, "free")
    M, K, C = (
        sum(A * np.exp(-1j * k * theta) for k, A in term.items()) for term in ({0: sector.M}, sector.K, sector.C)
    )
    assert gyroscopic_shift(modes, sector.C, theta) == pytest.approx(moved(M, K, C), rel=ROUNDING)


def of_wheel(term: Callable[[int], np.ndarray]) -> np.ndarray:
    return np.block([[term((j - i + 1) % 6 - 1) for j in range(6)] for i in range(6)])


def test_all_modes_of_a_wheel_give_it_exactly(comm) -> None:
    sector = drawn(7, 6, 2)
    K, C = (of_wheel(lambda k, term=term: term.get(k, np.zeros((2, 2)))) for term in (sector.K, sector.C))
    with sector.wheel(comm) as model:
        modes = linear_modes(model, 12, "free")
    assert gyroscopic_shift(modes, C) == pytest.approx(moved(np.eye(12), K, C), rel=ROUNDING)


def test_rounding_is_not_told() -> None:
    assert gyroscopic_lines("linear", 1e-9) == [] and gyroscopic_shift([], np.eye(2)) == 0.0
