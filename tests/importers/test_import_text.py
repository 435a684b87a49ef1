"""Text files as editors, scripts and shells leave them: marks, banners, lines of sizes, cut ends, compressed."""

from __future__ import annotations

import gzip
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from models.matrix_files import Held, write_calculix
from models.two_bars import Two

import fretwave as fw
from fretwave.commands.main import main
from fretwave.importers import assemble, read_matrix
from fretwave.importers.node_files import read_node_file
from fretwave.importers.pair_tables import read_pairs
from fretwave.importers.text import doubt_of_end

pytestmark = pytest.mark.ranks(1)

K = sp.diags([[2.0] * 4 + [1.0], [-1.0] * 4, [-1.0] * 4], [0, 1, -1], format="csr") * 1e6
BOM = b"\xef\xbb\xbf"
BANNER = "%%MatrixMarket matrix coordinate real general\n"


CASE = """
[model]
dofs = ["a", "b", "c", "d", "e"]
M = "M.npz"
K = "K.mtx"
[[analysis]]
name = "linear"
type = "linear"
"""


def text_of(A: sp.spmatrix, form: str = "{} {} {:.6e}\n") -> str:
    """Lines row, column, value."""
    entries = sp.coo_matrix(A)
    return "".join(form.format(i + 1, j + 1, v) for i, j, v in zip(entries.row, entries.col, entries.data))


def read(path: Path) -> sp.csr_matrix:
    return assemble({"K": read_matrix(str(path), "K")}).matrices["K"]


def test_places_without_values_are_no_matrix(tmp_path: Path) -> None:
    """A pattern was read as ones."""
    scipy.io.mmwrite(tmp_path / "K.mtx", K, field="pattern")
    with pytest.raises(fw.InputError, match="places without values"):
        read(tmp_path / "K.mtx")


@pytest.mark.parametrize("part", [sp.csr_matrix, sp.tril, sp.triu])
@pytest.mark.parametrize("form", ["{} {} {:.6e}\n", "{},{},{}\n"])
def test_a_line_of_sizes_is_no_entry(part: Callable, form: str, tmp_path: Path) -> None:
    """In a file cut after it too; without it the same lines are a matrix, and so is a last diagonal in front."""
    lines = text_of(part(K), form)
    (tmp_path / "K.mtx").write_text(form.replace(":.6e", "").format(5, 5, part(K).nnz) + lines)
    with pytest.raises(fw.InputError, match="the first line is the size of a matrix"):
        read(tmp_path / "K.mtx")
    (tmp_path / "K.mtx").write_text(lines)
    assert (read(tmp_path / "K.mtx") != K).nnz == 0
    (tmp_path / "K.mtx").write_text("2 2 5\n1 1 3\n2 1 -1\n")
    assert read(tmp_path / "K.mtx").toarray().tolist() == [[3, -1], [-1, 5]]


@pytest.mark.parametrize("begin", ["", "\n", "\n  \n", BOM.decode()])
@pytest.mark.parametrize("banner", [BANNER, BANNER.lower(), BANNER.upper(), BANNER.replace("\n", "\r\n")])
def test_a_banner_in_any_case_and_place(begin: str, banner: str, tmp_path: Path) -> None:
    (tmp_path / "K.mtx").write_text(f"{begin}{banner}% by hand\n5 5 {K.nnz}\n{text_of(K)}", encoding="utf-8")
    assert (read(tmp_path / "K.mtx") != K).nnz == 0


def cut_files(folder: Path) -> dict[str, Path]:
    """Whole files, their numbers of a fixed form."""
    scipy.io.mmwrite(str(folder / "market.mtx"), K)
    held = Held()
    given = {"market": folder / "market.mtx", "CalculiX": Path(write_calculix(folder, held.K, "K", held.labels))}
    (folder / "abaqus.mtx").write_text(text_of(K, "{},1, {},1, {:.16e}\n"))
    return {**given, "Abaqus": folder / "abaqus.mtx"}


@pytest.mark.parametrize("kind", ["market", "CalculiX", "Abaqus"])
def test_a_last_value_that_is_cut(kind: str, tmp_path: Path) -> None:
    """Refused wherever it is cut; without its end of line alone it is whole."""
    path = cut_files(tmp_path)[kind]
    whole = path.read_text().rstrip()
    for count in (1, 2, 3, 4, 8):
        path.write_text(whole[:-count])
        with pytest.raises(
            fw.InputError, match="the last line is cut" if count in (1, 4, 8) else None
        ):  # else no number
            read_matrix(str(path), "K")
    path.write_text(whole)
    assert read_matrix(str(path), "K").doubt == ""


def test_an_end_that_may_be_cut_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Of numbers without a fixed form, as hands write them, nothing tells."""
    for letter, A in (("M", sp.eye(5)), ("K", K)):
        lines = f"5 5 {A.nnz}\n{text_of(A, '{} {} {}' + chr(10)).rstrip()}" + ("\n" if letter == "M" else "")
        (tmp_path / f"{letter}.mtx").write_text(BANNER + lines)
    command = ["import", str(tmp_path / "m.h5"), "--mass", str(tmp_path / "M.mtx"), "--stiffness"]
    assert main([*command, str(tmp_path / "K.mtx")]) == 0
    (said,) = [line for line in capfd.readouterr().out.splitlines() if line.startswith("warning")]
    assert "K.mtx does not end with the end of a line" in said and "`5 4 -1000000.0`" in said
    assert doubt_of_end(tmp_path / "M.mtx") == ""


def files_of_two(folder: Path) -> tuple[list[str], dict[str, Path]]:
    """An import by tables of all kinds, and those."""
    two = Two()
    command = two.write(folder, True)
    names = {f"--{role}": Path(command[command.index(f"--{role}") + 1]) for role in ("mass", "stiffness")}
    for option, A in (("--mass", two.M), ("--stiffness", two.K)):
        names[option] = folder / f"{option[2:]}.mtx"
        names[option].write_text(BANNER + f"{len(two.nodes) * 3} {len(two.nodes) * 3} {A.nnz}\n" + text_of(A))
    names["--coordinates"] = folder / "n.inp"
    names["--dofs"] = folder / "d.csv"
    names["--dofs"].write_text("".join(f"{k},{d}\n" for k in range(1, len(two.nodes) + 1) for d in "123"))
    names["--pairs"] = folder / "p.csv"
    ends = two.ends.tolist()
    names["--pairs"].write_text("".join(f"{a},{b},1,0,0\n" for a, b in zip(ends[:6], ends[6:])))
    return ["import", str(folder / "m.h5"), *(str(word) for pair in names.items() for word in pair)], names


def test_marks_of_editors_change_nothing(tmp_path: Path) -> None:
    command, files = files_of_two(tmp_path)
    assert main(command) == 0
    plain = fw.read_model(tmp_path / "m.h5")
    for path in files.values():
        path.write_bytes(BOM + path.read_bytes())
    assert main(command) == 0
    marked = fw.read_model(tmp_path / "m.h5")
    assert (marked.K != plain.K).nnz == 0 and marked.coordinates.tolist() == plain.coordinates.tolist()
    assert (marked.pairs["contact"].B != plain.pairs["contact"].B).nnz == 0


@pytest.mark.parametrize("form", ["job.sti", "job.mtx", "nodes.csv"])
def test_marks_of_editors_in_columns(form: str, tmp_path: Path) -> None:
    path = tmp_path / form
    path.write_bytes(BOM + (b"1, 0, 0, 0\n2, 1, 0, 0\n" if form == "nodes.csv" else text_of(K).encode()))
    if form == "nodes.csv":
        assert read_node_file(path).numbers.tolist() == [1, 2]
    else:
        path.with_suffix(".dof").write_bytes(BOM + b"".join(b"%d.1\n" % k for k in range(1, 6)))
        assert (read(path) != K).nnz == 0


@pytest.mark.parametrize("name", ["deck.bdf", "beam.cdb", "K.op4"])
def test_marks_before_files_of_other_readers(name: str, tmp_path: Path) -> None:
    """Which would not see their first line: a grid point of a deck was gone."""
    text = {"deck.bdf": "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\n", "beam.cdb": "NBLOCK,6,SOLID\n", "K.op4": "1 1\n"}[name]
    (tmp_path / name).write_bytes(BOM + text.encode())
    with pytest.raises(fw.InputError, match="begins with the mark of UTF-8") as caught:
        read_matrix(str(tmp_path / name), "K") if name == "K.op4" else read_node_file(tmp_path / name)
    subprocess.run((caught.value.fix or "").partition(": ")[2], shell=True, check=True)
    assert (tmp_path / name).read_text() == text


@pytest.mark.parametrize("form", ["nodes", "pairs"])
def test_tables_that_are_cut(form: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    if form == "nodes":
        path.write_text("1, 1.25e-01, 0, 1.50e-02\n2, 1.25e-01, 0, 1.50")
    else:
        path.write_text("1,0,1.0,0,0,1.50e-06\n2,0,1.0,0,0,1.50e-0")
    with pytest.raises(fw.InputError, match="the last line is cut"):
        read_node_file(path) if form == "nodes" else read_pairs("contact", path, np.array([[1, 1], [2, 1]]))


@pytest.mark.parametrize("option", ["--mass", "--stiffness", "--coordinates", "--dofs", "--pairs"])
def test_files_that_are_no_plain_text(option: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    command, files = files_of_two(tmp_path)
    content = files[option].read_bytes()
    with zipfile.ZipFile(tmp_path / "packed.zip", "w") as archive:
        archive.writestr(files[option].name, content)
    zipped = (tmp_path / "packed.zip").read_bytes()
    utf_16 = content.decode().encode("utf-16")
    for packed, fix in ((gzip.compress(content), "gunzip"), (zipped, "unzip"), (utf_16, "iconv")):
        files[option].write_bytes(packed)
        assert main(command) == 2
        said = capfd.readouterr().err
        assert "cannot be read" in said and f"{fix} " in said and files[option].name in said


@pytest.mark.parametrize(
    "head", ["node,x,y,z\n", "# mm\nnode,x,y,z\n", '# mm\n# by hand\n"node","x","y","z"\n', "# mm\n"]
)
def test_comments_and_a_heading(head: str, tmp_path: Path) -> None:
    (tmp_path / "n.csv").write_text(head + "1,0,0,0\n7,1,0.5,0\n")
    found = read_node_file(tmp_path / "n.csv")
    assert found.numbers.tolist() == [1, 7] and found.coordinates[1].tolist() == [1, 0.5, 0]


@pytest.mark.parametrize("head", ["node,z,y,x", '"x","y","z","node"', "node, x [mm], z [mm], y [mm]", "node x z y"])
def test_columns_in_another_order(head: str, tmp_path: Path) -> None:
    """A heading that names the columns is not passed over: x was read where it says z."""
    (tmp_path / "n.csv").write_text(f"# mm\n{head}\n1,0,0,0\n7,1,0.5,0\n")
    with pytest.raises(fw.InputError, match="another order") as caught:
        read_node_file(tmp_path / "n.csv")
    assert "n.csv:2" in (caught.value.where or "") and caught.value.expected == "node,x,y,z"


@pytest.mark.parametrize("mark", [",", ", ", "\t", "\t\t", " \t", " ", "   "])
@pytest.mark.parametrize("unit", ["{}", "{} (mm)", "{} [mm]", "{}(mm)", '"{} (mm)"', "{}/mm", "{} [1e-3 m]"])
@pytest.mark.parametrize("names", ["node x y z", "node z y x", "x y z node", "node number z y x"])
def test_columns_with_units(names: str, unit: str, mark: str, tmp_path: Path) -> None:
    """Whatever parts the columns, with units or without: another order is refused, the right one is read."""
    head, rows = mark.join(unit.format(name) for name in names.split()), (("1", "0", "0", "0"), ("7", "1", "0.5", "0"))
    between = "," if "," in mark else "\t" if "\t" in mark else " "
    (tmp_path / "n.csv").write_text("\n".join([head, *(between.join(row) for row in rows), ""]))
    if names == "node x y z":
        assert read_node_file(tmp_path / "n.csv").coordinates[1].tolist() == [1, 0.5, 0]
        return
    with pytest.raises(fw.InputError, match="another order"):
        read_node_file(tmp_path / "n.csv")


@pytest.mark.parametrize(
    "head",
    ["Node Number,X Location (m),Y,Z", "Node Number X Y Z", "id,x [m],y [m],z [m]", "Node\tX Location (m)\tY\tZ"],
)
def test_headings_of_other_words(head: str, tmp_path: Path) -> None:
    text = "1,0,0,0\n7,1,0.5,0\n"
    (tmp_path / "n.csv").write_text(f"{head}\n{text if ',' in head else text.replace(',', ' ')}")
    assert read_node_file(tmp_path / "n.csv").coordinates[1].tolist() == [1, 0.5, 0]


def test_dofs_in_another_order(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    command, files = files_of_two(tmp_path)
    text = files["--dofs"].read_text()
    files["--dofs"].write_text("direction,node\n" + text)
    assert main(command) == 2 and "another order" in capfd.readouterr().err


def test_directions_as_letters(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The same dofs; what is no direction, and columns between semicolons, are told."""
    command, files = files_of_two(tmp_path)
    assert main(command) == 0
    plain, text = fw.read_model(tmp_path / "m.h5"), files["--dofs"].read_text()
    letters = text.replace(",1\n", ",x\n").replace(",2\n", ", Y\n").replace(",3\n", ",z\n")
    files["--dofs"].write_text("node,direction\n" + letters)
    assert main(command) == 0
    assert fw.read_model(tmp_path / "m.h5").labels.tolist() == plain.labels.tolist()
    capfd.readouterr()
    files["--dofs"].write_text(letters.replace("x", "north"))
    assert main(command) == 2 and "north" in capfd.readouterr().err
    files["--dofs"].write_text(text.replace(",", ";"))
    assert main(command) == 2 and "columns are separated by semicolons" in capfd.readouterr().err


@pytest.mark.parametrize("name", ["beam.txt", "beam", "beam.CDB.bak"])
def test_archives_of_ansys_by_another_name(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("/COM\nNBLOCK,6,SOLID\n(3i9,6e21.13e3)\nN,R5.3,LOC,-1,\n")
    with pytest.raises(fw.InputError, match="another name") as caught:
        read_node_file(tmp_path / name)
    assert f"rename it to {Path(name).stem}.cdb" in (caught.value.fix or "")


@pytest.mark.parametrize("banner", [BANNER.lower(), "\n" + BANNER])
def test_a_case_reads_them_alike(banner: str, tmp_path: Path) -> None:
    whole = f"{banner}5 5 {K.nnz}\n{text_of(K)}"
    (tmp_path / "K.mtx").write_text(whole)
    np.savez(tmp_path / "M.npz", M=np.eye(5))
    (tmp_path / "case.toml").write_text(CASE)
    assert (fw.load_case(tmp_path / "case.toml").structure.K != K).nnz == 0
    (tmp_path / "K.mtx").write_text(whole[:-2])
    with pytest.raises(fw.InputError, match="the last line is cut"):
        fw.load_case(tmp_path / "case.toml")
