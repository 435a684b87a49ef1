"""Entries that stand twice in a file, and a diagonal that was mirrored with its triangle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from models import hexahedra
from models.matrix_files import symmetric, text_of, write_calculix, write_npz

from fretwave.case.load import load_case
from fretwave.commands.main import main
from fretwave.errors import CaseErrors
from fretwave.importers.entries import assemble
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
TWICE = {
    "CalculiX, a file twice": ("K.sti", "".join(2 * UPPER)),
    "CalculiX, one line twice": ("K.sti", "".join([*UPPER, UPPER[7]])),
    "CalculiX, both triangles with their diagonals": ("K.sti", "".join([*UPPER, *LOWER])),
    "Abaqus, a file twice": ("K.mtx", "".join(2 * BOTH)),
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


def read(folder: Path, name: str, text: str) -> sp.csr_matrix:
    (folder / name).write_text(text)
    return assemble({"K": read_matrix(str(folder / name), "K")}).matrices["K"]


@pytest.mark.parametrize("form", TWICE)
def test_entries_that_stand_twice(form: str, tmp_path: Path) -> None:
    """They were added up: K doubled beside M, or its diagonal alone, without a word."""
    with pytest.raises(Exception, match="entries of K stand twice") as caught:
        read(tmp_path, *TWICE[form])
    assert "each place once" in str(caught.value) and str(caught.value).count("fix:") == 1


@pytest.mark.parametrize("form", [form for form, (_, text) in TWICE.items() if text.startswith("%%")])
def test_a_case_finds_them_too(form: str, tmp_path: Path) -> None:
    (tmp_path / "K.mtx").write_text(TWICE[form][1])
    sp.save_npz(tmp_path / "M.npz", M)
    (tmp_path / "case.toml").write_text(
        '[model]\nM = "M.npz"\nK = "K.mtx"\n[[analysis]]\nname = "a"\ntype = "linear"\n'
    )
    with pytest.raises(CaseErrors, match="entries of K stand twice"):
        load_case(tmp_path / "case.toml")


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
