"""Nastran: OUTPUT4 files that Nastran wrote (the examples of pyyeti), and grid points of bulk data decks."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from models.matrix_files import Held
from tolerances import LAST_DIGITS, REPEATED

from fretwave.commands.main import main
from fretwave.errors import InputError
from fretwave.importers import assemble, nastran, read_matrix
from fretwave.importers.node_files import read_node_file
from fretwave.results import model_file

pytestmark = pytest.mark.ranks(1)
pyyeti = pytest.importorskip("pyyeti.nastran.op4", reason="pyyeti is not installed")

DATA = Path(pyyeti.__file__).parents[1] / "tests"
#: A superelement of NX Nastran 9 (EXTSEOUT): 24 boundary dofs, 8 modes of the held boundary.
INBOARD = DATA / "nas2cam_extseout" / "inboard.op4"
#: Matrices of superelements and of the whole with its eigenvalues, by MSC Nastran 2017 and NX Nastran 2021.
WHOLE = [DATA / "nas2cam_extseout" / f"nas2cam_notall6_{code}.op4" for code in ("msc2017", "nx2021")]


def dense(path: Path, name: str) -> np.ndarray:
    """In this process, for speed."""
    found = nastran.read(path, "K", name)
    return sp.coo_matrix((found.values, (found.rows, found.columns)), shape=found.shape).toarray()


def test_a_superelement_has_the_modes_that_nastran_prints(tmp_path: Path) -> None:
    """KXX and MXX with the boundary held, against the eight eigenvalues of the .f06: seven digits."""
    arguments = ["import", str(tmp_path / "m.h5"), "--mass", str(INBOARD), "--stiffness", str(INBOARD)]
    assert main(arguments) == 0
    model = model_file.read_model(tmp_path / "m.h5")
    found = scipy.linalg.eigh(model.K.toarray()[24:, 24:], model.M.toarray()[24:, 24:], eigvals_only=True)
    printed = INBOARD.with_suffix(".out").read_text().split("AFTER AUGMENTATION OF RESIDUAL VECTORS")[1]
    lines = re.findall(r"^ +\d+ +\d+ +(\d\.\d{6}E[+-]\d\d)", printed, re.MULTILINE)[: len(found)]
    assert len(found) == 8
    np.testing.assert_allclose(found, [float(word) for word in lines], rtol=5e-7)


@pytest.mark.parametrize("path", WHOLE, ids=["MSC 2017", "NX 2021"])
def test_matrices_have_the_eigenvalues_of_their_file(path: Path) -> None:
    """Names that stand twice are numbered; one alone is not chosen for them."""
    values = scipy.linalg.eigvals(dense(path, "KAA_2"), dense(path, "maa_2")).real
    elastic = np.sort(values[np.isfinite(values) & (values > 1.0)])
    expected = dense(path, "LAMBDA_2")[:, 0]
    expected = expected[expected > 1.0]
    assert len(expected) == 4
    np.testing.assert_allclose(elastic[:4], expected, rtol=REPEATED)
    with pytest.raises(InputError, match="it holds .*KAA_1.*KAA_2"):
        read_matrix(str(path), "K")


@pytest.mark.parametrize("name", ["RMAT", "CMAT"])
def test_every_form_of_the_file(name: str) -> None:
    """Text and binary of both byte orders, 32 and 64 bits, full and both sparse forms."""
    folder = DATA / "nastran_op4_data"
    want = dense(folder / "double_dense_le.op4", name)
    paths = sorted(
        p for p in folder.glob("*_*_*.op4") if re.match(r"(double|single)_(dense|\w*bigmat)_(ascii|be|le)", p.stem)
    )
    paths = [path for path in paths if "badname" not in path.stem]
    assert len(paths) == 39
    for path in paths:
        found = dense(path, name + "S" * path.stem.startswith("single"))
        short = path.stem.startswith("single") or "ascii_i64" in path.stem
        digits = 6e-8 if short else 5e-10 if "ascii" in path.stem else 0.0
        np.testing.assert_allclose(found, want, rtol=digits, atol=0, err_msg=path.name)


@pytest.mark.parametrize("share", [0.02, 0.7])
def test_a_cut_file(share: float, tmp_path: Path) -> None:
    content = INBOARD.read_bytes()
    (tmp_path / "K.op4").write_bytes(content[: int(share * 7000)])
    with pytest.raises(InputError, match="cannot be read"):
        read_matrix(str(tmp_path / "K.op4"), "M")


DECK = """CEND
BEGIN BULK
$ a comment
CORD2C  7               0.0     0.0     1.0     0.0     0.0     2.0
+       1.0     0.0     1.0
{cards}
GRID    3               1.0     2.0     3.0
{long}
GRID,1,7,2.0,90.0,1.5
ENDDATA
"""


def deck(folder: Path, cards: str = "$") -> Path:
    path = folder / "model.bdf"
    long = f"{'GRID*':8}{2:<16}{'':16}{4.0:<16}{5.0:<16}\n{'*':8}{6.0:<16}"
    path.write_text(DECK.format(cards=cards, long=long))
    return path


def test_grid_points(tmp_path: Path) -> None:
    """Short, long and free fields, cylindrical coordinates about an origin of their own; an included deck."""
    nodes = read_node_file(deck(tmp_path))
    np.testing.assert_array_equal(nodes.numbers, [1, 2, 3])
    np.testing.assert_allclose(nodes.coordinates, [[0, 2, 2.5], [4, 5, 6], [1, 2, 3]], atol=LAST_DIGITS)
    (tmp_path / "main.dat").write_text("SOL 103\nCEND\nBEGIN BULK\nINCLUDE 'model.bdf'\nENDDATA\n")
    np.testing.assert_array_equal(read_node_file(tmp_path / "main.dat").numbers, [1, 2, 3])


@pytest.mark.parametrize("said", ["INCLUDE'model.bdf'", 'include,"model.bdf"'], ids=["quote", "comma"])
def test_a_deck_that_only_includes_others_is_known(tmp_path: Path, said: str) -> None:
    deck(tmp_path)
    (tmp_path / "main.dat").write_text(f"{said}\n")
    np.testing.assert_array_equal(read_node_file(tmp_path / "main.dat").numbers, [1, 2, 3])


def test_grid_points_of_real_decks() -> None:
    """One turns the displacements of a grid point; the other joins some by an RBE2."""
    with pytest.raises(InputError, match=r"(?s)directions of nodes are turned.*CD of GRID 11"):
        read_node_file(DATA / "nas2cam_csuper" / "inboard.blk")
    nodes = read_node_file(DATA / "nas2cam_extseout" / "full.dat")
    assert nodes.coordinates.shape == (49, 3) and nodes.constraints.joins == "RBE2"


@pytest.mark.parametrize("cards", ["CORD1R,9,1,2,3\nGRID,4,9,0.,0.,1.", "CORD1C,8,1,2,3,9,1,2,3\nGRID,4,9,0.,0.,1."])
def test_a_system_that_points_define_is_refused_where_one_is_placed_by_it(tmp_path: Path, cards: str) -> None:
    with pytest.raises(InputError, match=r"(?s)defined by grid points.*GRID 4 is given in system 9.*CORD2"):
        read_node_file(deck(tmp_path, cards))


def test_a_system_that_places_no_point_is_let_be(tmp_path: Path) -> None:
    assert len(read_node_file(deck(tmp_path, "CORD1R,9,1,2,3")).numbers) == 3


def test_defaults_of_grid_points_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="GRDSET"):
        read_node_file(deck(tmp_path, "GRDSET                                                          6"))


@pytest.mark.parametrize(
    "card, end, said",
    [
        ("GRID,5,,1.0,2.O,3.0", "ENDDATA", "2.O in GRID 5"),
        ("GRID    5               1.0     2..0    3.0", "ENDDATA", "2..0 in GRID 5"),
        ("GRID,5,,1.0", "", "ends behind 3 fields, no ENDDATA"),
    ],
)
def test_a_damaged_grid_point_is_no_zero(tmp_path: Path, card: str, end: str, said: str) -> None:
    (tmp_path / "model.bdf").write_text(f"BEGIN BULK\nGRID,1,,0.0,0.0,0.0\n{card}\n{end}\n")
    with pytest.raises(InputError, match="(?s)(no number|is cut)") as refused:
        read_node_file(tmp_path / "model.bdf")
    assert said in str(refused.value.measured) and refused.value.fix


def test_blank_fields_are_zero(tmp_path: Path) -> None:
    """Quick Reference Guide: the defaults of GRID."""
    (tmp_path / "model.bdf").write_text("BEGIN BULK\nGRID,1,,,2.0\nGRID,2,,1.0,,3.0\nENDDATA\n")
    np.testing.assert_array_equal(read_node_file(tmp_path / "model.bdf").coordinates, [[0, 2, 0], [1, 0, 3]])


def test_the_only_matrix_is_not_taken_for_another(tmp_path: Path) -> None:
    pyyeti.write(str(tmp_path / "m.op4"), {"maa": np.eye(3)})
    with pytest.raises(InputError, match="there is no matrix K"):
        read_matrix(str(tmp_path / "m.op4"), "K")


def test_a_table_of_nodes_is_no_deck(tmp_path: Path) -> None:
    (tmp_path / "nodes.csv").write_text("grid,x,y,z\n7,1.0,2.0,3.0\n")
    nodes = read_node_file(tmp_path / "nodes.csv")
    assert (nodes.numbers.tolist(), nodes.coordinates.tolist()) == ([7], [[1.0, 2.0, 3.0]])


def test_matrices_and_deck_make_a_model(tmp_path: Path) -> None:
    """All dofs of the grid points, six each or three, in the order of their numbers."""
    held = Held()
    n = len(held.labels) // 3
    cards = "".join(f"GRID,{k},,{x},{y},{z}\n" for k, (x, y, z) in enumerate(held.bar.nodes[-n:].tolist(), 11))
    (tmp_path / "model.dat").write_text(f"BEGIN BULK\n{cards}ENDDATA\n")
    pyyeti.write(str(tmp_path / "m.op4"), {"maa": held.M, "kaa": held.K})
    parts = ["--mass", str(tmp_path / "m.op4"), "--stiffness", str(tmp_path / "m.op4")]
    assert main(["import", str(tmp_path / "m.h5"), *parts, "--coordinates", str(tmp_path / "model.dat")]) == 0
    model = model_file.read_model(tmp_path / "m.h5")
    assert abs(model.K - held.K).max() == 0 and abs(model.M - held.M).max() == 0
    assert model.dof_names[:4] == ["n11x", "n11y", "n11z", "n12x"]
    assert assemble({"K": read_matrix(str(tmp_path / "m.op4"), "K")}).symmetry["K"].startswith("full")
