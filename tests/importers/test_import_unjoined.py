"""Stiffness that holds the contact already, and what else joins the nodes of pairs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from models.two_bars import Two

from fretwave.commands.main import main

pytestmark = pytest.mark.ranks(1)


def springs_of(two: Two, ends: list[tuple[int, int]]) -> sp.csr_matrix:
    """Springs of 1 along x between nodes of LEFT and of RIGHT, which are a pair where they have one number."""
    first, second = (3 * (two.sets[name] - 1) for name in ("LEFT", "RIGHT"))
    way = np.zeros((len(ends), two.K.shape[0]))
    for row, (a, b) in enumerate(ends):
        way[row, first[a]], way[row, np.flip(second)[b]] = 1.0, -1.0
    return sp.csr_matrix(way.T @ way)


@pytest.mark.parametrize("share", [1.0, 1e-3, 1e-5])
@pytest.mark.parametrize("reduced", [False, True])
def test_stiffness_that_holds_the_contact(
    share: float, reduced: bool, tmp_path: Path, capfd: pytest.CaptureFixture
) -> None:
    """Springs between the sides are contact, unless they are weak, or M joins the sides as a reduction does."""
    two = Two()
    springs = springs_of(two, [(k, k) for k in range(6)])
    two.K = sp.csr_matrix(two.K + share * two.K.diagonal().max() * springs)
    if reduced:
        two.M = sp.csr_matrix(two.M + 1e-9 * two.M.diagonal().max() * springs)
    status = main([*two.write(tmp_path, True), "--pairs", "joint=LEFT", "RIGHT"])
    said = capfd.readouterr().err
    if share < 1e-4 or reduced:
        assert status == 0 and not said
    else:
        assert status == 2 and "the stiffness holds the contact 'joint' already" in said
        assert "both sides of 6 of 6 pairs" in said and said.count("fix:") == 1 and not (tmp_path / "m.h5").exists()


#: Pairs of nodes that K joins, and whether M is lumped: a bolt, one body reduced to these nodes, and its lumped mass.
RIGHT = {
    "a bolt": ([(2, 2)], False),
    "two bolts": ([(2, 2), (4, 4)], False),
    "all with all": ([(a, b) for a in range(6) for b in range(6)], False),
    "lumped mass": ([(k, k) for k in range(6)], True),
}


@pytest.mark.parametrize("form", RIGHT)
def test_stiffness_that_joins_the_sides_otherwise(form: str, tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """Said, not refused: bolts join few pairs, a reduction joins nodes that are none, and a lumped M joins nothing."""
    two = Two()
    ends, lumped = RIGHT[form]
    two.K = sp.csr_matrix(two.K + two.K.diagonal().max() * springs_of(two, ends))
    if lumped:
        two.M = sp.diags(np.asarray(two.M.sum(axis=1)).ravel(), format="csr")
    assert main([*two.write(tmp_path, True), "--pairs", "joint=LEFT", "RIGHT"]) == 0
    said = capfd.readouterr()
    (line,) = [line for line in said.out.splitlines() if "does the stiffness hold the contact already?" in line]
    joined = len({a for a, b in ends if a == b})
    assert line.startswith(f"warning: contact 'joint': K joins both sides of {joined} of 6 pairs") and not said.err


def test_half_of_the_pairs(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """Contact that opens elsewhere."""
    two = Two()
    two.K = sp.csr_matrix(two.K + two.K.diagonal().max() * springs_of(two, [(k, k) for k in range(3)]))
    assert main([*two.write(tmp_path, True), "--pairs", "joint=LEFT", "RIGHT"]) == 2
    assert "both sides of 3 of 6 pairs" in capfd.readouterr().err
