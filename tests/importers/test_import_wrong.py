"""Wrong models that an import finds: nothing is written, exit code 2, one thing to do about it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from models import hexahedra
from models.matrix_files import Held, write_calculix, write_npz
from models.two_bars import Two

import fretwave as fw
from fretwave.commands.main import main
from fretwave.errors import InputError
from fretwave.importers.calculix import read_dofs
from fretwave.importers.nodes import read_nodes

pytestmark = pytest.mark.ranks(1)

LEFT_RIGHT = ["--pairs", "joint=LEFT", "RIGHT"]
#: Arguments, and what is said and to be done; of nodes with their elements, and of nodes alone.
DIRECTIONS = {
    "into": ([*LEFT_RIGHT, "--normal=-1,0,0"], "points into the first body", "turn it round"),
    "exchanged": (["--pairs", "j=RIGHT", "LEFT", "--normal=1,0,0"], "points into the first body", "in the other order"),
    "along": ([*LEFT_RIGHT, "--normal=0,1,0"], "lies along the face", ""),
    "aslant": ([*LEFT_RIGHT, "--normal=0.2,1,0.3"], "lies along the face", ""),
    "ground": (["--pairs", "wall=LEFT", "GROUND", "--normal=-1,0,0"], "points into the first body", "turn it round"),
}


def refused(command: list[str], folder: Path, capfd: pytest.CaptureFixture[str]) -> str:
    """What is said; the parts of an error are all there, and no file is."""
    assert main(command) == 2
    text = capfd.readouterr().err
    assert text.count("fix:") == 1 and "where:" in text and "measured:" in text and "expected:" in text
    assert not (folder / "m.h5").exists()
    return text


@pytest.mark.parametrize("deck", [True, False], ids=["elements", "nodes"])
@pytest.mark.parametrize("wrong", DIRECTIONS)
def test_normals(wrong: str, deck: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    arguments, said, fix = DIRECTIONS[wrong]
    text = refused([*Two().write(tmp_path, deck), *arguments], tmp_path, capfd)
    assert said in text and fix in text and "degrees" in text


def table(folder: Path, normal: str, first: list[int], second: list[int]) -> str:
    """A CSV of pairs."""
    rows = [f"{a},{b},{normal}\n" for a, b in zip(first, second)]
    (folder / "pairs.csv").write_text("".join(rows))
    return str(folder / "pairs.csv")


def test_normals_of_a_table(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The right ones are taken, aslant by 40 degrees too."""
    two = Two()
    command, ends = two.write(tmp_path), two.ends.tolist()
    for normal, said in (("-1,0,0", "points into the first body"), ("0,0,1", "lies along the face")):
        text = refused([*command, "--pairs", table(tmp_path, normal, ends[:6], ends[6:])], tmp_path, capfd)
        assert said in text
    assert main([*command, "--pairs", table(tmp_path, "1,0.8,0", ends[:6], ends[6:])]) == 0


def test_single_normals_of_a_table(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """One of six has the other sign: told, with its pair; without it nothing is."""
    two = Two()
    command, ends = two.write(tmp_path), two.ends.tolist()
    rows = Path(table(tmp_path, "1,0.8,0", ends[:6], ends[6:]))
    assert main([*command, "--pairs", str(rows)]) == 0 and "first body" not in capfd.readouterr().out
    lines = rows.read_text().splitlines()
    lines[2] = lines[2].replace("1,0.8,0", "-1,0,0")
    rows.write_text("\n".join(lines) + "\n")
    assert main([*command, "--pairs", str(rows)]) == 0
    assert f"1 of 6 normals point into the first body, the first is pair 3 (node {ends[2]})" in capfd.readouterr().out


@pytest.mark.parametrize("deck", [True, False], ids=["elements", "nodes"])
def test_sides_far_apart(deck: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The second bar 1e5 tolerances away. Pairs of a table as well, unless that is told to be meant."""
    two = Two()
    two.nodes[len(two.first.nodes) :, 0] += 0.01
    command, ends = two.write(tmp_path, deck), two.ends.tolist()
    text = refused([*command, *LEFT_RIGHT, "--normal", "1,0,0"], tmp_path, capfd)
    assert "the two sides are far apart" in text and "0.01 apart" in text
    pairs = ["--pairs", table(tmp_path, "1,0,0", ends[:6], ends[6:])]
    text = refused([*command, *pairs], tmp_path, capfd)
    assert "nodes of a pair are far apart" in text and "6 such" in text
    assert "which is 1000 tolerances of" in text and "a pair may be 1000 of it apart" in text
    (fix,) = [line.split() for line in text.splitlines() if "fix:" in line]
    assert main([*command, *pairs, "--tolerance", fix[fix.index("--tolerance") + 1]]) == 0


@pytest.mark.parametrize("labelled", [True, False])
def test_mass_and_stiffness_exchanged(labelled: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    held = Held()
    write = write_calculix if labelled else write_npz
    mass, stiffness = (write(tmp_path, A, letter, held.labels) for A, letter in ((held.M, "M"), (held.K, "K")))
    command = ["import", str(tmp_path / "m.h5")]
    text = refused([*command, "--mass", stiffness, "--stiffness", mass], tmp_path, capfd)
    assert "seem exchanged" in text and "exchange --mass and --stiffness" in text
    assert main([*command, "--mass", mass, "--stiffness", stiffness]) == 0


@pytest.mark.parametrize("labelled", [True, False])
def test_mass_and_stiffness_of_two_models(labelled: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """As many dofs, other elements: refused where nodes are known, by a table too; one of fewer dofs by its size."""
    bars = [hexahedra.bar(cells, (0.06, 0.02, 0.01)) for cells in ((3, 2, 1), (2, 3, 1), (3, 1, 1))]
    n = len(bars[0].nodes)
    labels = np.column_stack([np.repeat(np.arange(1, n + 1), 3), np.tile([1, 2, 3], n)])
    write = write_calculix if labelled else write_npz
    parts = [write(tmp_path, A, letter, labels) for A, letter in ((bars[1].M, "M"), (bars[0].K, "K"))]
    command = ["import", str(tmp_path / "m.h5"), "--stiffness", parts[1], "--mass"]
    np.savetxt(tmp_path / "d.csv", labels, fmt="%d", delimiter=",")
    told = [] if labelled else ["--dofs", str(tmp_path / "d.csv")]
    assert "are of two models" in refused([*command, parts[0], *told], tmp_path, capfd)
    (tmp_path / "small").mkdir()
    small = write_npz(tmp_path / "small", sp.csr_matrix(bars[2].M), "M", labels)
    assert "differ in size" in refused([*command, small], tmp_path, capfd)
    if not labelled:
        assert main([*command, parts[0]]) == 0
        assert "may be of two models" in capfd.readouterr().out


JOINT = Path(__file__).parents[2] / "cases" / "lap_joint" / "joint.inp"


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_files_of_one_model_however_they_are_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Bricks along the axes, whose K has zeros where M has none: by their table, in capitals, and without one."""
    shutil.copy(JOINT, tmp_path / "joint.inp")
    subprocess.run(["ccx", "joint"], cwd=tmp_path, capture_output=True, check=True)
    out, table = str(tmp_path / "m.h5"), ["--dofs", str(tmp_path / "table.dof")]
    assert main(["import", str(tmp_path / "joint.inp")]) == 0
    for suffix in (".inp", ".sti", ".mas", ".dof"):
        (tmp_path / f"joint{suffix}").rename(tmp_path / f"J{suffix.upper()}")
    assert main(["import", str(tmp_path / "J.INP")]) == 0
    assert "warning: units" in (said := capfd.readouterr().out) and "two models" not in said
    (tmp_path / "J.DOF").rename(tmp_path / "table.dof")
    command = ["import", out, "--mass", str(tmp_path / "J.MAS"), "--stiffness", str(tmp_path / "J.STI")]
    assert main([*command, *table, "--coordinates", str(tmp_path / "J.INP")]) == 0
    assert "two models" not in capfd.readouterr().out
    assert main(command) == 0 and "may be of two models" in capfd.readouterr().out
    models = [fw.read_model(tmp_path / name) for name in ("joint.h5", "J.h5", "m.h5")]
    assert models[0].labels.tolist() == models[1].labels.tolist() and models[2].labels is None
    assert all((model.K != models[0].K).nnz == 0 for model in models)


@pytest.mark.parametrize("given", ["nan", "-1", "0", "inf"])
def test_a_tolerance_that_is_no_length(given: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert "the tolerance is no length" in refused([*Two().write(tmp_path), f"--tolerance={given}"], tmp_path, capfd)


def test_a_gap_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Where the tolerance lets it pass."""
    two = Two()
    two.nodes[len(two.first.nodes) :, 0] += 0.002
    assert main([*two.write(tmp_path, True), *LEFT_RIGHT, "--tolerance", "0.003"]) == 0
    assert "contact 'joint': its nodes are up to 0.002 apart" in capfd.readouterr().out


def without(two: Two, folder: Path, direction: int) -> list[str]:
    """The import of two bodies in whose matrices a node of the contact has no row of a direction."""
    command, nodes = two.write(folder, True), len(two.nodes)
    names = [f"{node}.{axis}" for node in range(1, nodes + 1) for axis in (1, 2, 3)]
    kept = [k for k, name in enumerate(names) if name != f"{two.ends[0]}.{direction}"]
    (folder / "rows.dof").write_text("".join(f"{names[k]}\n" for k in kept))
    for letter, A in (("M", two.M), ("K", two.K)):
        sp.save_npz(folder / f"{letter}.npz", sp.csr_matrix(A[kept][:, kept]))
    command = [*command[:2], "--mass", str(folder / "M.npz"), "--stiffness", str(folder / "K.npz"), *command[-2:]]
    return [*command, "--dofs", str(folder / "rows.dof"), *LEFT_RIGHT]


@pytest.mark.parametrize("keyword", ["*EQUATION\n2\n5,2,1.,6,2,-1.\n", "*PRE-TENSION SECTION, SURFACE=CUT, NODE=6\n"])
def test_nodes_that_depend_on_others(keyword: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A direction of a contact's node that has no row is held by *BOUNDARY, or else it depends on others."""
    two = Two()
    command = without(two, tmp_path, 2)
    deck = (tmp_path / "n.inp").read_text() + keyword
    (tmp_path / "n.inp").write_text(deck)
    text = refused(command, tmp_path, capfd)
    assert f"measured: n{two.ends[0]}y, 1 such dofs; the deck has {keyword.splitlines()[0].partition(',')[0]}" in text
    (tmp_path / "n.inp").write_text(f"{deck}*BOUNDARY\n{two.ends[0]}, 2\n")
    assert main(command) == 0


def test_nodes_without_rows_are_doubted(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Where the deck says what it holds, and holds them not: they were taken as held without a word."""
    two = Two()
    command, doubt = without(two, tmp_path, 2), f"no *BOUNDARY holds them (n{two.ends[0]}y, 1 such dofs): taken as held"
    deck = (tmp_path / "n.inp").read_text()
    for held, said in (("", False), ("2, 1, 3", True), (f"{two.ends[0]}, 1, 3", False), ("ELSEWHERE.SET, 1", False)):
        (tmp_path / "n.inp").write_text(f"{deck}*BOUNDARY\n{held}\n" if held else deck)
        assert main(command) == 0
        out = capfd.readouterr()
        assert (doubt in out.out + out.err) == said


@pytest.mark.parametrize("apart", [0.002, -0.002])
def test_a_gap_is_told_from_an_overlap(apart: float, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Neither is the pairs': whoever widens the tolerance gets contact that touches."""
    two = Two()
    two.nodes[len(two.first.nodes) :, 0] += apart
    assert main([*two.write(tmp_path, True), *LEFT_RIGHT, "--tolerance", "0.003"]) == 0
    said = f"up to 0.002 apart; along the normals {apart:g} to {apart:g} (below zero they overlap): the pairs touch"
    assert f"contact 'joint': its nodes are {said} all the same" in capfd.readouterr().out


def test_shells_of_calculix(tmp_path: Path) -> None:
    """It makes solids of them: a node has several rows of one direction, and which is which is not known."""
    (tmp_path / "job.dof").write_text("1.1\n1.2\n1.3\n1.1\n")
    with pytest.raises(InputError, match="stands twice") as caught:
        read_dofs(tmp_path / "job.dof")
    assert "mesh shells and beams as solids" in (caught.value.fix or "")


#: A change of each line "a,b,1,0,0,1e-5" of a table of pairs.
TABLES = {
    "no whole number": lambda a, b: f"{a}.7,{b},1,0,0\n",
    "a pair stands twice": lambda a, b: 2 * f"{a},{b},1,0,0\n",
    "of one node with itself": lambda a, b: f"{a},{a},1,0,0\n",
    "an area below zero": lambda a, b: f"{a},{b},1,0,0,-1e-5\n",
}


@pytest.mark.parametrize("said", TABLES)
def test_tables_of_pairs(said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    two = Two()
    ends = two.ends.tolist()
    (tmp_path / "p.csv").write_text("".join(TABLES[said](a, b) for a, b in zip(ends[:6], ends[6:])))
    assert said in refused([*two.write(tmp_path), "--pairs", str(tmp_path / "p.csv")], tmp_path, capfd)


@pytest.mark.parametrize(("form", "said"), [("{0},{2}", "a direction of the table is none"), ("{0}.5,{1}", "whole")])
def test_tables_of_dofs(form: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Directions from 0 on would be others; nodes are not rounded."""
    two = Two()
    rows = [
        form.format(node, direction, direction - 1) for node in range(1, len(two.nodes) + 1) for direction in (1, 2, 3)
    ]
    (tmp_path / "d.csv").write_text("\n".join(rows))
    command = [*two.write(tmp_path), *LEFT_RIGHT, "--normal", "1,0,0", "--dofs", str(tmp_path / "d.csv")]
    assert said in refused(command, tmp_path, capfd)


def test_nodes_of_a_set_are_taken_once(tmp_path: Path) -> None:
    """And nodes have whole numbers."""
    np.savez(tmp_path / "n.npz", coordinates=np.eye(3), WALL=[3, 1, 3])
    assert read_nodes(tmp_path / "n.npz").node_set("WALL").tolist() == [3, 1]
    (tmp_path / "n.csv").write_text("1, 0, 0, 0\n1.5, 1, 0, 0\n")
    with pytest.raises(InputError, match="no whole number"):
        read_nodes(tmp_path / "n.csv")


@pytest.mark.parametrize("cells", [(3, 2, 1), (12, 8, 4)], ids=["dense", "large"])
@pytest.mark.parametrize("wrong", ["lumped", "motion", "stiffness", "sign"])
def test_negative_mass_and_stiffness(
    wrong: str, cells: tuple[int, int, int], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A lumped mass below zero, a mass that a motion has below zero, and stiffness of one dof or of all."""
    bar = hexahedra.bar(cells, (0.06, 0.02, 0.01))
    M, K = sp.csr_matrix(bar.M), sp.csr_matrix(bar.K)
    one = sp.diags((np.arange(M.shape[0]) == 4).astype(float))
    if wrong == "lumped":
        lumped = sp.diags(np.asarray(M.sum(axis=1)).ravel())
        M, said = lumped - 2 * lumped @ one, "the mass matrix has a negative diagonal entry"
    elif wrong == "motion":  # two dofs that move against each other: m - 1.5 m
        joined = sp.coo_matrix(([1.5 * M[4, 4]] * 2, ([4, 7], [7, 4])), shape=M.shape)
        M, said = M + joined, "the mass matrix is negative for a motion"
    else:
        K = -K if wrong == "sign" else K - 2 * K[4, 4] * one
        said = "the stiffness matrix has a negative diagonal entry"
    parts = [write_npz(tmp_path, sp.csr_matrix(A), letter, np.zeros(0)) for letter, A in (("M", M), ("K", K))]
    text = refused(["import", str(tmp_path / "m.h5"), "--mass", parts[0], "--stiffness", parts[1]], tmp_path, capfd)
    assert said in text and "PETSc" not in text
