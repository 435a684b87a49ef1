"""A branch in a file: HDF5 as netCDF-4 wants it, every dimension with its coordinate in the same group."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from ..columns import COLUMNS, Column, columns_named, over
from ..errors import InputError
from ..files.dimensions import name_dimensions
from ..files.whole import replaced
from ..hb.states import described, state_of
from ..units import ATTRIBUTE, units_of
from .hermite import Cubic

if TYPE_CHECKING:
    import h5py

    from .branch import Branch

Made = TypeVar("Made")

#: What the file says it is.
FORMAT = "fretwave branch 1"


def write(branch: Branch, path: Path) -> None:
    """Table over `point`, curve over `point`, `piece` and `scalar`; the rest as attributes."""
    import h5py

    curves = branch.curves
    with replaced(path, own=True) as fresh, h5py.File(fresh, "w", track_order=True) as file:
        for column in [column for column in branch.columns if column.name != "point"]:
            _put(file, column, branch[column.name], ["point"])
        _put(file, _SCALARS, curves.values, ["point", "scalar"])
        _put(file, _BEGIN, curves.begin, ["piece", "scalar"])
        _put(file, _END, curves.end, ["piece", "scalar"])
        file.attrs.update(
            format=FORMAT,
            meaning=json.dumps(described(branch.meaning)),
            columns=json.dumps(branch.names),
            converged=int(branch.converged),
            reason=branch.reason,
            missed=json.dumps(branch.missed),
            started=branch.started,
            **{ATTRIBUTE: branch.unit_system.name},
        )


def read(kind: Callable[..., Made], path: Path) -> Made:
    """The branch that `write` wrote, made by `kind`.

    Raises
    ------
    InputError
        There is no such file, or it holds no branch.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            found = dict(file.attrs)
            values = {name: file[name][()] for name in file}
            said = {name: (str(file[name].attrs.get("units")), str(file[name].attrs.get("long_name"))) for name in file}
    except OSError as error:
        text = " ".join(str(error).split())
        raise InputError("there is no branch to read", str(path), text, None, "give a file of Branch.save") from None
    if found.get("format") != FORMAT:
        measured = str(found.get("format", "another format"))
        raise InputError("the file holds no branch", str(path), measured, FORMAT, "give a file of Branch.save")
    units = units_of(found)
    named = [COLUMNS.get(name) or Column(name, *said[name]) for name in json.loads(found["columns"])]
    columns = columns_named(over(named, said["amplitude"][0]), units)
    values["event"] = np.array([text.decode() for text in values["event"]], dtype=str)
    return kind(
        columns,
        values,
        state_of(json.loads(found["meaning"])),
        Cubic(values["scalars"], values["slope_begin"], values["slope_end"]),
        bool(found["converged"]),
        str(found["reason"]),
        json.loads(found["missed"]),
        str(found["started"]),
    )


_SCALARS = Column("scalars", "1", "scalar unknowns of the points")
_BEGIN = Column("slope_begin", "1", "derivative of the scalars by the share of a step, at its begin")
_END = Column("slope_end", "1", "derivative of the scalars by the share of a step, at its end")


def _put(file: h5py.File, column: Column, values: npt.NDArray[Any], dimensions: list[str]) -> None:
    """A variable on its dimensions, which are made with the first variable that has them."""
    import h5py

    text = column.kind == "s"
    data = np.array([str(value) for value in values], dtype=object) if text else np.asarray(values)
    variable = file.create_dataset(column.name, data=data, dtype=h5py.string_dtype() if text else None)
    variable.attrs.update(column.attributes)
    name_dimensions(file, variable, dimensions)
