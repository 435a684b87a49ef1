"""The native model file: matrices, names, nodes and contact maps in one HDF5 file.

Written by ``fretwave import`` (or `write`), read by ``[model] file = "blade.h5"``. One rank reads and writes it with
serial h5py calls; `fretwave.Model` distributes the rows. Numbers are float64 and int64 (indices of CSR: int32 or int64,
from 0).

=========================  ===================================================================================
place                      content
=========================  ===================================================================================
``/`` (attributes)         ``format`` = "fretwave model", ``format_version`` = 1, ``units`` (free text)
``/M``, ``/K``, ``/C``     groups ``data``, ``indices``, ``indptr`` of the CSR form, attribute ``shape``; both triangles
                           are stored; ``/C`` is optional
``/dofs/name``             (n_dof,) unique names, in the order of the rows
``/dofs/node``             (n_dof,) node number, optional
``/dofs/direction``        (n_dof,) 1, 2, 3 displacements along x, y, z; 4, 5, 6 rotations; optional, with ``node``
``/dofs/kept``             (n,) dofs that a reduction shall keep beside those of the contacts, optional
``/nodes/number``          (n_nodes,) node numbers, optional
``/nodes/coordinates``     (n_nodes, 3), optional, with ``number``
``/cells/hexahedra``       (n_cells, 8 or 20) places in ``/nodes``, in the order of C3D8 and C3D20 (and VTK), optional
``/contacts/<name>/B``     CSR group as the matrices, (3 n_pairs, n_dof): u = B x, rows (normal, tangent, tangent) pair
                           by pair, u_n > 0 closes the contact
``/contacts/<name>/...``   ``positions`` (n_pairs, 3), ``areas`` (n_pairs,), ``frames`` (n_pairs, 3, 3) with rows normal
                           (from the first body to the second), tangent, tangent, ``nodes`` (n_pairs, 2), 0 for ground;
                           each optional
``/sources``               what the file was made from: ``role``, ``path``, ``bytes``, ``sha256``, (n,) each
=========================  ===================================================================================
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..errors import InputError
from ..files.compressed import check_compressed
from ..files.whole import Unfailing, check_whole, replaced, seal
from ..texts import display, nearest

if TYPE_CHECKING:
    from ..model.structure import BuiltModel

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

FORMAT, VERSION = "fretwave model", 1
#: Names of the directions 1 to 6 in a dof's name.
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass
class ContactMap:
    """Contact pairs of a model file, without a law.

    Attributes
    ----------
    B : (3 n_pairs, n_dof) CSR
        u = B x, rows (normal, tangent, tangent) pair by pair; u_n > 0 closes the contact.
    positions : (n_pairs, 3) or None
    areas : (n_pairs,) or None
    frames : (n_pairs, 3, 3) or None
        Rows: normal, from the first body to the second, and two tangents.
    nodes : (n_pairs, 2) or None
        First and second node of each pair, 0 for ground.
    """

    name: str
    B: sp.csr_matrix
    positions: Array | None = None
    areas: Array | None = None
    frames: Array | None = None
    nodes: IntArray | None = None

    @property
    def pairs(self) -> int:
        return int(self.B.shape[0] // 3)


@dataclass(frozen=True)
class SourceFile:
    """A file the model was made from."""

    role: str
    path: str
    bytes: int
    sha256: str

    @classmethod
    def of(cls, role: str, path: Path) -> SourceFile:
        return cls(role, path.name, path.stat().st_size, digest(path))


@dataclass
class FileModel:
    """What a model file holds.

    Attributes
    ----------
    M, K, C : (n_dof, n_dof) CSR, C may be None
    names : list of str
        Of the dofs.
    node, direction : (n_dof,) or None
        Node number and direction (1 to 6) of each dof.
    kept : (n,) or None
        Dofs a reduction shall keep beside those of the contacts.
    node_numbers, coordinates : (n_nodes,), (n_nodes, 3) or None
    hexahedra : (n_cells, 8 or 20) or None
        Rows of the nodes of each cell.
    contacts : dict of ContactMap by name
    """

    M: sp.csr_matrix
    K: sp.csr_matrix
    C: sp.csr_matrix | None
    names: list[str]
    node: IntArray | None = None
    direction: IntArray | None = None
    kept: IntArray | None = None
    node_numbers: IntArray | None = None
    coordinates: Array | None = None
    hexahedra: IntArray | None = None
    contacts: dict[str, ContactMap] = field(default_factory=dict)
    units: str = ""
    sources: list[SourceFile] = field(default_factory=list)

    @property
    def size(self) -> int:
        return int(self.M.shape[0])

    def built(self) -> BuiltModel:
        """As a builder gives it: contacts by name, and the dofs a reduction keeps."""
        from ..model.structure import BuiltContact, BuiltModel

        contacts = {
            name: BuiltContact(c.B, 3, areas=c.areas, points=c.positions, frames=c.frames)
            for name, c in self.contacts.items()
        }
        kept = {self.names[dof]: int(dof) for dof in (() if self.kept is None else self.kept)}
        grid: dict[str, Any] = {}
        if self.coordinates is not None and self.node is not None:
            grid = dict(coordinates=self.coordinates, displacements=self._displacements(), hexahedra=self.hexahedra)
        return BuiltModel(self.M, self.K, self.C, kept, contacts, **grid)

    def _displacements(self) -> IntArray:
        """Dof (n_nodes, 3) of each node along x, y and z, -1 where the matrices have none: it is held."""
        assert self.node is not None and self.direction is not None and self.node_numbers is not None
        order = np.argsort(self.node_numbers)
        place = np.clip(np.searchsorted(self.node_numbers, self.node, sorter=order), 0, len(order) - 1)
        rows, dofs = order[place], np.arange(self.size)
        shown = (self.node_numbers[rows] == self.node) & (self.direction <= 3)
        found = np.full((len(order), 3), -1, dtype=np.int64)
        found[rows[shown], self.direction[shown] - 1] = dofs[shown]
        return found


def dof_name(node: int, direction: int) -> str:
    """``n17y``: a name TOML takes as a key without quotes, and ``--set`` does not mistake for a number."""
    known = 1 <= direction <= len(DIRECTIONS)
    return f"n{node}" + (DIRECTIONS[direction - 1] if known else f"d{direction}")


def digest(path: Path) -> str:
    """SHA-256 of a file's content."""
    found = hashlib.sha256()
    with path.open("rb") as file:
        for block in iter(lambda: file.read(1 << 22), b""):
            found.update(block)
    return found.hexdigest()


def write(path: str | Path, model: FileModel) -> None:
    """Write a model file. One rank only; an old file is replaced once the new one is complete.

    Raises
    ------
    InputError
        The parts do not fit each other.
    """
    import h5py

    _check(model, str(path))
    path = Path(path)
    if path.is_dir() or not path.parent.is_dir():
        measured = "a folder of this name" if path.is_dir() else "no such folder"
        fix, expected = "choose another place", "a file in a folder that exists"
        raise InputError("the model file cannot be written", display(path), measured, expected, fix)
    with replaced(path, own=True) as fresh:
        raw = Unfailing(fresh)
        with h5py.File(raw, "w") as file:
            file.attrs.update(format=FORMAT, format_version=VERSION, units=model.units)
            _write_parts(file, model)
        raw.close()
        seal(fresh)


def _write_parts(file: Any, model: FileModel) -> None:
    for letter in ("M", "K", "C"):
        if getattr(model, letter) is not None:
            _write_sparse(file.create_group(letter), getattr(model, letter))
    file["dofs/name"] = np.array([name.encode() for name in model.names])
    _write_arrays(file, {table: getattr(model, name) for table, name in zip(_TABLES, _ARRAYS)})
    for name, contact in model.contacts.items():
        _write_sparse(file.create_group(f"contacts/{name}/B"), contact.B)
        _write_arrays(file[f"contacts/{name}"], {key: getattr(contact, key) for key in _PAIR_ARRAYS})
    for key in ("role", "path", "sha256"):
        file[f"sources/{key}"] = np.array([getattr(s, key).encode() for s in model.sources], dtype="S")
    file["sources/bytes"] = np.array([s.bytes for s in model.sources], dtype="<i8")


_PAIR_ARRAYS = ("positions", "areas", "frames", "nodes")
_ARRAYS = ("node", "direction", "kept", "node_numbers", "coordinates", "hexahedra")
_TABLES = ("dofs/node", "dofs/direction", "dofs/kept", "nodes/number", "nodes/coordinates", "cells/hexahedra")


def _write_arrays(group: Any, arrays: Mapping[str, Any]) -> None:
    for name, values in arrays.items():
        if values is not None:
            values = np.asarray(values)
            group[name] = values.astype("<f8" if values.dtype.kind == "f" else "<i8")


def _write_sparse(group: Any, matrix: Any) -> None:
    rows = sp.csr_matrix(matrix, dtype=float)
    rows.sort_indices()
    group.attrs["shape"] = np.array(rows.shape, dtype="<i8")
    for key in ("data", "indices", "indptr"):
        group[key] = getattr(rows, key)


def read(path: str | Path) -> FileModel:
    """Read a model file. One rank only (see `fretwave.mpi.guard.on_first_rank`).

    Raises
    ------
    InputError
        The file is missing, is no model file, is of a later version or is damaged.
    """
    path = Path(path)
    with _opened(path) as file:
        try:
            model = _read_parts(file)
        except (KeyError, OSError, ValueError, TypeError, AttributeError, RuntimeError, OverflowError) as error:
            raise InputError(
                "the model file is damaged",
                display(path),
                str(error).strip("'\""),
                f"the layout of format version {VERSION}",
                "write it again with `fretwave import`",
            ) from None
    _check(model, display(path))
    return model


def _opened(path: Path) -> Any:
    import h5py

    fix = "write it with `fretwave import`"
    if not path.is_file():
        names = sorted(entry.name for entry in path.parent.iterdir()) if path.parent.is_dir() else []
        raise InputError("the model file does not exist", display(path), fix=nearest(path.name, names) or fix)
    try:
        check_whole(path, "the model file")
        file = h5py.File(path, "r")
        kind, version = str(file.attrs.get("format", "none")), int(file.attrs.get("format_version", 0))
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        raise InputError("this is no model file", display(path), str(error), "an HDF5 file", fix) from None
    if kind == FORMAT and version <= VERSION:
        return file
    file.close()
    if kind != FORMAT:
        raise InputError("this is no model file", display(path), f"format '{kind}'", f"format '{FORMAT}'", fix)
    raise InputError(
        "the model file is of a later version",
        display(path),
        f"format version {version}",
        f"at most {VERSION}",
        "update fretwave, or import the matrices again",
    )


def _read_parts(file: Any) -> FileModel:
    matrices = {letter: _read_sparse(file[letter]) if letter in file else None for letter in ("M", "K", "C")}
    missing = [letter for letter in ("M", "K") if matrices[letter] is None]
    if missing:
        raise KeyError(f"there is no matrix {missing[0]}")
    sources = file.get("sources", {})
    columns = [sources[key][()] for key in ("role", "path", "bytes", "sha256")] if len(sources) else []
    return FileModel(
        **matrices,
        names=[name.decode() for name in file["dofs/name"][()]],
        **dict(zip(_ARRAYS, (_array(file, table) for table in _TABLES))),
        contacts={name: _read_contact(name, group) for name, group in file.get("contacts", {}).items()},
        units=str(file.attrs.get("units", "")),
        sources=[SourceFile(a.decode(), b.decode(), int(c), d.decode()) for a, b, c, d in zip(*columns)],
    )


def _array(group: Any, name: str) -> Any:
    return group[name][()] if name in group else None


def _read_contact(name: str, group: Any) -> ContactMap:
    return ContactMap(name, _read_sparse(group["B"]), **{key: _array(group, key) for key in _PAIR_ARRAYS})


def _read_sparse(group: Any) -> sp.csr_matrix:
    parts = tuple(group[key][()] for key in ("data", "indices", "indptr"))
    matrix = sp.csr_matrix(parts, shape=tuple(int(n) for n in group.attrs["shape"]))
    check_compressed(matrix)
    return matrix


def _check(model: FileModel, where: str) -> None:
    """The parts fit each other."""
    n = model.size

    def wrong(what: str, measured: object, expected: object) -> InputError:
        return InputError(what, where, measured, expected, "write the file again with matching parts")

    for letter in ("M", "K", "C"):
        matrix = getattr(model, letter)
        if matrix is not None and matrix.shape != (n, n):
            raise wrong(f"{letter} does not fit M", f"{matrix.shape}", f"{(n, n)}")
    if len(model.names) != n or len(set(model.names)) != n:
        raise wrong("the names of the dofs do not fit", f"{len(set(model.names))} different names", f"{n}, one per dof")
    for name, values, length in _lengths(model):
        if values is not None and len(values) != length:
            raise wrong(f"{name} does not fit", f"{len(values)} values", length)
    cells, nodes = model.hexahedra, 0 if model.node_numbers is None else len(model.node_numbers)
    if cells is not None and cells.size and not 0 <= cells.min() <= cells.max() < nodes:
        raise wrong("a node of a cell does not exist", f"{cells.min()} to {cells.max()}", f"0 to {nodes - 1}")
    if model.kept is not None and len(model.kept) and not 0 <= min(model.kept) <= max(model.kept) < n:
        raise wrong("a kept dof does not exist", f"{min(model.kept)} to {max(model.kept)}", f"0 to {n - 1}")


def _lengths(model: FileModel) -> Sequence[tuple[str, Any, int]]:
    """Every array with the length it must have."""
    nodes = 0 if model.node_numbers is None else len(model.node_numbers)
    table: list[tuple[str, Any, int]] = [
        ("dofs/node", model.node, model.size),
        ("dofs/direction", model.direction, model.size),
    ]
    table.append(("nodes/coordinates", model.coordinates, nodes))
    for contact in model.contacts.values():
        table.append((f"contacts/{contact.name}/B", range(contact.B.shape[1]), model.size))
        table.append((f"contacts/{contact.name}/B", range(contact.B.shape[0]), 3 * contact.pairs))
        table += [(f"contacts/{contact.name}/{key}", getattr(contact, key), contact.pairs) for key in _PAIR_ARRAYS]
    return table
