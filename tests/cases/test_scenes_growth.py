"""The judge's walk from a linear mode, pieces of a branch side by side, and turning points next to one another."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "cases"))

from scenes import laws, path  # noqa: E402
from scenes.distance import Distance  # noqa: E402
from scenes.equations import Equations  # noqa: E402
from scenes.growth import grown  # noqa: E402
from scenes.judge import Run  # noqa: E402
from scenes.scene import Scene  # noqa: E402
from scenes.structures import mode  # noqa: E402

pytestmark = pytest.mark.ranks(1)


def table(eq, states):
    """A run of the complex mode with these states."""
    Q, beta, omega = (np.array([state[i] for state in states]) for i in range(3))
    k = eq.column[1]
    columns = {
        "amplitude": np.hypot(Q[:, eq.dof, k], Q[:, eq.dof, k + 1]),
        "omega": omega,
        "omega0": np.hypot(beta, omega),
        "beta": beta,
        "zeta": beta / np.hypot(beta, omega),
    }
    scene = Scene("test", "grown", eq.M, eq.K, [], mode("CNM", 1, 8, (1.0, 2.0)))
    return Run(scene, columns, Q, eq, "CNM")


def test_pieces_of_a_branch_side_by_side_are_not_retraced_and_the_same_piece_is(monkeypatch):
    """omega = 2 + d x out, omega = 2 - d x back, x = log a: two pieces that meet at a fold, all points solutions."""
    eq = Equations(np.eye(1), np.eye(1), None, [], [1], "CNM")
    out, back = np.arange(-1.5, 0.0, 0.1), np.arange(-0.05, -1.5, -0.1)
    for apart in (1e-3, 0.0):

        def state(x, side, apart=apart):
            return np.array([[np.exp(x), side * apart * x]]), 0.1, 2 + side * apart * x

        def on_its_piece(_, Q, beta, omega):
            x = float(np.log(Q[0, 0]))
            return Distance(0, 0, 0, 0, True, state(x, 1))

        monkeypatch.setattr(path, "distance", on_its_piece)
        run = table(eq, [state(x, 1) for x in out] + [state(x, -1) for x in back])
        assert bool(path.retraced(run)) == (apart == 0)


def test_a_first_row_of_another_mode_is_told_by_the_walk_from_the_linear_one():
    """A cubic-free chain of two: its modes do not change with amplitude, so row 0 is right or of the other mode."""
    K = np.array([[2.0, -1.0], [-1.0, 3.0]])
    eq = Equations(np.eye(2), K, None, [], [1], "CNM")
    squares, shapes = np.linalg.eigh(K)
    scene = Scene("test", "grown", eq.M.toarray(), K, [], mode("CNM", 1, 8, (1.0, 2.0)))

    def run(which):
        shape = shapes[:, which] / shapes[0, which]
        Q = np.column_stack([shape, 0 * shape])
        return dataclasses.replace(table(eq, [(Q, 0.0, np.sqrt(squares[which]))]), scene=scene)

    assert not grown()(run(0))
    assert any("grown" in line for line in grown()(run(1)))


def test_two_roots_next_to_one_another_are_both_found():
    """1 + d - cos(tau - c) has none for d > 0 and two at c +- acos(1 + d) for d < 0."""
    c, m = 2.1, 8
    for apart in (1e-2, 1e-4, 1e-6):
        roots = laws._roots(lambda t, a=apart: np.cos(a) - np.cos(t - c), m)
        assert roots == pytest.approx([c - apart, c + apart], rel=1e-9 / apart)
    assert not len(laws._roots(lambda t: 1 + 1e-12 - np.cos(t - c), m))


def test_a_slider_stiffer_than_double_precision_tells_has_its_friction_force():
    """kt 1e14 on u = 0.3 cos tau + 0.1: reach 1e-14, all but rigid; 4 limit / pi, a quarter of a period behind u."""
    waves = lambda tau: np.array([np.ones_like(tau), np.cos(tau), np.sin(tau)]).T  # noqa: E731
    motion = np.array([[0.1], [0.3], [0.0]], complex)
    rates = np.array([[0.0], [0.0], [-0.3]], complex)
    force = laws.jenkins(motion, rates, 1e14, 1.0, waves)[:, 0].real / np.pi
    assert force[2] == pytest.approx(-4 / np.pi, rel=1e-10)
    assert abs(force[0]) < 1e-8 and abs(force[1]) < 1e-6
