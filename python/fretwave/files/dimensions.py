"""Names of the axes of datasets, as netCDF-4 wants them: xarray reads a run as a tree of datasets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import h5py


def name_dimensions(group: h5py.Group, data: h5py.Dataset, names: Sequence[str] = ()) -> None:
    """Dimension scales for every axis of a dataset: those of this group or the one above, or new ones in this group.

    netCDF-4 wants each axis named by a scale in the dataset's own group or in one above. Axes beyond `names` are
    numbered as the dataset's own.
    """
    from h5py import h5ds

    own = data.name[len(group.name) :]
    for axis, size in enumerate(data.shape):
        name = names[axis] if axis < len(names) else _axis_of(own, axis)
        holder = group
        if axis < len(names) and name not in group and name in (above := group.parent):
            holder = above
        scale = holder[name] if name in holder else holder.create_dataset(name, data=np.arange(size))
        if not h5ds.is_scale(scale.id):
            scale.make_scale(name)
        h5ds.attach_scale(data.id, scale.id, axis)


def put_array(group: h5py.Group, name: str, values: npt.ArrayLike, attributes: Mapping[str, Any]) -> None:
    """A further array in the group, replacing one of the same name."""
    for key in [name, *(_axis_of(name, axis) for axis in range(np.ndim(values)))]:
        if key in group:
            del group[key]
    data = group.create_dataset(name, data=values)
    data.attrs.update(attributes)
    name_dimensions(group, data)


def names_of_data(group: h5py.Group) -> list[str]:
    """Names of the datasets of a group that are no dimension scales."""
    from h5py import h5ds

    return [key for key, item in group.items() if hasattr(item, "shape") and not h5ds.is_scale(item.id)]


def _axis_of(name: str, axis: int) -> str:
    return f"axis_{axis}_of_{name.strip('/').replace('/', '_')}"
