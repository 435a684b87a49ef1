"""The results of a sweep in one group of results.h5 and two tables, put together from the runs of its values.

A sweep over seeds (keys that end in `seed`) has a further table, ``<name>_quantiles.csv``.

::

    <name>/points/...           one after the other, the branches of all values: `value`, the keys, then the columns
                                of any of them: nan, -1 (whole numbers) or empty where a branch has no such column
    <name>/over/<key>           values of a key: dimension scale (n,)
    <name>/summary/<quantity>   (n_1, n_2, ..., [n_branches]), dimensions as in `over`, whose scales are here too: one
                                group above they would hide the columns of their names in `points` from xarray.
                                nan where there is no branch. The last one is there for tables of several branches:
                                levels, nodal diameters
    <name>/values/0003/...      all that is kept of the value with this number: coefficients, motions of the contacts
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import AnyArray
from ..columns import NUMBER, Column, table_order
from ..files.csv_table import plain, write_columns, write_rows
from ..files.dimensions import name_dimensions
from ..post.grid import Plan
from ..texts import toml
from ..units import ATTRIBUTE, SI, UnitSystem, units_of
from .file import ENDED
from .results import has_results, open_results, rewritten
from .sweep_quantiles import over_seeds, quantile_rows
from .sweep_summary import COMMON, columns_in, in_words, split_of, summarise, summary_of

if TYPE_CHECKING:
    import h5py

#: Columns of a summary that say nothing of the motion.
OF_COST = tuple(column.name for column in COMMON)
#: State of the solver: a finished branch has no use for it.
STATES = ("state_0", "state_1")
#: Attributes of a value's group that the sweep's group has when they are the same for all values.
SHARED = (
    "method",
    "harmonics",
    "samples",
    "normalise",
    "observe",
    "nodal_diameter",
    "retain",
    "linear_mode",
    ATTRIBUTE,
)


@dataclass
class Branch:
    """The table of one analysis at one value.

    Attributes
    ----------
    number : int
        Of the value.
    table : dict
        Columns (n_points,) by name; texts are bytes.
    units : dict
        (unit, long name) of each column.
    attributes : dict
        Of the analysis' group.
    start_forces : dict
        By row that starts a branch: of each contact over its period (n_samples, components, n_pairs) [force], if kept.
    draws : dict
        What ``[uncertainty]`` drew, by name.
    peaks : list of dict
        Of the blades of a driven wheel by level, the largest.
    """

    number: int
    folder: Path
    table: dict[str, Any]
    units: dict[str, tuple[str, str]]
    attributes: dict[str, Any]
    start_forces: dict[int, dict[str, Any]]
    draws: dict[str, float] = field(default_factory=dict)
    peaks: list[dict[str, float]] = field(default_factory=list)

    @property
    def system(self) -> UnitSystem:
        """Of units."""
        return units_of(self.attributes)

    @property
    def points(self) -> int:
        return len(next(iter(self.table.values())))


def read_branch(folder: Path, name: str, number: int, run_id: str) -> Branch | None:
    """What the run of a value found, None when it found nothing (or what is there belongs to another run)."""
    if not has_results(folder):
        return None
    with open_results(folder / "results.h5") as file:
        if name not in file or file[name].attrs.get("run_id") != run_id:
            return None
        group = file[name]
        table = {key: data[()] for key, data in group["points"].items()}
        units = {key: (data.attrs["units"], data.attrs["long_name"]) for key, data in group["points"].items()}
        ordered = {key: table[key] for key in table_order(table)}
        return Branch(number, folder, ordered, units, dict(group.attrs), _start_forces(group, table))


def _start_forces(group: h5py.Group, table: Mapping[str, Any]) -> dict[int, dict[str, Any]]:
    """Forces of the contacts at rows with the event `start`."""
    contacts = [key for key in group if key.startswith("contact_")]
    reported = group["reported"][()] if "reported" in group else ()
    starts = [(k, int(row)) for k, row in enumerate(reported) if b"start" in table["event"][row].split()]
    return {row: {key[len("contact_") :]: group[key]["f"][k] for key in contacts} for k, row in starts}


def write_sweep(
    folder: Path,
    name: str,
    of: str,
    plan: Plan,
    branches: Sequence[Branch],
    attributes: Mapping[str, Any],
    title: str = "",
    summary: Path | None = None,
) -> list[dict[str, Any]]:
    """Write ``<name>.csv`` and last the group `name` of results.h5; one rank only.

    Parameters
    ----------
    of : str
        The analysis in the values' runs.
    branches : sequence of Branch
        In the order of the values; those that found nothing are not there.
    attributes : mapping
        Put on the group (status, reason, run_id).
    title : str
        Of the case, an attribute of the file.
    summary : Path, optional
        Table of the summary.

    Returns
    -------
    list of dict
        The rows of the summary: the keys, which branch of the value's table, and what is said of it.
    """
    kind = str(branches[0].attributes["type"]) if branches else ""
    points = _points(plan, branches)
    rows = _summary(kind, plan, branches)
    write_columns(folder / f"{name}.csv", {column.heading: values for column, values in points})
    columns, keys = summary_columns(kind, branches, rows), key_headings(plan, system_of(branches))
    if summary is not None:
        write_rows(summary, rows, {**keys, **{column.name: column.heading for column in columns}})
    if over_seeds(plan):
        left_out = (*OF_COST, *_lacking(summary_of(kind).cut_off, rows))
        told = [column for column in columns if column.kind == "f" and column.name not in left_out]
        table, path = quantile_rows(plan, rows, told, split_of(kind)), folder / f"{name}_quantiles.csv"
        if table:
            write_rows(path, table, keys)
        else:  # too few came to their end
            path.unlink(missing_ok=True)
    with rewritten(folder / "results.h5", name) as file:
        file.attrs["title"] = title
        group = file.create_group(name)
        described = {"type": "sweep", "of": of, "of_type": kind, "over": json.dumps(dict(plan.over)), "left_out": "[]"}
        group.attrs.update({**_shared(branches), **described, **attributes})
        _write_points(group.create_group("points"), points)
        scales = _write_over(group.create_group("over"), plan)
        drawn = [Column(name, "", "drawn value") for branch in branches[:1] for name in branch.draws]
        _write_summary(group.create_group("summary"), kind, plan, rows, scales, [*drawn, *columns])
        for branch in branches:
            _copy_branch(branch, of, group.create_group(f"values/{branch.number:04d}"))
    return rows


def _lacking(names: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Columns that not all branches have that came to their end."""
    ended = [row for row in rows if row.get("done", 1) == 1]
    return [name for name in names if not all(np.isfinite(row.get(name, np.nan)) for row in ended)]


def amplitude_unit(branches: Sequence[Branch]) -> str:
    """Of the amplitudes in the tables and in the summary, the same for all values."""
    of_lengths = system_of(branches)("length")
    return branches[0].units.get("amplitude", (of_lengths, ""))[0] if branches else of_lengths


def system_of(branches: Sequence[Branch]) -> UnitSystem:
    """Of the units of all values."""
    return branches[0].system if branches else SI


def summary_columns(kind: str, branches: Sequence[Branch], rows: Sequence[Mapping[str, Any]]) -> list[Column]:
    """Of the summary with these rows, whose lengths are amplitudes."""
    units, unit = system_of(branches), amplitude_unit(branches)
    return [column.as_amplitude(unit).in_units(units) for column in columns_in(kind, rows)]


def summary_lines(name: str, plan: Plan, branches: Sequence[Branch], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """A sweep in words: a line for each value, of draws the quantiles."""
    if not branches:
        return [f"{name}: nothing was found with any of the values"]
    kind = str(branches[0].attributes["type"])
    columns = summary_columns(kind, branches, rows)
    return in_words(name, plan, rows, kind, columns, amplitude_unit(branches))


def key_values(values: Sequence[Any]) -> Any:
    """Values of a key as an array: numbers as numbers, anything else as texts."""
    if all(type(value) in (int, float) for value in values):
        return np.array(values, dtype="i8" if all(type(value) is int for value in values) else "f8")
    texts = [value if isinstance(value, str) else toml(value, 1 << 30) for value in values]
    return np.array([text.encode() for text in texts])


def key_column(plan: Plan, key: str, system: UnitSystem) -> Column:
    """Of a swept key."""
    return Column(key, plan.units.get(key, ""), "swept key", units=system)


def key_headings(plan: Plan, system: UnitSystem) -> dict[str, str]:
    """Of the swept keys, in tables."""
    return {key: key_column(plan, key, system).heading for key in plan.keys}


def _key_column(plan: Plan, key: str) -> Any:
    """The value of a key in each combination (n,)."""
    place = plan.keys.index(key)
    return key_values(plan.over[key])[np.indices(plan.shape)[place].ravel()]


def _points(plan: Plan, branches: Sequence[Branch]) -> list[tuple[Column, Any]]:
    """All branches under each other, led by the keys."""
    lengths = [branch.points for branch in branches]
    numbers = np.repeat(np.array([branch.number for branch in branches], dtype="i8"), lengths)
    system = system_of(branches)
    columns = [(key_column(plan, key, system), _key_column(plan, key)[numbers]) for key in plan.keys]
    columns.append((Column(NUMBER, "1", "number of the combination of values", "i"), numbers))
    for key in table_order(dict.fromkeys(key for branch in branches for key in branch.table)):
        first = next(branch for branch in branches if key in branch.table)
        unit, long_name = first.units[key]
        parts = [branch.table.get(key, _unknown(first.table[key], branch.points)) for branch in branches]
        columns.append((Column(key, unit, long_name, units=first.system), np.concatenate(parts)))
    return columns


def _unknown(like: AnyArray, count: int) -> AnyArray:
    """A column (count,) of a branch that has no such quantity: nan, -1 of whole numbers, empty of texts."""
    value = {"f": np.nan, "S": b""}.get(like.dtype.kind, -1)
    return np.full(count, value, dtype=like.dtype)


def _summary(kind: str, plan: Plan, branches: Sequence[Branch]) -> list[dict[str, Any]]:
    """A row for each branch; a table of a value has one, or one for each level or nodal diameter."""
    rows, columns = [], {key: _key_column(plan, key) for key in plan.keys}
    for branch in branches:
        keys = {key: plain(column[branch.number]) for key, column in columns.items()}
        lead = {**keys, "value": branch.number, **branch.draws}
        rows += [{**lead, **part, **values} for part, values in parts_of(kind, branch)]
    return rows


def parts_of(kind: str, branch: Branch) -> Iterator[tuple[dict[str, Any], dict[str, float]]]:
    """Which branch of the table, empty where there is one, and what is said of it."""
    split, attributes = split_of(kind), {**branch.attributes, "peaks": branch.peaks}
    column = branch.table.get(split)
    for part in [None] if column is None else np.unique(column):
        chosen = np.full(branch.points, True) if part is None else column == part
        table = {key: values[chosen] for key, values in branch.table.items()}
        forces = branch.start_forces.get(int(np.argmax(chosen)), {})
        own = attributes if part is None else {**attributes, "status": _status(attributes, part)}
        yield {} if part is None else {split: part.item()}, summarise(kind, table, own, forces)


def _status(attributes: Mapping[str, Any], part: object) -> str:
    """Of one of the branches of an analysis: others that stopped early do not make it one that did."""
    ended = part in json.loads(attributes.get(ENDED, "[]"))
    return "done" if ended else str(attributes.get("status"))


def _shared(branches: Sequence[Branch]) -> dict[str, Any]:
    given = [[branch.attributes.get(name) for branch in branches] for name in SHARED]
    return {
        name: values[0]
        for name, values in zip(SHARED, given)
        if values and values[0] is not None and all(value == values[0] for value in values)
    }


def _write_points(group: h5py.Group, points: Sequence[tuple[Column, Any]]) -> None:
    for column, values in points:
        data = group.create_dataset(column.name, data=values)
        data.attrs.update(column.attributes)
        name_dimensions(group.parent, data, ["row"])


def _write_over(group: h5py.Group, plan: Plan) -> list[h5py.Dataset]:
    for key, values in plan.over.items():
        group.create_dataset(key, data=key_values(values)).attrs["units"] = plan.units.get(key, "")
        group[key].make_scale(key)
    return [group[key] for key in plan.keys]


def _write_summary(
    group: h5py.Group,
    kind: str,
    plan: Plan,
    rows: Sequence[Mapping[str, Any]],
    scales: Sequence[h5py.Dataset],
    columns: Sequence[Column],
) -> None:
    split = split_of(kind)
    parts = sorted({row[split] for row in rows if split in row})
    for scale in scales:
        key = scale.name.rpartition("/")[2]
        group.create_dataset(key, data=scale[()]).make_scale(key)
        group[key].attrs["units"] = scale.attrs["units"]
    if parts:
        group.create_dataset(split, data=parts)
    names = [*plan.keys, *([split] if parts else [])]
    shape = (*plan.shape, *([len(parts)] if parts else []))
    for column in columns if rows else ():
        values = np.full(shape, np.nan)
        for row in rows:
            place = np.unravel_index(row["value"], plan.shape)
            values[(*place, *([parts.index(row[split])] if parts else []))] = row.get(column.name, np.nan)
        data = group.create_dataset(column.name, data=values)
        data.attrs.update(column.attributes)
        name_dimensions(group, data, names)


def _copy_branch(branch: Branch, of: str, group: h5py.Group) -> None:
    """Everything but the solver's state; HDF5's copy loses the references of dimension scales."""
    with open_results(branch.folder / "results.h5") as file:
        group.attrs.update(branch.attributes)
        for key in file[of]:
            if key not in STATES:
                group.copy(file[of][key], group, key)
        group.visititems(_forget_scales)
        file[of].visititems(lambda key, source: _attach_scales(source, group.get(key), group, file[of].name))


def _forget_scales(_: str, item: h5py.Group | h5py.Dataset) -> None:
    for name in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):
        if name in item.attrs:
            del item.attrs[name]


def _attach_scales(
    source: h5py.Group | h5py.Dataset, copy: h5py.Group | h5py.Dataset | None, group: h5py.Group, root: str
) -> None:
    """Give a copy the scales of its source, by their places below the root."""
    from h5py import h5ds

    if copy is None or not hasattr(source, "dims"):
        return
    if h5ds.is_scale(source.id) and not h5ds.is_scale(copy.id):  # also where no dataset refers to it
        copy.make_scale(source.name.rpartition("/")[2])
    for there, here in zip(source.dims, copy.dims):
        for name, scale in there.items():
            mine = group[scale.name[len(root) + 1 :]]
            if not h5ds.is_scale(mine.id):
                mine.make_scale(name)
            here.attach_scale(mine)
