"""Rows of the matrices that are of other nodes than those that are named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from models import hexahedra
from models.matrix_files import write_npz

from fretwave.commands.main import main

pytestmark = pytest.mark.ranks(1)

Labels = list[tuple[int, int]]
#: Number of the first node.
FIRST = 51
#: Slips with the table of dofs.
TABLES: dict[str, Callable[[Labels], Labels]] = {
    "nodes sorted as words": lambda labels: sorted(labels, key=lambda label: (str(label[0]), label[1])),
    "nodes counted from one less": lambda labels: [(node - 1, direction) for node, direction in labels],
    "direction by direction": lambda labels: sorted(labels, key=lambda label: label[::-1]),
    "z, y, x": lambda labels: [(node, 4 - direction) for node, direction in labels],
    "backwards": lambda labels: labels[::-1],
}
#: Slips with the coordinates (n, 3).
PLACES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "y, x, z": lambda points: points[:, [1, 0, 2]],
    "mirrored": lambda points: points * [1, 1, -1],
    "of other nodes": lambda points: np.roll(points, 7, axis=0),
    "one axis in other units": lambda points: points * [1, 1, 1e3],
}


class Skew:
    """A bar held at its end, turned aslant as a whole: matrices of the free dofs, nodes, and labels."""

    def __init__(self, length: float = 0.06) -> None:
        self.bar = hexahedra.bar((7, 3, 2), (length, 0.02, 0.01))
        self.turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
        self.turn *= np.linalg.det(self.turn)
        self.free = np.setdiff1d(np.arange(self.bar.K.shape[0]), self.bar.layer(0.0))
        T = sp.kron(sp.identity(len(self.bar.nodes)), self.turn).tocsr()
        self.M, self.K = ((T @ A @ T.T).tocsr()[self.free][:, self.free] for A in (self.bar.M, self.bar.K))
        self.points = self.bar.nodes @ self.turn.T
        self.labels = [(dof // 3 + FIRST, dof % 3 + 1) for dof in self.free.tolist()]

    def cells(self) -> list[list[int]]:
        number = np.arange(FIRST, FIRST + 96).reshape(8, 4, 3)
        square = ((0, 0), (1, 0), (1, 1), (0, 1))
        boxes = [(i, j, k) for i in range(7) for j in range(3) for k in range(2)]
        return [[int(number[i + a, j + b, k + c]) for c in (0, 1) for a, b in square] for i, j, k in boxes]

    def command(self, folder: Path, labels: Labels, points: np.ndarray, deck: bool, K: sp.spmatrix) -> list[str]:
        parts = [write_npz(folder, sp.csr_matrix(A), letter, np.zeros(0)) for letter, A in (("M", self.M), ("K", K))]
        (folder / "dofs.csv").write_text("".join(f"{node},{direction}\n" for node, direction in labels))
        rows = "".join(f"{n},{x!r},{y!r},{z!r}\n" for n, (x, y, z) in enumerate(points.tolist(), FIRST))
        cells = "".join(f"{e},{','.join(map(str, cell))}\n" for e, cell in enumerate(self.cells(), 1))
        nodes = folder / ("n.inp" if deck else "n.csv")
        nodes.write_text(f"*NODE\n{rows}*ELEMENT, TYPE=C3D8\n{cells}" if deck else rows)
        named = ["--dofs", str(folder / "dofs.csv"), "--coordinates", str(nodes)]
        return ["import", str(folder / "m.h5"), "--mass", parts[0], "--stiffness", parts[1], *named]


@pytest.fixture(scope="module")
def skew() -> Skew:
    return Skew()


@pytest.mark.parametrize("deck", [True, False], ids=["elements", "nodes"])
@pytest.mark.parametrize("slip", [*TABLES, *PLACES])
def test_rows_of_other_nodes(skew: Skew, slip: str, deck: bool, tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """Refused where elements tell what a held node is joined to; said where nodes are known alone."""
    labels = TABLES[slip](skew.labels) if slip in TABLES else skew.labels
    points = PLACES[slip](skew.points) if slip in PLACES else skew.points
    status = main(skew.command(tmp_path, labels, points, deck, skew.K))
    said = capfd.readouterr()
    assert "K resists a turn of the whole body at" in said.err + said.out
    if deck:
        assert status == 2 and said.err.count("fix:") == 1 and "--dofs FILE" in said.err
        assert "rows of the matrices are not of the nodes" in said.err and not (tmp_path / "m.h5").exists()
    else:
        assert "are these the nodes and directions of its rows?" in said.out


@pytest.mark.parametrize("deck", [True, False], ids=["elements", "nodes"])
@pytest.mark.parametrize("more", ["nothing", "springs to the ground", "spin softening", "prestress"])
def test_rows_of_the_nodes(skew: Skew, more: str, deck: bool, tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """Nothing is said of right ones in any order, of what holds nodes elsewhere, of K - Omega^2 M and of prestress."""
    added = {
        "nothing": 0.0 * skew.M,
        "springs to the ground": sp.diags(np.linspace(0.2, 3, skew.K.shape[0]) * skew.K.diagonal()),
        "spin softening": -((2e3) ** 2) * skew.M,
        # sigma / E = 0.005 along the axes: a string's stiffness, which gives no force in a uniform motion alone
        "prestress": 0.005 * sp.kron(sp.csr_matrix(skew.K)[::3, ::3], sp.identity(3)),
    }[more]
    order = np.random.default_rng(5).permutation(len(skew.labels))
    turned, labels = Skew(), [skew.labels[k] for k in order]
    turned.M = skew.M[order][:, order]
    K = sp.csr_matrix(skew.K + added)[order][:, order]
    assert main(turned.command(tmp_path, labels, skew.points, deck, K)) == 0
    assert "K resists" not in capfd.readouterr().out


def springs(skew: Skew, ends: list[tuple[int, int]]) -> sp.spmatrix:
    """Stiffness of springs along x alone between places of nodes, which resist a turn where x is not their axis."""
    row = {label: number for number, label in enumerate(skew.labels)}
    way = np.zeros((len(ends), skew.K.shape[0]))
    for number, (a, b) in enumerate(ends):
        way[number, row[a + FIRST, 1]], way[number, row[b + FIRST, 1]] = 1.0, -1.0
    return sp.csr_matrix(skew.K.diagonal().max() * way.T @ way)


def imported(skew: Skew, folder: Path, K: sp.spmatrix, deck: Callable[[str], str] = str) -> int:
    command = skew.command(folder, skew.labels, skew.points, True, K)
    (folder / "n.inp").write_text(deck((folder / "n.inp").read_text()))
    return main(command)


def without_first_layer(text: str) -> str:
    """The elements that join the held nodes are others' than the deck's."""
    return "".join(line for line in text.splitlines(keepends=True) if line[:2] not in [f"{e}," for e in range(1, 7)])


#: Places of nodes in one cell, a layer of 12 apart; and two layers apart.
NEAR, FAR = [(n, n + 13) for n in range(12, 60, 3)], [(n, n + 24) for n in range(24, 34)]
#: Springs in K, the deck, and what it is that the deck does not name or the importer does not read.
PART: dict[str, tuple[list[tuple[int, int]], Callable[[str], str]]] = {
    "springs across cells": (FAR, str),
    "cells": ([], without_first_layer),
    "few springs": (NEAR[:2], str),
    "elements that are not read": (NEAR, lambda text: f"{text}*ELEMENT, TYPE=SPRING2\n99,63,76\n"),
    "joined nodes": (NEAR, lambda text: f"{text}*MPC\nBEAM,63,76\n"),
}


@pytest.mark.parametrize("part", PART)
def test_a_deck_of_a_part_of_the_model(skew: Skew, part: str, tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """Right models: what turns with the deck's cells is less than what K holds."""
    ends, deck = PART[part]
    skew = Skew(0.02) if part == "cells" else skew  # thin, so that all of a layer feel the next one
    assert imported(skew, tmp_path, skew.K + springs(skew, ends), deck) == 0
    said = capfd.readouterr()
    assert "warning: K resists a turn of the whole body at" in said.out and not said.err


def test_a_skin_of_a_superelement(skew: Skew, tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """Reduced statically to a face, which shells show: each node feels those that are held."""
    top = np.arange(96).reshape(8, 4, 3)[:, :, 2]
    kept = np.flatnonzero([node - FIRST in top for node, _ in skew.labels])
    inside = np.setdiff1d(np.arange(len(skew.labels)), kept)
    G = np.zeros((len(skew.labels), len(kept)))
    G[kept, np.arange(len(kept))] = 1.0
    K = skew.K.toarray()
    G[inside] = -np.linalg.solve(K[np.ix_(inside, inside)], K[np.ix_(inside, kept)])
    part = Skew()
    part.M, part.labels = sp.csr_matrix(G.T @ skew.M @ G), [skew.labels[dof] for dof in kept]
    faces = [top[i : i + 2, j : j + 2].ravel()[[0, 1, 3, 2]] + FIRST for i in range(7) for j in range(3)]
    shells = "".join(f"{e},{','.join(map(str, face))}\n" for e, face in enumerate(faces, 1))

    def skin(text: str) -> str:
        nodes = text[: text.index("*ELEMENT")].splitlines()
        own = [line for line in nodes if line.startswith("*") or int(line.split(",")[0]) - FIRST in top]
        return "\n".join([*own, "*ELEMENT, TYPE=S4", shells])

    assert imported(part, tmp_path, sp.csr_matrix(G.T @ K @ G), skin) == 0
    assert "warning: K resists a turn of the whole body at" in capfd.readouterr().out
