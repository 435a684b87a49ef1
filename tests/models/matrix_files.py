"""A small model and a writer for every matrix format that is imported."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import scipy.io
import scipy.sparse as sp
from models import hexahedra
from petsc4py import PETSc


class Held:
    """A bar held at x = 0: matrices of the free dofs, and node (from 1) and direction of each."""

    def __init__(self) -> None:
        self.bar = hexahedra.bar((3, 2, 1), (0.06, 0.02, 0.01))
        self.free = np.setdiff1d(np.arange(self.bar.K.shape[0]), self.bar.layer(0.0))
        self.M, self.K = (symmetric(A[self.free][:, self.free]) for A in (self.bar.M, self.bar.K))
        self.labels = np.column_stack([self.free // 3 + 1, self.free % 3 + 1])


def symmetric(A: sp.csr_matrix) -> sp.csr_matrix:
    """Without the rounding of the assembly: a triangle then says all."""
    lower = sp.tril(A, -1)
    return (lower + lower.T + sp.diags(A.diagonal())).tocsr()


def text_of(A: sp.spmatrix, line: Callable[[int, int, float], str]) -> str:
    found = A.tocoo()
    return "".join(line(i, j, v) + "\n" for i, j, v in zip(found.row.tolist(), found.col.tolist(), found.data.tolist()))


# One writer a format: (folder, matrix, letter, labels) -> what --mass or --stiffness is given.


def write_npz(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    sp.save_npz(folder / f"{letter}.npz", A)
    return str(folder / f"{letter}.npz")


def write_dense_npz(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    np.savez(folder / f"{letter}d.npz", **{letter: A.toarray(), "other": np.zeros((3, 3))})
    return str(folder / f"{letter}d.npz")


def write_npy(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    np.save(folder / f"{letter}.npy", A.toarray())
    return str(folder / f"{letter}.npy")


def write_mtx(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    scipy.io.mmwrite(str(folder / f"{letter}.mtx"), A, symmetry="symmetric", precision=17)
    return str(folder / f"{letter}.mtx")


def write_general_mtx(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    scipy.io.mmwrite(str(folder / f"{letter}g.mtx"), A, symmetry="general", precision=17)
    return str(folder / f"{letter}g.mtx")


def write_v5(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    scipy.io.savemat(folder / f"{letter}5.mat", {"A": A, "x": "text"})
    return f"{folder / letter}5.mat:A"


def write_v73(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    """As MATLAB's ``save -v7.3``: 512 bytes of heading, then HDF5."""
    path, columns = folder / f"{letter}73.mat", A.tocsc()
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group({"M": "mass", "K": "stiffness"}[letter])
        group.attrs["MATLAB_class"] = np.bytes_("double")
        group.attrs["MATLAB_sparse"] = np.uint64(A.shape[0])
        group["data"], group["ir"] = columns.data, columns.indices.astype("u8")
        group["jc"] = columns.indptr.astype("u8")
        file["full"] = np.arange(6.0).reshape(2, 3)
    heading = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + struct.pack("<H", 0x0200) + b"IM"
    with path.open("r+b") as file:
        file.write(heading)
    return str(path)


def write_petsc(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    mat = PETSc.Mat().createAIJ(A.shape, csr=(A.indptr, A.indices, A.data), comm=PETSc.COMM_SELF)
    viewer = PETSc.Viewer().createBinary(str(folder / f"{letter}.bin"), "w", comm=PETSc.COMM_SELF)
    mat.view(viewer)
    viewer.destroy()
    return str(folder / f"{letter}.bin")


def write_dense_petsc(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    mat = PETSc.Mat().createDense(A.shape, array=A.toarray(), comm=PETSc.COMM_SELF)
    viewer = PETSc.Viewer().createBinary(str(folder / f"{letter}d.bin"), "w", comm=PETSc.COMM_SELF)
    viewer.pushFormat(PETSc.Viewer.Format.NATIVE)
    mat.view(viewer)
    viewer.destroy()
    return str(folder / f"{letter}d.bin")


def write_long_petsc(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    """As PETSc with 64-bit indices writes it."""
    integers = [[1211216, *A.shape, A.nnz], np.diff(A.indptr), A.indices]
    content = b"".join(np.asarray(part).astype(">i8").tobytes() for part in integers) + A.data.astype(">f8").tobytes()
    (folder / f"{letter}64.bin").write_bytes(content)
    return str(folder / f"{letter}64.bin")


def write_calculix(folder: Path, A: sp.csr_matrix, letter: str, labels: np.ndarray) -> str:
    """Upper triangle, column by column, "%d %d %20.13e" (CalculiX, matrixstorage.c)."""
    path = folder / ("job.mas" if letter == "M" else "job.sti")
    upper = sp.triu(A).tocsc().T  # rows of the transpose: columns in their order
    path.write_text(text_of(upper.tocsr(), lambda i, j, v: f"{j + 1} {i + 1} {v:20.13e}"))
    path.with_suffix(".dof").write_text("".join(f"{node}.{direction}\n" for node, direction in labels))
    return str(path)


def write_abaqus(folder: Path, A: sp.csr_matrix, letter: str, labels: np.ndarray) -> str:
    """Matrix input (Abaqus Keywords Reference, *MATRIX INPUT): a triangle in an order of dofs of the code's own."""
    order = np.random.default_rng(1).permutation(len(labels))
    names = [f"{node},{direction}" for node, direction in labels[order]]
    lower = sp.tril(A[order][:, order])
    lines = text_of(lower, lambda i, j, v: f"{names[i]}, {names[j]}, {v:.16e}")
    (folder / f"job_{letter}1.mtx").write_text("** Abaqus\n" + lines)
    return str(folder / f"job_{letter}1.mtx")


def write_coordinate(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    """FORMAT=COORDINATE: row, column, entry, all entries."""
    (folder / f"job_{letter}2.mtx").write_text(text_of(A, lambda i, j, v: f"{i + 1} {j + 1} {v:.16e}"))
    return str(folder / f"job_{letter}2.mtx")


EXACT = {
    "npz": write_npz,
    "dense npz": write_dense_npz,
    "npy": write_npy,
    "Matrix Market": write_mtx,
    "Matrix Market, general": write_general_mtx,
    "MATLAB 5": write_v5,
    "MATLAB 7.3": write_v73,
    "PETSc": write_petsc,
    "PETSc, dense": write_dense_petsc,
    "PETSc, 64-bit": write_long_petsc,
    "Abaqus, matrix input": write_abaqus,
    "Abaqus, coordinate": write_coordinate,
}
