"""Entries that stand twice in a file, and a diagonal that was mirrored with its triangle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from models import hexahedra
from models.matrix_files import symmetric, text_of, write_calculix, write_npz

from fretwave.case.matrices import load
from fretwave.case.toml.source import Source
from fretwave.commands.main import main
from fretwave.errors import FretwaveError
from fretwave.importers.entries import Entries, assemble
from fretwave.importers.formats import read_matrix

pytestmark = pytest.mark.ranks(1)

#: A bar held at its end, and node and direction of its dofs.
BAR = hexahedra.bar((6, 2, 2), (0.06, 0.02, 0.01))
FREE = np.setdiff1d(np.arange(BAR.K.shape[0]), BAR.layer(0.0))
M, K = (symmetric(A[FREE][:, FREE]) for A in (BAR.M, BAR.K))
LABELS = np.column_stack([FREE // 3 + 1, FREE % 3 + 1])


def coordinates(A: sp.spmatrix) -> list[str]:
    return text_of(A, lambda i, j, v: f"{i + 1} {j + 1} {v!r}").splitlines(keepends=True)


def market(lines: list[str], kind: str) -> str:
    size = K.shape[0]
    return f"%%MatrixMarket matrix coordinate real {kind}\n{size} {size} {len(lines)}\n{''.join(lines)}"


UPPER, LOWER, BOTH = coordinates(sp.triu(K)), coordinates(sp.tril(K)), coordinates(K)
LABELLED = [
    f"{a},{p},{b},{q},{v!r}\n"
    for (a, p), (b, q), v in ((LABELS[i].tolist(), LABELS[j].tolist(), v) for i, j, v in zip(*sp.find(K)))
]
TWICE = {
    "CalculiX, a file twice": ("K.sti", "".join(2 * UPPER)),
    "CalculiX, one line twice": ("K.sti", "".join([*UPPER, UPPER[7]])),
    "CalculiX, both triangles with their diagonals": ("K.sti", "".join([*UPPER, *LOWER])),
    "Abaqus, a file twice": ("K.mtx", "".join(2 * LABELLED)),
}
#: What elements in parallel, or an assembly of one's own, give too.
ADDED = {
    "triplets, a file twice": ("K.mtx", "".join(2 * BOTH)),
    "both triangles under a symmetric header": ("K.mtx", market(BOTH, "symmetric")),
    "both triangles with their diagonals": ("K.mtx", market([*UPPER, *LOWER], "general")),
    "all lines twice": ("K.mtx", market(2 * BOTH, "general")),
}
ONCE = {
    "upper": ("K.sti", "".join(UPPER)),
    "both": ("K.mtx", "".join(BOTH)),
    "symmetric": ("K.mtx", market(UPPER, "symmetric")),
    "general": ("K.mtx", market(BOTH, "general")),
}


def entries_of(folder: Path, name: str, text: str) -> Entries:
    (folder / name).write_text(text)
    return read_matrix(str(folder / name), "K")


def read(folder: Path, name: str, text: str) -> sp.csr_matrix:
    return assemble({"K": entries_of(folder, name, text)}).matrices["K"]


@pytest.mark.parametrize("form", TWICE)
def test_entries_that_stand_twice(form: str, tmp_path: Path) -> None:
    """They were added up: K doubled beside M, or its diagonal alone, without a word."""
    with pytest.raises(Exception, match="entries of K stand twice") as caught:
        read(tmp_path, *TWICE[form])
    assert "each place once" in str(caught.value) and str(caught.value).count("fix:") == 1


@pytest.mark.parametrize("form", ADDED)
def test_entries_that_may_stand_twice(form: str, tmp_path: Path) -> None:
    """Said, not refused: elements add up so."""
    (said,) = assemble({"K": entries_of(tmp_path, *ADDED[form])}).warnings
    assert "entries of K stand twice and are added up" in said and "A.tocsr()" in said
    if ADDED[form][1].startswith("%%"):
        assert said_by_a_case(tmp_path / "K.mtx", "K") == [said]


#: Ends of equal springs, -1 a wall, and whether a file of their entries looks like one of doubled entries.
SPRINGS = {
    "2 masses between walls": ([(-1, 0), (0, 1), (1, -1)], True),
    "6 masses between walls": ([(k - 1, k if k < 6 else -1) for k in range(7)], False),
    "a ring": ([(k, (k + 1) % 8) for k in range(8)], False),
    "two in parallel": ([(0, 1), (0, 1)], True),
}


@pytest.mark.parametrize("name", ["A.mtx", "A.npz", "A.txt"])
@pytest.mark.parametrize("model", [*SPRINGS, "M of the ring"])
def test_entries_of_elements_in_a_row(model: str, name: str, tmp_path: Path) -> None:
    """Right models whose masses each have two equal springs: taken as they add up, by a case as by an import."""
    ends, looks_so = SPRINGS.get(model, (SPRINGS["a ring"][0], True))
    letter, values = ("M", [[2.0, 1.0], [1.0, 2.0]]) if model.startswith("M") else ("K", [[1.0, -1.0], [-1.0, 1.0]])
    entries = [(p, q, values[i][j]) for one in ends for i, p in enumerate(one) for j, q in enumerate(one)]
    rows, columns, data = zip(*[entry for entry in entries if min(entry[:2]) >= 0])
    size = max(rows) + 1
    expected = np.zeros((size, size))
    np.add.at(expected, (rows, columns), data)
    lines = "".join(f"{i + 1} {j + 1} {v}\n" for i, j, v in zip(rows, columns, data))
    if name.endswith(".npz"):
        sp.save_npz(tmp_path / name, sp.coo_matrix((data, (rows, columns)), (size, size)))
    else:
        header = f"%%MatrixMarket matrix coordinate real general\n{size} {size} {len(data)}\n"
        (tmp_path / name).write_text(header * name.endswith(".mtx") + lines)
    given = {"K": read_matrix(str(tmp_path / name), letter), letter: read_matrix(str(tmp_path / name), letter)}
    found = assemble({letter: given[letter]} if letter == "K" else given)
    assert abs(found.matrices[letter] - expected).max() == 0
    assert any(f"entries of {letter} stand twice" in said for said in found.warnings) == looks_so
    if not name.endswith(".txt"):
        assert said_by_a_case(tmp_path / name, letter) == found.warnings[-1:]


def said_by_a_case(path: Path, letter: str) -> list[str]:
    """Of a matrix of a case beside it, which has to be read."""
    notes: list[str] = []
    found: list[FretwaveError] = []
    (path.parent / "case.toml").write_text("")
    assert load(letter, path.name, Source(path.parent / "case.toml", ""), notes, found) and not found
    return notes


@pytest.mark.parametrize("form", ONCE)
def test_entries_that_stand_once(form: str, tmp_path: Path) -> None:
    assert abs(read(tmp_path, *ONCE[form]) - K).max() == 0


def test_entries_of_elements_add_up(tmp_path: Path) -> None:
    """Of elements that were written without an assembly, which regular meshes make alike."""
    number = np.arange(12).reshape(6, 2)
    chain = np.array([[1.0, -1.0], [-1.0, 1.0]])
    bars = [(number[k, side], number[k + 1, side]) for k in range(5) for side in (0, 1)]
    lines = [
        f"{a + 1} {b + 1} {chain[i, j]}\n" for ends in bars for i, a in enumerate(ends) for j, b in enumerate(ends)
    ]
    text = f"%%MatrixMarket matrix coordinate real general\n12 12 {len(lines)}\n{''.join(lines)}"
    expected = sp.kron(sp.diags([[1, 2, 2, 2, 2, 1], [-1] * 5, [-1] * 5], [0, 1, -1]), sp.identity(2))
    assert abs(read(tmp_path, "K.mtx", text) - expected).max() == 0


@pytest.mark.parametrize("write", [write_npz, write_calculix])
@pytest.mark.parametrize("doubled", [True, False])
def test_a_doubled_diagonal(doubled: bool, write: Callable, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """K + diag(K), which U + U.T is; told by the labels of CalculiX, or a table, without coordinates."""
    parts = [
        write(tmp_path, A + doubled * sp.diags(A.diagonal()), letter, LABELS) for letter, A in (("M", M), ("K", K))
    ]
    (tmp_path / "dofs.csv").write_text("".join(f"{node},{direction}\n" for node, direction in LABELS))
    command = ["import", str(tmp_path / "m.h5"), "--mass", parts[0], "--stiffness", parts[1]]
    assert main([*command, "--dofs", str(tmp_path / "dofs.csv")]) == (2 if doubled else 0)
    said = capfd.readouterr().err
    assert ("the diagonal of K is doubled" in said) == doubled and said.count("fix:") == doubled


def test_a_chain_whose_sums_are_half_of_the_diagonal(tmp_path: Path) -> None:
    """Two masses with three equal springs between walls, as a mesh's rows with a doubled diagonal."""
    chain, labels = sp.csr_matrix([[2.0, -1.0], [-1.0, 2.0]]), np.array([[1, 1], [2, 1]])
    parts = [
        write_npz(tmp_path, A, letter, labels) for letter, A in (("M", sp.identity(2, format="csr")), ("K", chain))
    ]
    (tmp_path / "dofs.csv").write_text("1,1\n2,1\n")
    command = ["import", str(tmp_path / "m.h5"), "--mass", parts[0], "--stiffness", parts[1]]
    assert main([*command, "--dofs", str(tmp_path / "dofs.csv")]) == 0
