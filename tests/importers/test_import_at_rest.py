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
from tolerances import SOLVED

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
    for name in ("normal_load", "tangential_force"):
        assert tables[1][name] == pytest.approx(tables[0][name], rel=1e-5)
    assert tables[1]["gap"] == pytest.approx(tables[0]["gap"], rel=1e-2)  # ccx: displacements less DRY's small offset


def test_gaps_of_nodes_that_are_left_out_need_displacements(tmp_path, capsys):
    results = ccx(tmp_path, "static", static_step("node", lifted=True)).with_suffix(".frd")
    assert imported(tmp_path, results) == 0
    known = table(tmp_path / "blocks_face.csv")
    text = results.read_text()
    begin = text.index(" -4  CONTACT")
    opened = "|".join(str(int(n)) for n in known["node_a"][known["gap"] > 0])
    few = text[:begin] + re.sub(rf" -1 +({opened})[ -].*\n", "", text[begin:])
    (tmp_path / "few.frd").write_text(few)
    assert imported(tmp_path, tmp_path / "few.frd") == 0
    assert table(tmp_path / "blocks_face.csv")["gap"].tolist() == known["gap"].tolist()
    (tmp_path / "bare.frd").write_text(few.replace(" -4  DISP", " -4  NONE"))
    said = wrong(tmp_path, capsys, tmp_path / "bare.frd")
    assert "5 open pairs without one" in said and "*NODE FILE" in said
