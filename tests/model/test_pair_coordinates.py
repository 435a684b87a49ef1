"""Pairs as coordinates: an exact change of variables, in which a reduction keeps the pairs' rows alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from models.hexahedra import bar
from tolerances import REPEATED, ROUNDING

import fretwave as fw


def means():
    """A bar of 6 x 2 x 2 cells, held softly at one end; two pairs take the means over the halves of its lower face, and
    one row of nodes is in both."""
    given = bar((6, 2, 2), (0.06, 0.02, 0.02))
    springs = np.zeros(given.K.shape[0])
    springs[given.layer(0.0)] = 1e7
    lower = np.flatnonzero(given.nodes[:, 2] == 0)
    x = given.nodes[lower, 0]
    rows = []
    for inside in (x <= 0.031, x >= 0.029):
        weights = np.zeros(len(given.nodes))
        weights[lower[inside]] = 1 / np.count_nonzero(inside)
        rows.append(np.kron(weights, np.eye(3)[[2, 0, 1]]))
    top = int(np.flatnonzero((given.nodes == [0.06, 0.02, 0.02]).all(axis=1))[0])
    load = np.zeros(given.K.shape[0])
    load[3 * top + 1] = 7.0
    pairs = {"floor": fw.Pairs(np.vstack(rows))}
    return fw.Structure(
        given.M,
        given.K + sp.diags(springs),
        dofs={"top": 3 * top},
        pairs=pairs,
        loads={"side": load},
        coordinates=given.nodes,
    )


def stuck(structure):
    B = sp.csr_matrix(structure.pairs["floor"].B)
    return (sp.csr_matrix(structure.K) + 1e9 * B.T @ B).toarray()


def test_it_is_the_same_structure_in_other_coordinates():
    one = means()
    other = fw.on_pair_coordinates(one)
    B, T = other.pairs["floor"].B, other.expansion
    assert B.nnz == 6 and (B.data == 1.0).all() and len(other.kept) == 7 < len(one.kept)
    assert abs(one.pairs["floor"].B @ T - B).max() < ROUNDING
    frequencies = [la.eigh(stuck(s), s.M.toarray(), eigvals_only=True)[:12] for s in (one, other)]
    assert frequencies[1] == pytest.approx(frequencies[0], rel=REPEATED)
    x, z = (la.solve(stuck(s), s.loads["side"]) for s in (one, other))
    assert abs(T @ z - x).max() < REPEATED * abs(x).max()
    assert z[one.dofs["top"]] == pytest.approx(x[one.dofs["top"]], rel=REPEATED)
    assert other.resultant(["side"]) == pytest.approx([0.0, 7.0, 0.0])


def test_a_reduction_keeps_the_pairs_alone(comm):
    other = fw.on_pair_coordinates(means())
    with fw.reduce(other.M, other.K, keep=other.kept, modes=100, comm=comm) as reduction:
        small = other.reduced(reduction)
        assert reduction.size == 107
        reduced = la.eigh(stuck(small), sp.csr_matrix(small.M).toarray(), eigvals_only=True)[:3]
    full = la.eigh(stuck(other), other.M.toarray(), eigvals_only=True)[:3]
    assert (reduced >= full * (1 - REPEATED)).all() and reduced == pytest.approx(full, rel=1e-3)


@pytest.mark.ranks(1)
def test_what_cannot_be_made_coordinates_is_refused():
    one = means()
    rows = one.pairs["floor"].B
    twice = replace(one, pairs={"floor": fw.Pairs(np.vstack([rows, rows[:3]]))})
    with pytest.raises(fw.InputError, match="not as many dofs of its own as it has rows"):
        fw.on_pair_coordinates(twice)
    with pytest.raises(fw.InputError, match="plain structures alone"):
        fw.on_pair_coordinates(fw.on_pair_coordinates(one))
