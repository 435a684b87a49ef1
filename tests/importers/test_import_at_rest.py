"""A static contact step of CalculiX as state at rest: forces of the pairs, their sum, gaps, and what is refused."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from tolerances import LAST_DIGITS, SOLVED

import fretwave as fw

pytestmark = [
    pytest.mark.ranks(1),
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed"),
]

N, LENGTH, HEIGHT = 4, 10.0, 5.0
KINDS = {"node": "NODE TO SURFACE", "surface": "SURFACE TO SURFACE"}
MATERIAL = """*MATERIAL, NAME=STEEL
*ELASTIC
210000., 0.3
*DENSITY
7.85e-9
*SOLID SECTION, ELSET=LOWER, MATERIAL=STEEL
*SOLID SECTION, ELSET=UPPER, MATERIAL=STEEL
*BOUNDARY
BOTTOM, 1, 3"""
CONTACT = """*SURFACE INTERACTION, NAME=DRY
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
1e6, 0.01
*FRICTION
0.3, 1e5
*CONTACT PAIR, INTERACTION=DRY, TYPE={kind}
A, B"""
PRINTED = {"node": "", "surface": "*CONTACT PRINT, SLAVE=A, MASTER=B\nCF\n"}  # node: ccx 2.20 ends with it


class Block:
    """N x N bricks of 10 x 10 x 5, from a height."""

    def __init__(self, z: float, node: int, element: int) -> None:
        self.number = {}
        for k in range(2):
            for j in range(N + 1):
                for i in range(N + 1):
                    self.number[i, j, k] = node + len(self.number)
        step = LENGTH / N
        self.nodes = [f"{n}, {step * i}, {step * j}, {z + HEIGHT * k}" for (i, j, k), n in self.number.items()]
        self.elements = {}
        for j in range(N):
            for i in range(N):
                square = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
                self.elements[element + len(self.elements)] = [self.number[i, j, k] for k in (0, 1) for i, j in square]

    def lines(self) -> list[str]:
        return [f"{e}, {', '.join(map(str, corners))}" for e, corners in self.elements.items()]

    def layer(self, k: int) -> list[str]:
        return [str(n) for place, n in self.number.items() if place[2] == k]


LOWER = Block(0.0, 1, 1)
UPPER = Block(HEIGHT, 1 + len(LOWER.number), 1 + len(LOWER.elements))


def deck(step: list[str], contact: str = "") -> str:
    text = ["*NODE, NSET=ALL", *LOWER.nodes, *UPPER.nodes]
    text += ["*ELEMENT, TYPE=C3D8, ELSET=LOWER", *LOWER.lines(), "*ELEMENT, TYPE=C3D8, ELSET=UPPER", *UPPER.lines()]
    text += ["*NSET, NSET=BOTTOM", *LOWER.layer(0), "*NSET, NSET=TOP", *UPPER.layer(1)]
    text += ["*SURFACE, NAME=A, TYPE=ELEMENT", "LOWER, S2", "*SURFACE, NAME=B, TYPE=ELEMENT", "UPPER, S1"]
    return "\n".join([*text, MATERIAL, *filter(None, [contact]), "*STEP", *step, "*END STEP"]) + "\n"


def pressures(lifted: bool = False) -> np.ndarray:
    """On the upper block's bricks, row by row; lifted: pulled up along one edge."""
    along = 50.0 * (1 + 0.5 * np.arange(N) / N)
    return np.concatenate([-0.6 * along if lifted and j == 0 else along for j in range(N)])


def static_step(kind: str, lifted: bool = False, files: str = "*CONTACT FILE\nCDIS, CSTR\n") -> str:
    loads = [f"{e}, P2, {p}" for e, p in zip(UPPER.elements, pressures(lifted))]
    held = ["*BOUNDARY", "TOP, 1, 2", "*STATIC", "1., 1.", "*DLOAD", *loads, "*NODE FILE", "U"]
    return deck([*held, f"{files}{PRINTED[kind]}".rstrip()], CONTACT.format(kind=KINDS[kind]))


def ccx(folder: Path, name: str, text: str) -> Path:
    (folder / f"{name}.inp").write_text(text)
    done = subprocess.run(["ccx", name], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    return folder / name


def imported(folder: Path, results: Path, *more: object) -> int:
    """Exit code of the import of both blocks, their matrices made by CalculiX."""
    blocks = ccx(folder, "blocks", deck(["*FREQUENCY, SOLVER=MATRIXSTORAGE", "6"]))
    given = ("--pairs", "face=A", "B", "--units", "mm-t-s", "--at-rest", results, *more)
    return call("import", blocks.with_suffix(".inp"), *given)


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {key.partition(" [")[0]: np.array([float(row[key]) for row in rows]) for key in rows[0]}


APPLIED = float(pressures().sum() * (LENGTH / N) ** 2)


@pytest.mark.parametrize("kind", KINDS)
def test_the_forces_of_the_pairs_are_the_load_that_presses(kind, tmp_path, capsys):
    """Within 1e-3; where ccx prints the force of the contact, to its digits."""
    results = ccx(tmp_path, "static", static_step(kind)).with_suffix(".frd")
    assert imported(tmp_path, results) == 0
    said = capsys.readouterr().out
    found = table(tmp_path / "blocks_face.csv")
    assert found["normal_load"].sum() == pytest.approx(APPLIED, rel=1e-3 if kind == "node" else 1e-6)
    assert "25 of 25 pairs pressed" in said and "blocks_face.csv" in said
    total = [float(value) for value in re.search(r"presses with \(([^)]*)\)", said)[1].split(",")]
    assert total == pytest.approx([0.0, 0.0, found["normal_load"].sum()], rel=1e-5, abs=1e-9)
    assert ("scaled by" in said) == (kind == "surface")
    assert not found["gap"].any() and (found["tangential_force"] <= 0.3 * found["normal_load"]).all()


CASE = """
[model]
file = "blocks.h5"

[[contact]]
name = "face"
law = "coulomb_3d"
friction_coefficient = 0.3
normal_stiffness_per_area = 1e6
tangential_stiffness_per_area = 1e5
normal_load = "blocks_face.csv"
gap = "blocks_face.csv"

[preload]

[[analysis]]
name = "rest"
type = "static"
"""


@pytest.mark.parametrize("kind", KINDS)
def test_a_case_is_at_rest_with_them(kind, tmp_path):
    results = ccx(tmp_path, "static", static_step(kind)).with_suffix(".frd")
    assert imported(tmp_path, results) == 0
    (tmp_path / "case.toml").write_text(CASE)
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    rest = fw.open_run(tmp_path / "run")["rest"]
    assert rest["normal_force"] == pytest.approx(table(tmp_path / "blocks_face.csv")["normal_load"], rel=SOLVED)
    assert rest["normal_force"].sum() == pytest.approx(APPLIED, rel=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_pairs_that_were_lifted_are_open_by_their_gap(kind, tmp_path):
    """The edge that is pulled up: its pairs stand off by what the nodes moved apart, the others carry the load."""
    results = ccx(tmp_path, "static", static_step(kind, lifted=True)).with_suffix(".frd")
    assert imported(tmp_path, results) == 0
    found, model = table(tmp_path / "blocks_face.csv"), fw.read_model(tmp_path / "blocks.h5")
    edge = np.array([model.coordinates[list(model.node_numbers).index(n)][1] == 0 for n in found["node_a"]])
    assert (found["gap"][edge] > 1e-5).all() and not found["normal_load"][edge].any() and edge.sum() == N + 1
    load = pressures(lifted=True).sum() * (LENGTH / N) ** 2
    assert found["normal_load"].sum() == pytest.approx(load, rel=1e-3)
    (tmp_path / "case.toml").write_text(CASE)
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    rest = fw.open_run(tmp_path / "run")["rest"]
    assert ((rest["status"] == "open") == (found["normal_load"] == 0)).all()


JOINT = Path(__file__).parents[2] / "cases" / "lap_joint" / "joint.inp"
#: Both plates of the lap joint pressed together over the overlap of 40 x 20 mm by 1 MPa.
CLAMPED = """*BOUNDARY
306, 1, 2
302, 1, 2
*SURFACE INTERACTION, NAME=DRY
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
1e5, 0.01
*FRICTION
0.3, 1e4
*CONTACT PAIR, INTERACTION=DRY, TYPE={kind}
LOWER, UPPER
*STEP
*STATIC
0.5, 1.
*DLOAD
EB, P2, 1.0
EA, P1, 1.0
*CONTACT FILE
CDIS, CSTR
*NODE FILE
U
*END STEP
"""


@pytest.mark.parametrize("kind", KINDS)
def test_the_lap_joint_carries_what_clamps_it(kind, tmp_path):
    """The dependent side is the second of --pairs: its nodes tell."""
    text = JOINT.read_text()
    joint = ccx(tmp_path, "joint", text)
    clamped = ccx(tmp_path, "clamped", text[: text.index("*STEP")] + CLAMPED.format(kind=KINDS[kind]))
    given = ("--pairs", "joint=A", "B", "--units", "mm-t-s", "--at-rest", clamped.with_suffix(".frd"))
    assert call("import", joint.with_suffix(".inp"), *given) == 0
    found = table(tmp_path / "joint_joint.csv")
    assert found["normal_load"].sum() == pytest.approx(40.0 * 20.0, rel=1e-3) and len(found["pair"]) == 25


def wrong(folder: Path, capsys, results: Path, *more: object) -> str:
    capsys.readouterr()
    assert imported(folder, results, *more) == 2
    said = capsys.readouterr().err
    assert said.count("fix:") == 1
    return said


def test_results_of_another_kind_are_refused(tmp_path, capsys):
    bare = ccx(tmp_path, "bare", static_step("node", files="")).with_suffix(".frd")
    assert "there is no contact in the results" in wrong(tmp_path, capsys, bare)
    results = ccx(tmp_path, "static", static_step("surface")).with_suffix(".frd")
    assert "there is no contact" in wrong(tmp_path, capsys, results.with_suffix(".dat"))  # of faces, not of nodes
    text = results.read_text()
    begin = text.index(" -4  CONTACT")
    block = text[begin:].replace("E+01", "E-80")
    loose = re.sub(r"( -1 +\d+)( ?-?\d\.\d{5}E[+-]\d\d){6}", r"\1" + 6 * " 0.00000E+00", block)
    (tmp_path / "loose.frd").write_text(text[:begin] + loose)
    assert "no pair of the contact is pressed" in wrong(tmp_path, capsys, tmp_path / "loose.frd")
    (tmp_path / "cut.frd").write_text(text[: begin + text[begin:].index(" -1") + 40] + "\n")
    assert "a line of results is wrong" in wrong(tmp_path, capsys, tmp_path / "cut.frd")
    shutil.copy(results, tmp_path / "other.frd")
    printed = results.with_suffix(".dat").read_text()
    (tmp_path / "other.dat").write_text(re.sub(r"(normal force[^\n]*\n\s*\S+\s+)\S+", r"\g<1>-9.0E+03", printed))
    said = wrong(tmp_path, capsys, tmp_path / "other.frd")
    assert "are not those of the contact" in said and "9000 of CF" in said


def test_printed_slave_nodes_say_the_same(tmp_path):
    text = static_step("node", lifted=True, files="*CONTACT FILE\nCDIS, CSTR\n*CONTACT PRINT\nCDIS, CSTR\n")
    results, tables = ccx(tmp_path, "static", text), []
    for suffix in (".frd", ".dat"):
        assert imported(tmp_path, results.with_suffix(suffix)) == 0
        tables.append(table(tmp_path / "blocks_face.csv"))
    for name in ("normal_load", "tangential_force", "gap"):
        assert tables[1][name] == pytest.approx(tables[0][name], rel=1e-5)


def heights(text: str) -> dict[int, float]:
    """Displacement along z of each node, of the block DISP."""
    block = text[text.index(" -4  DISP") :].partition(" -3\n")[0]
    return {int(line[3:13]): float(line[37:49]) for line in block.splitlines() if line.startswith(" -1")}


def test_gaps_of_nodes_that_are_left_out_need_displacements(tmp_path, capsys):
    """They are as far open as both nodes moved apart."""
    results = ccx(tmp_path, "static", static_step("node", lifted=True)).with_suffix(".frd")
    assert imported(tmp_path, results) == 0
    known = table(tmp_path / "blocks_face.csv")
    text = results.read_text()
    begin = text.index(" -4  CONTACT")
    opened = "|".join(str(int(n)) for n in known["node_a"][known["gap"] > 0])
    few = text[:begin] + re.sub(rf" -1 +({opened})[ -].*\n", "", text[begin:])
    (tmp_path / "few.frd").write_text(few)
    assert imported(tmp_path, tmp_path / "few.frd") == 0
    u, found = heights(text), table(tmp_path / "blocks_face.csv")
    apart = [u[b] - u[a] for a, b in zip(found["node_a"], found["node_b"])]
    opening = known["gap"] > 0
    assert found["gap"] == pytest.approx(np.where(opening, apart, 0.0), rel=LAST_DIGITS)
    assert known["gap"] == pytest.approx(found["gap"], rel=1e-2)  # ccx: displacements less DRY's small offset
    (tmp_path / "bare.frd").write_text(few.replace(" -4  DISP", " -4  NONE"))
    said = wrong(tmp_path, capsys, tmp_path / "bare.frd")
    assert "5 open pairs without one" in said and "*NODE FILE" in said


#: Closed results that moved across the normal of the undeformed mesh by more than they are pressed together.
SHIFT = 1e-3


def shifted(text: str, by: float = SHIFT) -> str:
    """As if the upper block's nodes had moved up together, with the lower one's surface turned under them."""
    begin = text.index(" -4  DISP")
    block, end, rest = text[begin:].partition(" -3\n")
    upper = set(UPPER.number.values())
    lines = [
        f"{line[:37]}{float(line[37:49]) + by:12.5E}" if line.startswith(" -1") and int(line[3:13]) in upper else line
        for line in block.splitlines()
    ]
    return text[:begin] + "\n".join(lines) + "\n" + end + rest


@pytest.mark.parametrize("lifted", [False, True])
def test_contact_at_nodes_is_taken_at_its_word(lifted, tmp_path):
    """Displacements along the undeformed normal do not open it: the deck tells, or a node that is listed as open."""
    results = ccx(tmp_path, "static", static_step("node", lifted)).with_suffix(".frd")
    results.write_text(shifted(results.read_text()))
    assert imported(tmp_path, results) == 0
    found, load = table(tmp_path / "blocks_face.csv"), pressures(lifted).sum() * (LENGTH / N) ** 2
    assert found["normal_load"].sum() == pytest.approx(load, rel=1e-3)
    assert (found["gap"] < SHIFT / 2).all() and ((found["gap"] > 0) == (found["normal_load"] == 0)).all()
    if lifted:
        results.with_suffix(".inp").unlink()
        assert imported(tmp_path, results) == 0
        assert table(tmp_path / "blocks_face.csv")["normal_load"].tolist() == found["normal_load"].tolist()


def test_pressed_pairs_that_are_apart(tmp_path, capsys):
    """All of them, or more than a tenth of the force where the whole is not known; a few are said."""
    results = ccx(tmp_path, "static", static_step("surface", lifted=True)).with_suffix(".frd")
    text, deck_of = results.read_text(), results.with_suffix(".inp")
    assert imported(tmp_path, results) == 0
    said = capsys.readouterr().out
    assert re.search(r"5 pairs with 3\d\.\d+ of 38\d\d\.\d+ apart by the displacements: taken as open", said)
    results.write_text(shifted(text))
    assert "25 pairs with" in wrong(tmp_path, capsys, results)
    results.write_text(shifted(text, 4e-5))
    results.with_suffix(".dat").unlink()
    assert "pressed pairs are apart" in wrong(tmp_path, capsys, results)
    deck_of.write_text(deck_of.read_text().replace(KINDS["surface"], KINDS["node"]))
    assert imported(tmp_path, results) == 0


@pytest.mark.parametrize("block", ["DISP", "CONTACT"])
def test_results_that_end_within_a_block(block, tmp_path, capsys):
    """At the end of a line, wherever; or between blocks."""
    results = ccx(tmp_path, "static", static_step("node")).with_suffix(".frd")
    text = results.read_text()
    begin = text.index(f" -4  {block}")
    lines = text[begin:].partition(" -3\n")[0].splitlines(keepends=True)
    for count in (1, 8, len(lines) // 2, len(lines)):
        (tmp_path / "cut.frd").write_text(text[:begin] + "".join(lines[:count]))
        assert f"it ends within the block {block}" in wrong(tmp_path, capsys, tmp_path / "cut.frd")
    (tmp_path / "cut.frd").write_text(text[:begin] + "".join(lines) + " -3\n")
    assert "the file of results is cut" in wrong(tmp_path, capsys, tmp_path / "cut.frd")
