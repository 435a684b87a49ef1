"""The native model file: matrices, names, nodes and contact maps in one HDF5 file.

Written by ``fretwave import`` (or `write_model`), read by ``[model] file = "blade.h5"`` (or `read_model`), by one rank
with serial h5py calls; `fretwave.Model` distributes the rows. Numbers are float64 and int64 (indices of CSR: int32
or int64, from 0).

=========================  ===================================================================================
place                      content
=========================  ===================================================================================
``/`` (attributes)         ``format`` = "fretwave model", ``format_version`` = 1, of a sector 2, ``units``: name of the
                           unit system (`fretwave.units`), empty where it was not told (then SI)
``/M``, ``/K``, ``/C``     groups ``data``, ``indices``, ``indptr`` of the CSR form, attribute ``shape``; both triangles
                           are stored; ``/C`` is optional
``/dofs/name``             (n_dof,) unique names, in the order of the rows
``/dofs/node``             (n_dof,) node number, optional
``/dofs/direction``        (n_dof,) 1, 2, 3 displacements along x, y, z; 4, 5, 6 rotations; optional, with ``node``
``/dofs/kept``             (n,) dofs that a reduction shall keep beside those of the contacts, optional
``/nodes/number``          (n_nodes,) node numbers, optional
``/nodes/coordinates``     (n_nodes, 3), optional, with ``number``
``/cells/hexahedra``       (n_cells, 8 or 20) places in ``/nodes``, in the order of C3D8 and C3D20 (and VTK), optional
``/cells/<kind>``          (n_cells, m) cells of other kinds by their names (`fretwave.model.cells`), in VTK's order,
                           optional
``/contacts/<name>/B``     CSR group as the matrices, (3 n_pairs, n_dof): u = B x, rows (normal, tangent, tangent) pair
                           by pair, u_n > 0 closes the contact
``/contacts/<name>/...``   ``positions`` (n_pairs, 3), ``areas`` (n_pairs,), ``frames`` (n_pairs, 3, 3) with rows normal
                           (from the first body to the second), tangent, tangent, ``nodes`` (n_pairs, 2), 0 for ground;
                           each optional
``/contacts/<name>/B_next``  group as ``B``, optional: the part on the dofs of the next sector, in its own frame
``/sector``                optional: attributes ``sectors`` (N), ``axis`` ("x", "y" or "z"; empty where nothing turns);
                           ``low``, ``high`` (n_face,) matching dofs of the faces, with an axis x, y, z of each node:
                           the high ones move as the next sector's low ones turned by 2 pi / N about the axis
``/sources``               what the file was made from: ``role``, ``path``, ``bytes``, ``sha256``, (n,) each
=========================  ===================================================================================
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ..arrays import IntArray
from ..errors import InputError
from ..files.compressed import check_compressed
from ..files.whole import Unfailing, check_whole, replaced, seal
from ..kinds import of_their_kinds
from ..model.cells import KINDS
from ..model.pairs import Pairs
from ..model.sectors import by_sector, real_csr
from ..model.structure import Structure
from ..texts import display, names_beside, nearest
from ..units import SYSTEMS, unit_system
from .model_checks import PAIR_ARRAYS, PARTS, Table, check_parts
from .source_file import SourceFile

if TYPE_CHECKING:
    import h5py

FORMAT, VERSION = "fretwave model", 2
#: Arrays of dofs, nodes and cells.
_TABLES = ("dofs/node", "dofs/direction", "dofs/kept", "nodes/number", "nodes/coordinates", "cells/hexahedra")
#: Names of the directions 1 to 6 in a dof's name.
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def dof_name(node: int, direction: int) -> str:
    """``n17y``: a name TOML takes as a key without quotes, and ``--set`` does not mistake for a number."""
    known = 1 <= direction <= len(DIRECTIONS)
    return f"n{node}" + (DIRECTIONS[direction - 1] if known else f"d{direction}")


@of_their_kinds
def write_model(
    path: str | Path, structure: Structure, units: str | None = None, sources: Sequence[SourceFile] = ()
) -> None:
    """Write a model file. One rank only; an old file is replaced once the new one is complete.

    Parameters
    ----------
    structure : Structure
        As it was given: no sector tied to its neighbours. `dofs` are those that a reduction shall keep.
    units : str, optional
        Name of the unit system; default that of the structure.
    sources : what the matrices were read from

    Raises
    ------
    InputError
        The parts do not fit each other, or there is no such unit system.
    """
    import h5py

    told = units or structure.units or ""
    if told:
        unit_system(told)
    tables = _tables_of(structure)
    _check_held(structure, str(path))
    _check_nodes(structure, str(path))
    check_parts(structure, tables, str(path))
    path = Path(path)
    if path.is_dir() or not path.parent.is_dir():
        measured = "a folder of this name" if path.is_dir() else "no such folder"
        fix, expected = "choose another place", "a file in a folder that exists"
        raise InputError("the model file cannot be written", display(path), measured, expected, fix)
    with replaced(path, own=True) as fresh:
        raw = Unfailing(fresh)
        with h5py.File(raw, "w") as file:
            version = VERSION if structure.sectors else 1
            file.attrs.update(format=FORMAT, format_version=version, units=told)
            _write_parts(file, structure, tables)
            for key in ("role", "path", "sha256"):
                file[f"sources/{key}"] = np.array([getattr(s, key).encode() for s in sources], dtype="S")
            file["sources/bytes"] = np.array([s.bytes for s in sources], dtype="<i8")
        raw.close()
        seal(fresh)


#: What the format has no place for.
_NOT_HELD = ("loads", "parts", "ties", "whole", "stiffness_damping", "mass_damping")


def _check_held(structure: Structure, where: str) -> None:
    """Nothing is left behind in silence."""
    lost = [name for name in _NOT_HELD if getattr(structure, name)]
    lost += [] if structure.expansion is None else ["expansion"]
    lost += [f"pairs '{name}' of one component" for name, pairs in structure.pairs.items() if pairs.components != 3]
    lost += [f"parameters of '{name}'" for name, pairs in structure.pairs.items() if pairs.parameters]
    lost += [f"pairs '{n}' beyond the next sector" for n, p in structure.pairs.items() if set(by_sector(p.B)) - {0, 1}]
    if lost:
        fix = "leave them out, or give them by a builder"
        raise InputError("a model file has no place for these", where, ", ".join(lost), None, fix)


def _check_nodes(structure: Structure, where: str) -> None:
    """Nodes have numbers, by which each dof names its own: `displacements` follow from them, and are not written."""
    placed, labels = structure.displacements, structure.labels
    needed = {"node_numbers": structure.node_numbers, **({} if placed is None else {"labels": labels})}
    missing = [name for name, value in needed.items() if value is None]
    if structure.coordinates is None or (placed is None and not missing):
        return
    known = labels is not None and labels.shape == (structure.n_dof, 2)  # what is wrong with a shape is told elsewhere
    if placed is not None and not missing and (not known or np.array_equal(placed, _displacements(structure))):
        return
    what = "a model file tells of each dof which node it moves along what, and the structure does not"
    measured = f"no {' and no '.join(missing)}" if missing else "displacements that labels do not give"
    fix = "give node_numbers (n_nodes,) and labels (n_dof, 2), node and 1 to 3 along x, y, z; or leave out coordinates"
    raise InputError(what, where, measured, "nodes that dofs name", fix)


def _tables_of(structure: Structure) -> dict[str, Table]:
    """Arrays of dofs, nodes and cells by their places in the file."""
    labels = structure.labels
    return {
        "dofs/node": None if labels is None else labels[:, 0],
        "dofs/direction": None if labels is None else labels[:, 1],
        "dofs/kept": np.array(list(structure.dofs.values()), dtype=np.int64) if structure.dofs else None,
        "nodes/number": structure.node_numbers,
        "nodes/coordinates": structure.coordinates,
        "cells/hexahedra": structure.hexahedra,
        **{f"cells/{kind}": table for kind, table in structure.cells.items()},
    }


def _write_parts(file: h5py.File, structure: Structure, tables: Mapping[str, Table]) -> None:
    for letter in ("M", "K", "C"):
        if getattr(structure, letter) is not None:
            _write_sparse(file.create_group(letter), getattr(structure, letter))
    file["dofs/name"] = np.array([name.encode() for name in structure.dof_names])
    _write_arrays(file, tables)
    for name, pairs in structure.pairs.items():
        for k, B in by_sector(pairs.B).items():
            _write_sparse(file.create_group(f"contacts/{name}/{PARTS[k]}"), B)
        _write_arrays(file[f"contacts/{name}"], {key: getattr(pairs, own) for key, own in PAIR_ARRAYS.items()})
    _write_sector(file, structure)


def _write_sector(file: h5py.File, structure: Structure) -> None:
    if not structure.sectors:
        return
    group = file.create_group("sector")
    group.attrs.update(sectors=structure.sectors, axis=structure.axis or "")
    _write_arrays(group, {"low": structure.low, "high": structure.high})


def _write_arrays(group: h5py.Group, arrays: Mapping[str, Table]) -> None:
    for name, values in arrays.items():
        if values is not None:
            values = np.asarray(values)
            group[name] = values.astype("<f8" if values.dtype.kind == "f" else "<i8")


def _write_sparse(group: h5py.Group, matrix: sp.spmatrix) -> None:
    rows = real_csr(matrix, group.name).sorted_indices()
    group.attrs["shape"] = np.array(rows.shape, dtype="<i8")
    for key in ("data", "indices", "indptr"):
        group[key] = getattr(rows, key)


@of_their_kinds
def read_model(path: str | Path) -> Structure:
    """Read a model file. One rank only (see `fretwave.mpi.guard.on_first_rank`).

    Raises
    ------
    InputError
        The file is missing, is no model file, is of a later version or is damaged.
    """
    path = Path(path)
    with _opened(path) as file, _damaged(path):
        structure, tables = _read_parts(file)
    check_parts(structure, tables, display(path))
    kept = tables["dofs/kept"]
    names = structure.dof_names
    dofs = {names[dof]: int(dof) for dof in (() if kept is None else kept)}
    if structure.labels is None or structure.coordinates is None:  # not known which dof moves which node
        return replace(structure, dofs=dofs, coordinates=None, hexahedra=None, cells={})
    return replace(structure, dofs=dofs, displacements=_displacements(structure))


def read_sources(path: str | Path) -> tuple[str, list[SourceFile]]:
    """Units and what a model file was made from. One rank only.

    Raises
    ------
    InputError
        As `read_model`.
    """
    path = Path(path)
    with _opened(path) as file, _damaged(path):
        group = file.get("sources", {})
        columns = [group[key][()] for key in ("role", "path", "bytes", "sha256")] if len(group) else []
        sources = [SourceFile(a.decode(), b.decode(), int(c), d.decode()) for a, b, c, d in zip(*columns)]
        return str(file.attrs.get("units", "")), sources


@contextmanager
def _damaged(path: Path) -> Iterator[None]:
    """Whatever h5py and SciPy say of a file that lacks or spoils something."""
    try:
        yield
    except (KeyError, OSError, ValueError, TypeError, AttributeError, RuntimeError, OverflowError) as error:
        raise InputError(
            "the model file is damaged",
            display(path),
            str(error).strip("'\""),
            f"the layout of format version {VERSION}",
            "write it again with `fretwave import`",
        ) from None


def _displacements(structure: Structure) -> IntArray:
    """Dof (n_nodes, 3) of each node along x, y and z, -1 where the matrices have none: it is held."""
    assert structure.labels is not None and structure.node_numbers is not None
    (node, direction), numbers = structure.labels.T, structure.node_numbers
    order = np.argsort(numbers)
    place = np.clip(np.searchsorted(numbers, node, sorter=order), 0, len(order) - 1)
    rows, dofs = order[place], np.arange(structure.n_dof)
    shown = (numbers[rows] == node) & (direction <= 3)
    found = np.full((len(order), 3), -1, dtype=np.int64)
    found[rows[shown], direction[shown] - 1] = dofs[shown]
    return found


def _opened(path: Path) -> h5py.File:
    import h5py

    fix = "write it with `fretwave import`"
    if not path.is_file():
        near = nearest(path.name, names_beside(path, "*.h5"))
        raise InputError("the model file does not exist", display(path), fix=near or fix)
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


def _read_parts(file: h5py.File) -> tuple[Structure, dict[str, Table]]:
    """The structure with its tables, as they stand in the file."""
    matrices: dict[str, Any] = {
        letter: _read_sparse(file[letter]) if letter in file else None for letter in ("M", "K", "C")
    }
    missing = [letter for letter in ("M", "K") if matrices[letter] is None]
    if missing:
        raise KeyError(f"there is no matrix {missing[0]}")
    tables = {place: _array(file, place) for place in _TABLES}
    node, direction = tables["dofs/node"], tables["dofs/direction"]
    both = None if node is None or direction is None or len(node) != len(direction) else [node, direction]
    structure = Structure(
        **matrices,
        pairs={name: _read_pairs(group) for name, group in file.get("contacts", {}).items()},
        names=[name.decode() for name in file["dofs/name"][()]],
        labels=None if both is None else np.column_stack(both),
        node_numbers=tables["nodes/number"],
        coordinates=tables["nodes/coordinates"],
        hexahedra=tables["cells/hexahedra"],
        cells={kind: file["cells"][kind][()].astype("i8") for kind in file.get("cells", {}) if kind in KINDS},
        units=_units_of(file),
        **_read_sector(file),
    )
    return structure, tables


def _read_sector(file: h5py.File) -> dict[str, Any]:
    """What says that it is a sector, nothing where it is none."""
    if "sector" not in file:
        return {}
    group = file["sector"]
    number, axis = int(group.attrs["sectors"]), str(group.attrs["axis"])
    return {"sectors": number, "low": group["low"][()], "high": group["high"][()], "axis": axis or None}


def _units_of(file: h5py.File) -> str | None:
    """The system that it tells; None where it tells none, or has a note of an earlier version in its place."""
    told = str(file.attrs.get("units", ""))
    return told if told in SYSTEMS else None


def _array(group: h5py.Group, name: str) -> Table:
    return group[name][()] if name in group else None


def _read_pairs(group: h5py.Group) -> Pairs:
    arrays: dict[str, Any] = {own: _array(group, key) for key, own in PAIR_ARRAYS.items()}
    parts = {k: _read_sparse(group[key]) for k, key in PARTS.items() if key in group}
    return Pairs(parts if 1 in parts else parts[0], **arrays)


def _read_sparse(group: h5py.Group) -> sp.csr_matrix:
    parts = tuple(group[key][()] for key in ("data", "indices", "indptr"))
    matrix = sp.csr_matrix(parts, shape=tuple(int(n) for n in group.attrs["shape"]))
    check_compressed(matrix)
    return matrix
