"""Damaged files are named, nothing is overwritten (long form: cases/robustness/damaged_files.py)."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

sys.path.insert(0, str(Path(__file__).parents[2] / "cases" / "robustness"))
from command_line import call
from damaged_files import damaged, matrices, state_of, write_petsc
from test_results import fill, writer

from fretwave.errors import InputError
from fretwave.files.isolated import call_isolated
from fretwave.files.whole import SEAL_LENGTH, FileError, check_whole, replace_bytes, replaced, seal, sealed_size
from fretwave.importers import read_matrix
from fretwave.model.structure import Structure
from fretwave.results import model_file
from fretwave.results.record import read_record, write_record
from fretwave.results.results import open_results

pytestmark = pytest.mark.ranks(1)

RECORD = {
    "run_id": "1",
    "started": "2026-01-01T00:00:00",
    "status": "done",
    "ranks": 1,
    "selected": ["mode"],
    "case": {"path": "a.toml", "overrides": [], "only": [], "quick": False, "petsc": "", "resolved": {"x": 1.5}},
    "analyses": {"mode": {"status": "done", "reason": "", "points": 3, "wall_s": 0.1}},
}


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    table = writer(folder)
    fill(table, 6)
    table.close("done", "")
    return folder


def test_every_byte_of_results_counts(results: Path, tmp_path: Path) -> None:
    """Changed anywhere, cut anywhere: never read as if it were whole."""
    content = (results / "results.h5").read_bytes()
    random, path = np.random.default_rng(0), tmp_path / "results.h5"
    for at in random.integers(len(content) - SEAL_LENGTH, size=40):
        path.write_bytes(content[:at] + bytes([content[at] ^ 1 << int(random.integers(8))]) + content[at + 1 :])
        with pytest.raises(InputError, match=r"results\.h5 (is damaged|cannot be opened)"):
            open_results(path)
    for size in (0, 7, 2000, len(content) - SEAL_LENGTH - 1, len(content) - 1):
        path.write_bytes(content[:size])
        with pytest.raises(InputError, match=r"results\.h5 (is damaged|cannot be opened)"):
            open_results(path)


def test_another_program_may_change_results(results: Path, tmp_path: Path) -> None:
    """HDF5 takes the seal off what it writes to; the file is then read through before it is believed."""
    shutil.copy(results / "results.h5", tmp_path)
    with h5py.File(tmp_path / "results.h5", "r+") as file:
        file["mode"].attrs["note"] = "mine"
    assert sealed_size(tmp_path / "results.h5") is None
    with open_results(tmp_path / "results.h5") as file:
        assert file["mode"].attrs["note"] == "mine"


def test_show_and_resume_leave_a_damaged_folder_as_it_is(results: Path, tmp_path: Path, capsys) -> None:
    folder = tmp_path / "run"
    shutil.copytree(results, folder)
    write_record(folder, RECORD)
    content = bytearray((folder / "results.h5").read_bytes())
    content[3000:3100] = bytes(100)
    (folder / "results.h5").write_bytes(content)
    before = state_of(folder, folder / "nothing")
    for command in ("show", "plot"):
        assert call(command, folder) == 2
        said = capsys.readouterr().err
        assert "results.h5 is damaged" in said and "  fix: " in said
    assert state_of(folder, folder / "nothing") == before


@pytest.mark.parametrize("seed", range(40))
def test_damaged_records_are_named(tmp_path: Path, seed: int) -> None:
    write_record(tmp_path, RECORD)
    assert read_record(tmp_path)["case"]["resolved"] == {"x": 1.5}
    path = tmp_path / "run.json"
    _, content = damaged(path.read_bytes(), np.random.default_rng(seed))
    whole = json.loads(path.read_text())
    path.write_bytes(content)
    try:
        assert read_record(tmp_path) == {key: value for key, value in whole.items() if key != "checksum"}
    except InputError as error:
        assert "run.json is damaged" in str(error)


@pytest.mark.parametrize("key", ["run_id", "case", "analyses", "ranks"])
def test_records_without_a_checksum_must_say_what_a_run_says(tmp_path: Path, key: str) -> None:
    (tmp_path / "run.json").write_text(json.dumps({**RECORD, key: ["no"]}))
    with pytest.raises(InputError, match=f"(?s)damaged.*{key}"):
        read_record(tmp_path)
    (tmp_path / "run.json").write_text(json.dumps(RECORD))
    assert read_record(tmp_path)["ranks"] == 1


def test_damaged_model_files_are_named(tmp_path: Path) -> None:
    M, K = matrices()
    path = tmp_path / "model.h5"
    model_file.write_model(path, Structure(M, K, names=[f"d{k}" for k in range(40)]))
    content = path.read_bytes()
    assert model_file.read_model(path).K.nnz == K.nnz
    random = np.random.default_rng(2)
    for _ in range(10):
        path.write_bytes(damaged(content, random)[1])
        if path.read_bytes() != content and path.read_bytes() != content[:-SEAL_LENGTH]:
            with pytest.raises(InputError):
                model_file.read_model(path)


def test_indices_of_a_model_file_without_a_seal_are_checked(tmp_path: Path) -> None:
    """SciPy would read beyond its arrays."""
    M, K = matrices()
    path = tmp_path / "model.h5"
    model_file.write_model(path, Structure(M, K, names=[f"d{k}" for k in range(40)]))
    with h5py.File(path, "r+") as file:
        file["K/indices"][3] = 10**8
    with pytest.raises(InputError, match="damaged"):
        model_file.read_model(path)


def huge_petsc(path: Path, K: sp.csr_matrix) -> None:
    write_petsc(path, K)
    content = bytearray(path.read_bytes())
    content[4:8] = (2**31 - 1).to_bytes(4, "big")
    path.write_bytes(content)


def wild_petsc(path: Path, K: sp.csr_matrix) -> None:
    wrong = K.copy()
    wrong.indices = wrong.indices.copy()
    wrong.indices[5] = 2**30
    write_petsc(path, wrong)


def negative_petsc(path: Path, K: sp.csr_matrix) -> None:
    """A row of -(2^30) entries, so that all of them are fewer than none."""
    write_petsc(path, K)
    content = bytearray(path.read_bytes())
    content[4 * (4 + 24)] = 0xC0
    path.write_bytes(content)


def negative_npz(path: Path, K: sp.csr_matrix) -> None:
    wrong = K.copy()
    wrong.indptr = wrong.indptr.copy()
    wrong.indptr[-1] = -4
    sp.save_npz(path, wrong)


def wild_matlab(path: Path, K: sp.csr_matrix) -> None:
    scipy.io.savemat(str(path), {"K": K.tocsc()})
    content = path.read_bytes()
    rows = K.tocsc().indices.astype("<i4").tobytes()
    path.write_bytes(content.replace(rows, np.full(K.nnz, 2**30, "<i4").tobytes()))


def huge_market(path: Path, K: sp.csr_matrix) -> None:
    path.write_text("%%MatrixMarket matrix coordinate real general\n40 40 1000000000000\n1 1 1.0\n")


def huge_index(path: Path, K: sp.csr_matrix) -> None:
    path.write_text("1 1 2.0\n2 2 2.0\n2 1000000000000 -1.0\n")


def wild_npz(path: Path, K: sp.csr_matrix) -> None:
    wrong = K.copy()
    wrong.indptr = wrong.indptr.copy()
    wrong.indptr[3] = 10**8
    sp.save_npz(path, wrong)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (huge_petsc, "K.petsc"),
        (wild_petsc, "K.petsc"),
        (negative_petsc, "K.petsc"),
        (wild_matlab, "K.mat"),
        (huge_market, "K.mtx"),
        (huge_index, "K.sti"),
        (wild_npz, "K.npz"),
        (negative_npz, "K.npz"),
    ],
)
def test_sizes_and_indices_of_imports_are_not_believed(tmp_path: Path, make, name: str) -> None:
    path = tmp_path / name
    make(path, matrices()[1])
    with pytest.raises(InputError) as found:
        read_matrix(str(path), "K")
    assert name in str(found.value)


def test_an_archive_named_in_a_case_is_not_believed_either(tmp_path: Path, capsys) -> None:
    negative_npz(tmp_path / "K.npz", matrices()[1])
    sp.save_npz(tmp_path / "M.npz", matrices()[0])
    (tmp_path / "case.toml").write_text('[model]\nM = "M.npz"\nK = "K.npz"\n')
    assert call("check", tmp_path / "case.toml") == 2
    assert "K.npz" in capsys.readouterr().err


def test_a_reader_that_crashes_ends_in_words() -> None:
    with pytest.raises(InputError, match="SIGSEGV"):
        call_isolated("ctypes", "string_at", 1)
    with pytest.raises(InputError, match="MemoryError"):
        call_isolated("numpy", "ones", 2**40)


# Writing


def test_a_file_is_replaced_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    replace_bytes(path, b"old")
    with pytest.raises(ZeroDivisionError), replaced(path) as fresh:
        fresh.write_bytes(b"half")
        raise ZeroDivisionError
    assert path.read_bytes() == b"old" and [entry.name for entry in tmp_path.iterdir()] == ["a.txt"]


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="file/a.csv"):
        replace_bytes(tmp_path / "file" / "a.csv", b"")


def test_seals(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(1000.0)
    size = path.stat().st_size
    seal(path)
    assert sealed_size(path) == size
    check_whole(path, "the file")
    with h5py.File(path) as file:
        assert np.array_equal(file["x"], np.arange(1000.0))
