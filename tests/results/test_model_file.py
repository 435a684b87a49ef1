"""The native model file: what goes in comes out, on any number of ranks, and cases run from it."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from models import hexahedra
from tolerances import TIGHT

import fretwave as fw
from fretwave.case.load import load_case
from fretwave.commands.main import main
from fretwave.mpi.guard import on_first_rank
from fretwave.results import model_file
from fretwave.results.model_file import dof_name
from fretwave.results.source_file import SourceFile

BAR = hexahedra.bar((3, 1, 1), (0.06, 0.02, 0.01))


#: Dofs of its nodes along x, y, z.
TRIPLES = np.arange(BAR.K.shape[0]).reshape(-1, 3)
SOURCES = [SourceFile("mass", "m.mtx", 12, "ab"), SourceFile("stiffness", "k.mtx", 34, "cd")]


def model_of_a_bar() -> fw.Structure:
    """A free bar whose end x = 0 rests in contact pairs with ground, normal -x."""
    end = BAR.layer(0.0)
    frames = np.broadcast_to([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]], (len(end) // 3, 3, 3))
    selection = sp.csr_matrix((np.ones(len(end)), (np.arange(len(end)), end)), (len(end), BAR.K.shape[0]))
    B = (sp.block_diag(list(frames)) @ selection).tocsr()
    nodes, n = np.arange(1, len(BAR.nodes) + 1), len(BAR.nodes)
    labels = np.column_stack([np.repeat(nodes, 3), np.tile([1, 2, 3], n)])
    names = [dof_name(*(int(part) for part in label)) for label in labels]
    names[-1] = "tip"
    pairs = np.column_stack([end[::3] // 3 + 1, np.zeros(len(end) // 3, dtype=int)])
    areas = np.full(len(pairs), 5e-5)
    flank = fw.Pairs(B, areas=areas, points=BAR.nodes[pairs[:, 0] - 1], frames=frames.copy(), nodes=pairs)
    parts = dict(labels=labels, node_numbers=nodes, coordinates=BAR.nodes, pairs={"flank": flank})
    return fw.Structure(BAR.M, BAR.K, 1e-6 * BAR.K, dofs={"tip": len(names) - 1}, names=names, **parts)


@pytest.fixture
def path(comm, shared_tmp: Path) -> Path:
    written = shared_tmp / "bar.h5"
    on_first_rank(comm, lambda: model_file.write_model(written, model_of_a_bar(), "m-kg-s", SOURCES))
    return written


@pytest.mark.ranks(1)
def test_what_goes_in_comes_out(path: Path) -> None:
    was, found = model_of_a_bar(), fw.read_model(path)
    for letter in ("M", "K", "C"):
        assert (getattr(was, letter) != getattr(found, letter)).nnz == 0
    for key in ("labels", "node_numbers", "coordinates"):
        np.testing.assert_array_equal(getattr(was, key), getattr(found, key))
    for key in ("points", "areas", "frames", "nodes"):
        np.testing.assert_array_equal(getattr(was.pairs["flank"], key), getattr(found.pairs["flank"], key))
    assert (was.pairs["flank"].B != found.pairs["flank"].B).nnz == 0
    assert (found.names, found.dofs) == (was.names, was.dofs)
    assert model_file.read_sources(path) == ("m-kg-s", SOURCES)
    assert not path.with_name("bar.h5.unfinished").exists()


@pytest.mark.ranks(1)
def test_files_as_the_layout_says_are_read(tmp_path: Path) -> None:
    """Written by h5py alone, as format version 1 has been since the beginning."""
    was = model_of_a_bar()
    with h5py.File(tmp_path / "m.h5", "w") as file:
        file.attrs.update(format="fretwave model", format_version=1, units="")
        for place, A in (("M", was.M), ("K", was.K), ("contacts/flank/B", was.pairs["flank"].B)):
            group = file.create_group(place)
            group.attrs["shape"] = A.shape
            for key in ("data", "indices", "indptr"):
                group[key] = getattr(sp.csr_matrix(A), key)
        file["dofs/name"] = np.array([name.encode() for name in was.names])
        file["dofs/node"], file["dofs/direction"] = was.labels.T
        file["dofs/kept"] = [was.n_dof - 1]
        file["nodes/number"], file["nodes/coordinates"] = was.node_numbers, was.coordinates
        file["contacts/flank/positions"] = was.pairs["flank"].points
    found = fw.read_model(tmp_path / "m.h5")
    assert found.complaint() is None and found.C is None and found.dofs == was.dofs
    np.testing.assert_array_equal(found.pairs["flank"].points, was.pairs["flank"].points)
    np.testing.assert_array_equal(found.displacements, np.arange(was.n_dof).reshape(-1, 3))


@pytest.mark.ranks(1)
def test_what_a_file_has_no_place_for_is_not_left_behind(tmp_path: Path) -> None:
    was = model_of_a_bar()
    for lost, said in (
        (replace(was, loads={"pull": np.ones(was.n_dof)}), "loads"),
        (replace(was, sectors=12), "has no faces"),
        (replace(was, sectors=12, low=np.arange(3), high=np.arange(997, 1000)), "the high face does not fit"),
        (replace(was, sectors=12, low=np.arange(3), high=np.arange(3, 5)), "the high face does not fit"),
        (replace(was, sectors=12, low=np.arange(3), high=np.arange(3, 6), axis="r"), "no such axis"),
        (
            replace(was, pairs={"far": fw.Pairs({0: np.ones((3, was.n_dof)), 1: np.ones((3, was.n_dof))})}),
            "there is none",
        ),
        (replace(was, pairs={"far": fw.Pairs({0: np.ones((3, was.n_dof)), -1: np.ones((3, was.n_dof))})}), "beyond"),
        (replace(was, pairs={"one": fw.Pairs(np.ones((1, was.n_dof)), 1)}), "'one' of one component"),
        (replace(was, node_numbers=None, labels=None), "no node_numbers"),
        (replace(was, labels=None, displacements=TRIPLES), "no labels"),
        (replace(was, displacements=TRIPLES[::-1]), "displacements that labels do not give"),
    ):
        with pytest.raises(fw.InputError, match=said):
            fw.write_model(tmp_path / "m.h5", lost)
    assert not (tmp_path / "m.h5").exists()
    fw.write_model(tmp_path / "m.h5", replace(was, displacements=TRIPLES))
    np.testing.assert_array_equal(fw.read_model(tmp_path / "m.h5").displacements, TRIPLES)


@pytest.mark.ranks(1)
def test_grid_of_a_model_with_held_nodes(tmp_path: Path) -> None:
    """Without the dofs of node 1, and rows in another order: each node's own dofs are found, -1 for the held ones."""
    whole = model_of_a_bar()
    rows = np.random.default_rng(3).permutation(np.arange(3, whole.n_dof))
    parts = dict(labels=whole.labels[rows], node_numbers=whole.node_numbers, coordinates=BAR.nodes)
    cells = np.array([[0, 4, 6, 2, 1, 5, 7, 3]])
    kept = fw.Structure(whole.M[rows][:, rows], whole.K[rows][:, rows], names=[whole.names[k] for k in rows], **parts)
    fw.write_model(tmp_path / "m.h5", replace(kept, hexahedra=cells))
    found = fw.read_model(tmp_path / "m.h5")
    assert found.complaint() is None and found.hexahedra.tolist() == cells.tolist()
    assert found.displacements[0].tolist() == [-1, -1, -1]
    np.testing.assert_array_equal(rows[found.displacements[1:]], np.arange(3, whole.n_dof).reshape(-1, 3))
    with pytest.raises(fw.InputError, match="a node of a cell does not exist"):
        fw.write_model(tmp_path / "m.h5", replace(kept, hexahedra=cells + len(BAR.nodes)))


@pytest.mark.ranks(1)
def test_parts_may_be_left_out(tmp_path: Path) -> None:
    fw.write_model(tmp_path / "m.h5", fw.Structure(sp.eye(2), sp.eye(2), names=["a", "b"]))
    found = fw.read_model(tmp_path / "m.h5")
    assert found.C is None and found.labels is None and found.dofs == {} and found.coordinates is None
    assert found.pairs == {} and model_file.read_sources(tmp_path / "m.h5") == ("", [])


def test_modes_on_any_number_of_ranks(comm, path: Path) -> None:
    """Against dense eigenvalues, with stuck contact of known stiffness."""
    found = on_first_rank(comm, lambda: model_file.read_model(path))
    stiffness = {"normal_stiffness": 3e8, "tangential_stiffness": 2e8}
    law = {**stiffness, "friction_coefficient": 0.5, "normal_load": 100.0}
    contact = fw.Contact("coulomb_3d", found.pairs["flank"].B, law, name="flank")
    springs = np.tile([3e8, 2e8, 2e8], found.pairs["flank"].n_pairs)
    stuck = BAR.K + found.pairs["flank"].B.T @ sp.diags(springs) @ found.pairs["flank"].B
    with fw.Model(found.M, found.K, contacts=[contact], comm=comm) as model:
        modes = fw.linear_modes(model, 12, "stuck")
    exact = np.sqrt(scipy.linalg.eigh(stuck.toarray(), BAR.M.toarray(), eigvals_only=True)[:12])
    np.testing.assert_allclose([mode.omega for mode in modes], exact, rtol=TIGHT)


def damaged(path: Path, change) -> None:
    with h5py.File(path, "r+") as file:
        change(file)


def drop(place: str):
    def change(file: h5py.File) -> None:
        del file[place]

    return change


def put(place: str, values):
    def change(file: h5py.File) -> None:
        del file[place]
        file[place] = values

    return change


WRONG = {
    "no stiffness": (drop("K"), "there is no matrix K"),
    "no indices": (drop("M/indices"), "damaged"),
    "cut entries": (put("M/data", np.ones(3)), "damaged"),
    "names": (put("dofs/name", np.array([b"a", b"a"])), "1 different names"),
    "table": (put("dofs/node", np.arange(3)), "dofs/node does not fit"),
    "kept": (put("dofs/kept", np.array([999])), "a kept dof does not exist"),
    "areas": (put("contacts/flank/areas", np.ones(3)), "contacts/flank/areas does not fit"),
    "size": (lambda file: file["C"].attrs.update(shape=[3, 3]), "damaged"),
    "later version": (lambda file: file.attrs.update(format_version=3), "later version"),
    "another format": (lambda file: file.attrs.update(format="other"), "format 'other'"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_files(path: Path, wrong: str) -> None:
    change, said = WRONG[wrong]
    damaged(path, change)
    with pytest.raises(fw.InputError, match=said) as raised:
        model_file.read_model(path)
    assert raised.value.fix


@pytest.mark.ranks(1)
def test_no_model_file(tmp_path: Path) -> None:
    (tmp_path / "blade.h5").write_text("text")
    with pytest.raises(fw.InputError, match="no model file"):
        model_file.read_model(tmp_path / "blade.h5")
    with pytest.raises(fw.InputError, match="did you mean `blade.h5`"):
        model_file.read_model(tmp_path / "blade.hdf5")


@pytest.mark.ranks(1)
def test_parts_that_do_not_fit_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(fw.InputError, match="K does not fit M"):
        model_file.write_model(tmp_path / "m.h5", fw.Structure(sp.eye(2), sp.eye(3), names=["a", "b"]))
    with pytest.raises(fw.InputError, match="cannot be written"):
        model_file.write_model(tmp_path / "no" / "m.h5", fw.Structure(sp.eye(2), sp.eye(2), names=["a", "b"]))
    assert list(tmp_path.iterdir()) == []


CASE = """
[model]
file = "bar.h5"
[reduction]
modes = 8
[preload]
[[contact]]
name = "flank"
law = "coulomb_3d"
normal_stiffness_per_area = 6e12
tangential_stiffness = 2e8
friction_coefficient = 0.5
normal_load = 100.0
[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
samples = 64
normalise = "tip"
amplitude = [1e-8, 2e-8]
"""


@pytest.mark.ranks(1)
def test_a_complex_matrix_is_not_written(tmp_path: Path) -> None:
    """Its real part was; the file that was there stays."""
    there = tmp_path / "model.h5"
    fw.write_model(there, fw.Structure(np.eye(2), np.diag([1.0, 2.0])))
    for given in ({"K": np.diag([1.0, 2.0j])}, {"C": sp.csr_matrix(np.diag([1.0, 1.0j]))}):
        with pytest.raises(fw.InputError, match="a matrix is complex"):
            fw.write_model(there, fw.Structure(**{"M": np.eye(2), "K": np.diag([1.0, 2.0]), **given}))
    assert fw.read_model(there).K.toarray().tolist() == [[1.0, 0.0], [0.0, 2.0]]


@pytest.mark.ranks(1)
def test_case_from_a_model_file(path: Path) -> None:
    """Names of dofs, contacts with their areas, and what a reduction keeps come with the file."""
    case_file = path.with_name("case.toml")
    case_file.write_text(CASE.replace("[reduction]\nmodes = 8\n[preload]\n", ""))
    case = load_case(case_file)
    assert case.dof("tip") == len(case.dofs) - 1 and case.dof("n1x") == 0
    assert (case.K != BAR.K).nnz == 0 and case.structure.C is not None
    assert (case.contacts[0].pairs.own != model_of_a_bar().pairs["flank"].B).nnz == 0
    np.testing.assert_allclose(case.contacts[0].parameters["normal_stiffness"], 6e12 * 5e-5)
    assert case.resolved["model.file"].startswith("bar.h5 ")


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"bar.h5"', '"baar.h5"', "case.toml:3 (model.file)"),
        ('"bar.h5"', '"bar.h5"\nbuilder = "model.py"', "several places: builder, file"),
        ('"bar.h5"', '"bar.h5"\nM = [[1.0]]', "several places: file, M"),
        ('"bar.h5"', '"bar.h5"\noptions = { a = 1 }', "options but no builder"),
        ('"flank"', '"flak"', "did you mean `flank`?"),
        ('"tip"', '"n1w"', "unknown dof 'n1w'"),
    ],
)
def test_wrong_cases(path: Path, old: str, new: str, said: str, capfd) -> None:
    case_file = path.with_name("case.toml")
    case_file.write_text(CASE.replace(old, new, 1))
    assert main(["check", str(case_file)]) == 2
    assert said in capfd.readouterr().err


def test_run_from_a_model_file(comm, path: Path) -> None:
    """At small amplitude the mode is the linear mode with stuck contact; reduced, on any number of ranks."""
    folder = path.parent
    if comm.rank == 0:
        (folder / "case.toml").write_text(CASE)
    comm.barrier()
    assert main(["run", str(folder / "case.toml"), "--out", str(folder / "run"), "--no-plots"]) == 0
    with (folder / "run" / "mode.csv").open() as file:
        rows = list(csv.DictReader(file))
    found = model_of_a_bar().pairs["flank"].B
    stuck = BAR.K + found.T @ sp.diags(np.tile([3e8, 2e8, 2e8], found.shape[0] // 3)) @ found
    exact = np.sqrt(scipy.linalg.eigh(stuck.toarray(), BAR.M.toarray(), eigvals_only=True)[0])
    assert len(rows) >= 2
    # Eight component modes: the first frequency is in error by 1e-4 at most, from above.
    assert 0 <= float(rows[0]["omega0"]) / exact - 1 < 1e-4
