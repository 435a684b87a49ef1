"""``fretwave import --at-rest``: loads and gaps of contact pairs from a static step, as tables that a case reads."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Union

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..files.csv_table import write_columns
from ..importers.contact_results import Nodal, StaticStep, at_rest, read_step, surfaces
from ..importers.formats import readable
from ..importers.nodes import Nodes
from ..importers.pairs import GROUND
from ..importers.spring_areas import spring_areas
from ..importers.surfaces import side_of
from ..model.law_info import Role
from ..model.laws import usual_name
from ..model.structure import Structure

NO_NODES = np.zeros(0, dtype=np.int64)
#: A file and its columns.
Table = tuple[Path, Mapping[str, Union[Array, IntArray]]]


def tables_at_rest(options: argparse.Namespace, model: Structure, nodes: Nodes | None, notes: list[str]) -> list[Table]:
    """A table for each contact; what was found is added to the notes. One rank.

    Raises
    ------
    InputError
        There are no pairs, or the results are not of them.
    """
    if options.at_rest is None:
        return []
    if not model.pairs or model.labels is None:
        fix = "add --pairs SET_A SET_B"
        raise InputError("a state at rest is of contact pairs", "--at-rest", "no pairs", "--pairs", fix)
    with readable(options.at_rest, "file of the results"):
        step = read_step(options.at_rest)
    given = [[words[0].rpartition("=")[2], *words[1:]] for words in options.pairs]
    tables: list[Table] = []
    for (name, pairs), sides in zip(model.pairs.items(), given):
        springs: list[Nodal] = []
        if nodes is not None:
            springs = 2 * [_dependent(nodes, step)] if len(sides) == 1 else [_springs(nodes, side) for side in sides]
        found = at_rest(name, pairs, step, model.labels, sides, len(model.pairs) == 1, springs)
        notes.append(found.said(name, pairs))
        tables.append((options.out.with_name(f"{options.out.stem}_{name}.csv"), found.columns(pairs)))
    return tables


def _springs(nodes: Nodes, name: str) -> Nodal:
    """Areas of the nodes of a side of the contact, of none where no faces are known."""
    (name,) = surfaces([name])
    if name == GROUND and name not in nodes.sets:
        return Nodal(NO_NODES, np.zeros((0, 1)))
    side = side_of(nodes, name)
    order = np.argsort(side.numbers) if side.faces else np.zeros(0, dtype=np.intp)
    return Nodal(side.numbers[order], spring_areas(side)[order, None])


def _dependent(nodes: Nodes, step: StaticStep) -> Nodal:
    """The same of all dependent surfaces that the step's deck names: a table of pairs says nothing of them."""
    names = dict.fromkeys(name for name, _ in step.stand_off if name in nodes.elements.surfaces)
    found = [_springs(nodes, name) for name in names]
    numbers, first = np.unique(np.concatenate([NO_NODES, *(one.numbers for one in found)]), return_index=True)
    return Nodal(numbers, np.concatenate([np.zeros((0, 1)), *(one.values for one in found)])[first])


def write_tables(tables: Sequence[Table], model: Structure) -> None:
    """With units where the model declares them."""
    kinds = {usual_name(Role.LOAD): "force", "tangential_force": "force", usual_name(Role.GAP): "length"}
    units = kinds if model.units else {}
    headings = {name: f"{name} [{model.unit_system(unit)}]" for name, unit in units.items()}
    for path, columns in tables:
        write_columns(path, columns, headings)
