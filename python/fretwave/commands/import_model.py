"""``fretwave import``: matrices of a finite-element code into one native model file, with a check report."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, IntArray
from ..case.plugins import load_file
from ..errors import EXIT_DONE, InputError
from ..importers.calculix import SUFFIXES, beside, check_once, read_dofs
from ..importers.definite import check_definite
from ..importers.directions import check_directions
from ..importers.entries import Assembled, assemble
from ..importers.exchanged import check_one_model
from ..importers.formats import read_matrix, readable, split
from ..importers.node_files import read_node_file
from ..importers.nodes import Material, Nodes, cells_of
from ..importers.pair_tables import read_pairs
from ..importers.pairs import NEXT, match
from ..importers.repeated import check_diagonal
from ..importers.report import check
from ..importers.rows import check_rows
from ..importers.sector import SectorFaces, make_sector, said_of, wheel_of
from ..importers.surfaces import has_faces
from ..importers.text import columns_of, whole
from ..importers.units import Evidence, check_declared, evidence_of
from ..importers.unjoined import check_unjoined
from ..importers.untied import check_untied
from ..model.pairs import Pairs
from ..model.structure import Structure
from ..mpi.guard import on_first_rank
from ..results.missing_dof import missing_dof
from ..results.model_file import DIRECTIONS, write_model
from ..results.source_file import SourceFile
from ..texts import display, number_in
from ..units import SYSTEMS, unknown
from .import_at_rest import tables_at_rest, write_tables

if TYPE_CHECKING:
    from mpi4py import MPI

ROLES = {"M": "mass", "K": "stiffness", "C": "damping"}


def import_model(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Read, check, write, report. Collective; rank 0 reads and writes."""
    model, found, nodes = on_first_rank(comm, lambda: read_parts(options))
    loaded = on_first_rank(comm, lambda: tables_at_rest(options, model, nodes, found.notes))
    evidence = on_first_rank(comm, lambda: _checked_units(model, [] if nodes is None else nodes.materials))
    report = check(model, found.symmetry, found.notes, evidence, options.modes, comm, found.warnings)
    on_first_rank(comm, lambda: write_model(options.out, model, sources=_sources(options)))
    on_first_rank(comm, lambda: write_tables(loaded, model))
    if comm.rank == 0:
        print(report.text())
        print(f"wrote {', '.join(display(path) for path in [options.out, *(path for path, _ in loaded)])}")
    return EXIT_DONE


def _checked_units(model: Structure, materials: Sequence[Material]) -> list[Evidence]:
    """What tells the model's units, which does not contradict those declared. One rank."""
    evidence = evidence_of(model, materials)
    if model.units:
        check_declared(model.units, evidence, f"--units {model.units}", lambda name: f"--units {name}")
    return evidence


def read_parts(options: argparse.Namespace) -> tuple[Structure, Assembled, Nodes | None]:
    """The model that the options describe, and the nodes that it is of. One rank.

    Raises
    ------
    InputError
        A file or an option is wrong.
    """
    for plugin in options.plugin:
        load_file(plugin)
    _take_deck(options)
    if options.units is not None and options.units not in SYSTEMS:
        raise unknown(options.units, "--units")
    if options.tolerance is not None and not 0 < options.tolerance < np.inf:
        expected, fix = "a length above 0", "leave it out, or give the distance that is meant"
        raise InputError("the tolerance is no length", "--tolerance", f"{options.tolerance:g}", expected, fix)
    _check_place(options.out, [options.mass, options.stiffness, options.damping])
    paths = {letter: getattr(options, role) for letter, role in ROLES.items() if getattr(options, role)}
    given = {letter: read_matrix(path, letter) for letter, path in paths.items()}
    found = assemble(given, options.symmetric)
    nodes = None
    if options.coordinates:
        with readable(options.coordinates, "file of the nodes"):
            nodes = read_node_file(options.coordinates)
        nodes.coordinates = nodes.coordinates - (0.0 if options.origin is None else _three("--origin", options.origin))
    labels = _labels(options, found, nodes)
    found.labels = labels
    where = " and ".join(display(paths[letter]) for letter in "MK")
    check_one_model(found, where)
    model = Structure(
        found.matrices["M"], found.matrices["K"], found.matrices.get("C"), names=found.names, labels=labels
    )
    check_definite(model, where)
    check_diagonal(model, where)
    model.units = options.units
    if nodes is not None:
        model.node_numbers, model.coordinates = nodes.numbers, nodes.coordinates
        model.hexahedra, model.cells = cells_of(nodes)
        found.warnings += check_rows(model, nodes, where)
    model.names, model.dofs = _names(model, options.name)
    wheel = wheel_of(options)
    if wheel is not None:
        make_sector(model, wheel, nodes, options.tolerance)
        found.notes.append(said_of(wheel, model))
    model.pairs = dict(_pairs(options, labels, nodes, wheel, found.notes))
    found.warnings += [] if nodes is None else nodes.constraints.doubts
    found.warnings += check_directions(model)
    found.warnings += check_unjoined(model, where)
    if wheel is not None and nodes is not None:
        found.warnings += check_untied(model, wheel, nodes, options.tolerance)
    return model, found, nodes


def _take_deck(options: argparse.Namespace) -> None:
    """``import sector.inp``: CalculiX' matrices beside the deck, which has the nodes; the file takes its name."""
    deck = options.out
    if deck.suffix.lower() == ".inp":
        options.out = deck.with_suffix(".h5")
        options.coordinates = options.coordinates or deck
        for role, suffix in (("mass", ".mas"), ("stiffness", ".sti")):
            matrix = beside(deck, suffix)
            if getattr(options, role) is None and not matrix.is_file():
                fix = f"put *FREQUENCY, SOLVER=MATRIXSTORAGE into its step and run `ccx {deck.stem}` there"
                raise InputError(f"the {role} matrix of the deck is missing", display(deck), display(matrix), None, fix)
            setattr(options, role, getattr(options, role) or str(matrix))
    for role in ("mass", "stiffness"):
        if getattr(options, role) is None:
            expected = "a file of the matrix, or CalculiX' deck in place of the model file"
            raise InputError(f"no {role} matrix is given", f"--{role}", None, expected, f"add --{role} FILE")


def _sources(options: argparse.Namespace) -> list[SourceFile]:
    """Every file that was read, with its size and checksum."""
    files = [(role, split(getattr(options, role))[0]) for role in ROLES.values() if getattr(options, role)]
    tables = [("coordinates", options.coordinates), ("dofs", options.dofs), ("at rest", options.at_rest)]
    files += [(role, path) for role, path in tables if path]
    files += [("plugin", path) for path in options.plugin]
    files += [("pairs", Path(words[0].rpartition("=")[2])) for words in options.pairs if len(words) == 1]
    tables_beside = {beside(path, ".dof") for _, path in files if path.suffix.lower() in SUFFIXES}
    files += [("dofs", path) for path in sorted(tables_beside) if path.is_file()]
    return [SourceFile.of(role, path) for role, path in files]


def _check_place(out: Path, inputs: Iterable[str | None]) -> None:
    if any(path and Path(path).exists() and out.exists() and out.samefile(path) for path in inputs):
        fix = "choose another name"
        raise InputError("the model file would replace one of the matrices", display(out), None, "a new file", fix)
    if not out.parent.is_dir():
        fix = f"mkdir {display(out.parent)}"
        raise InputError("the folder of the model file does not exist", display(out), fix=fix)


def _labels(options: argparse.Namespace, found: Assembled, nodes: Nodes | None) -> IntArray | None:
    """Node and direction of each dof: from --dofs, the matrices, or node by node as the coordinates stand."""
    if options.dofs:
        with readable(options.dofs, "table of dofs"):
            labels = _read_table(options.dofs)
        where = display(options.dofs)
        if len(labels) != found.given_size:
            fix = "give one line for each row of the matrices"
            measured, expected = f"{len(labels)} dofs", f"{found.given_size}, the size of the matrices"
            raise InputError("the table of dofs does not fit", where, measured, expected, fix)
        check_once(labels, where, "correct the table")
        wrong = ~np.isin(labels[:, 1], range(1, 7))
        if wrong.any():
            node, direction = labels[np.argmax(wrong)]
            measured, expected = f"direction {direction} of node {node}", "1, 2, 3 for x, y, z and 4, 5, 6 about them"
            raise InputError("a direction of the table is none", where, measured, expected, "number them from 1")
    elif found.labels is not None or nodes is None:
        return found.labels
    else:
        labels = _node_by_node(found, nodes)
    return labels if found.rows is None else labels[found.rows]


def _node_by_node(found: Assembled, nodes: Nodes) -> IntArray:
    """Three or six dofs for each node, in the order of the coordinates."""
    per_node, rest = divmod(found.given_size, len(nodes.numbers))
    if rest or per_node not in (3, 6):
        raise InputError(
            "which dof belongs to which node is not known",
            nodes.where,
            f"{found.given_size} dofs, {len(nodes.numbers)} nodes",
            "3 or 6 dofs for each node, or a table",
            "give --dofs FILE with a line `node,direction` for each row of the matrices",
        )
    found.notes.append(f"dofs: taken node by node in the order of the coordinates, {per_node} for each")
    directions = np.tile(np.arange(1, per_node + 1), len(nodes.numbers))
    return np.column_stack([np.repeat(nodes.numbers, per_node), directions])


def _read_table(path: Path) -> IntArray:
    """CalculiX' ``node.direction``, or a CSV of ``node,direction``, the direction a number or x, y, z."""
    if not path.is_file():
        raise InputError("the table of dofs does not exist", display(path), fix="check the path")
    if not re.search("[,;]", path.read_text(encoding="utf-8", errors="replace")):
        return read_dofs(path)
    return whole(columns_of(path, 2, {1: _direction}, ("node", "direction")), display(path))


def _direction(word: str) -> float:
    name = word.strip().strip('"').lower()
    return DIRECTIONS.index(name) + 1 if name in DIRECTIONS else number_in(word)


def _names(model: Structure, given: list[str]) -> tuple[list[str], dict[str, int]]:
    """``--name tip=17y``: a dof's own name, and it is kept by a reduction. All names, and those given by number."""
    names, kept = model.dof_names, []
    for text in given:
        name, _, old = text.partition("=")
        old = old if old in names or f"n{old}" not in names else f"n{old}"
        if not name.isidentifier() or old not in names or (name in names and name != old):
            fix = missing_dof(replace(model, names=names), old, names) or "check the node and its direction"
            if not name.isidentifier():
                usable = re.sub(r"\W", "_", name)
                fix = f"write {usable if usable.isidentifier() else 'tip'}={old}"
            elif old in names:
                fix = f"another dof is called {name}: choose another name"
            raise InputError(
                "a dof cannot be named so",
                f"--name {text}",
                None,
                "NAME=DOF, a new name of letters and digits and a dof such as " + names[0],
                fix,
            )
        kept.append(names.index(old))
        names[kept[-1]] = name
    return names, {names[dof]: dof for dof in kept}


def _pairs(
    options: argparse.Namespace,
    labels: IntArray | None,
    nodes: Nodes | None,
    wheel: SectorFaces | None,
    notes: list[str],
) -> Iterator[tuple[str, Pairs]]:
    """Contact pairs by name; what was done is added to the notes."""
    seen: set[str] = set()
    for number, words in enumerate(options.pairs):
        name, equals, first = words[0].partition("=")
        name, first = (name, first) if equals else ("contact" if not number else f"contact_{number + 1}", words[0])
        where = f"--pairs {' '.join(words)}"
        if not name.isidentifier() or name in seen or len(words) > 2:
            expected = "[NAME=]SET_A SET_B[@next], [NAME=]SET GROUND or [NAME=]FILE.csv, each with its own name"
            raise InputError("contact pairs are not given so", where, None, expected, "--pairs root=BLADE DISK")
        if labels is None:
            fix = "give --dofs FILE or --coordinates FILE"
            raise InputError("the pairs name nodes, the matrices do not", where, None, "a table of dofs", fix)
        seen.add(name)
        tangent, normal = _axis("--tangent", options.tangent), _axis("--normal", options.normal)
        if len(words) == 1:
            with readable(Path(first), "file of the pairs"):
                found = read_pairs(name, Path(first), labels, nodes, tangent, options.tolerance)
        elif nodes is None:
            fix = "give --coordinates FILE with the sets, or a CSV of pairs"
            raise InputError("the node sets are not known", where, None, "nodes with sets", fix)
        else:
            if normal is None and wheel is not None and words[1].lower().endswith(NEXT) and not has_faces(nodes, first):
                normal = wheel.circumferential(first, nodes)
                notes.append(f"contact '{name}': its normal is along the circumference, to the next sector")
            turn = None if wheel is None else wheel.turn
            found = match(name, nodes, first, words[1], normal, labels, options.tolerance, tangent, notes, turn)
            if wheel is not None and isinstance(found.B, Mapping):
                wheel.check_apart(name, nodes, found)
        yield name, found


def _axis(option: str, text: str | None) -> Array | None:
    if text is None:
        return None
    axis = _three(option, text)
    if np.linalg.norm(axis) > 0:
        return axis
    raise InputError("this is no direction", f"{option} {text}", text, "x,y,z", "for example 0,0,1")


def _three(option: str, text: str) -> Array:
    try:
        values = np.array([number_in(word) for word in text.split(",")])
        if values.shape == (3,) and np.isfinite(values).all():
            return values
    except ValueError:
        pass
    raise InputError("these are no three numbers", f"{option} {text}", text, "x,y,z", "for example 0,0,1")
