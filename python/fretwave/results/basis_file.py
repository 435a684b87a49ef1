"""reduction.h5: the basis of a run's reduction, so that its motion reaches the nodes where nothing can be solved.

::

    basis                      (n_dof, n_r) x = T x_r; float64, since strain is a small difference of displacements
    model                      (4,) what tells the model that was reduced from another
    ties/<k>/row, dof, value   of a sector, on its reduced coordinates: dofs with both faces from those k places ahead
    load                       names of the static loads that act in some analysis
    beyond                     (n_dof, n_loads) static displacement under each that x_r has not [length]

Kept once a run, beside results.h5: it belongs to all analyses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Union

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array
from ..errors import InputError
from ..files.whole import check_whole, replaced, seal
from ..model.sectors import Sparse, by_sector
from ..texts import display

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..cyclic.reduction import SectorReduction
    from ..model.reduction import Reduction
    from ..model.structure import Structure

NAME = "reduction.h5"
#: Bytes of a basis above which a run does not keep it.
LARGEST = 256e6
#: Columns that all ranks have at a time.
COLUMNS = 32


@dataclass(frozen=True)
class Basis:
    """What `fretwave view` needs of a reduction.

    Attributes
    ----------
    T : (n_dof, n_r)
    model : (4,)
        `marks_of` the model that was reduced.
    highest_component_hz : of the last component mode, 0 without one
    n_interface : coordinates of one face of a sector, 0 for a structure
    ties : {k: (n_r, n)}
        Of a sector: coordinates with both faces from those of the sector k places ahead.
    loads : {name: (n_dof,)}
        Of each load that acts in some analysis the static displacement that no coordinate has [length].
    """

    T: Array
    model: Array
    highest_component_hz: float
    n_interface: int = 0
    ties: Mapping[int, Sparse] = field(default_factory=dict)
    loads: Mapping[str, Array] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """n_r, of a sector with both faces."""
        return int(self.T.shape[1])

    def expand(self, x_r: npt.ArrayLike, /) -> Array:
        """Motion of all dofs, (n_dof,) or (n_dof, n), from coordinates (n_r,) or (n_r, n)."""
        return np.asarray(self.T @ np.asarray(x_r, dtype=float))

    def beyond(self, names: Sequence[str]) -> Array:
        """Static displacement (n_dof,) under these loads together that no coordinate has."""
        return np.asarray(sum((self.loads[name] for name in names), np.zeros(len(self.T))))

    def write(self, path: Path) -> None:
        """Write it as a whole.

        Raises
        ------
        FileError
            The disk does not take it.
        """
        import h5py

        with replaced(path) as fresh:
            with h5py.File(fresh, "w") as file:
                data = file.create_dataset("basis", data=self.T)
                data.attrs.update({"units": "1", "long_name": "dofs by reduced coordinates"})
                file.create_dataset("model", data=self.model)
                file.attrs.update(highest_component_hz=self.highest_component_hz, n_interface=self.n_interface)
                if self.loads:
                    file["load"] = [name.encode() for name in self.loads]
                    data = file.create_dataset("beyond", data=np.column_stack(list(self.loads.values())))
                    data.attrs["long_name"] = "static displacement under each load that the basis has not"
                for k, T in self.ties.items():
                    entries = sp.coo_matrix(T)
                    group = file.create_group(f"ties/{k}")
                    group.attrs["shape"] = entries.shape
                    for name, values in (("row", entries.row), ("dof", entries.col), ("value", entries.data)):
                        group.create_dataset(name, data=values)
            seal(fresh)


def marks_of(full: Structure) -> Array:
    """(4,) of an unreduced model: dofs, and sums of the magnitudes in K, M and the coordinates of the nodes.

    A builder may read what neither the case nor its own text tells.
    """
    sums = [float(abs(A).sum()) for A in (full.own("K"), full.own("M")) if A is not None]
    return np.array([full.n_dof, *sums, float(np.abs(full.coordinates).sum()) if full.coordinates is not None else 0.0])


def basis_of(
    reduction: Union[Reduction, SectorReduction], full: Structure, comm: MPI.Comm, names: Sequence[str] = ()
) -> Basis | None:
    """Of a reduction of a model; on the first rank, None elsewhere. Collective.

    Parameters
    ----------
    names : static loads that act in some analysis
    """
    from ..cyclic.reduction import SectorReduction

    n, blocks = reduction.size, []
    for first in range(0, n, COLUMNS):
        unit = np.eye(n)[:, first : first + COLUMNS]
        block = reduction.expand(np.ascontiguousarray(unit))
        if comm.rank == 0:
            blocks.append(block)
    loads = dict(zip(names, reduction.beyond(np.column_stack([full.loads[name] for name in names])).T)) if names else {}
    if comm.rank:
        return None
    hz = reduction.highest_component_hz
    if not isinstance(reduction, SectorReduction):
        return Basis(np.hstack(blocks), marks_of(full), hz, loads=loads)
    ties = {k: sp.csr_matrix(T) for k, T in by_sector(reduction.sector().ties).items()}
    return Basis(np.hstack(blocks), marks_of(full), hz, reduction.n_interface, ties, loads)


def read_basis(path: Path) -> Basis | None:
    """That of a run; None where it keeps none.

    Raises
    ------
    InputError
        The file is damaged.
    """
    import h5py

    if not path.exists():
        return None
    check_whole(path, NAME)
    try:
        with h5py.File(path, "r") as file:
            ties = {int(k): _matrix(group) for k, group in file.get("ties", {}).items()}
            hz, faces = float(file.attrs["highest_component_hz"]), int(file.attrs["n_interface"])
            names = [name.decode() for name in file["load"][()]] if "load" in file else []
            loads = dict(zip(names, file["beyond"][()].T)) if names else {}
            return Basis(file["basis"][()], file["model"][()], hz, faces, ties, loads)
    except (OSError, KeyError) as error:
        fix = "remove it: the reduction is then made again, with MPI and PETSc"
        raise InputError(f"{NAME} cannot be read", display(path), str(error), None, fix) from None


def _matrix(group: object) -> Sparse:
    at = {name: group[name][()] for name in ("row", "dof", "value")}  # type: ignore[index]
    shape = tuple(int(n) for n in group.attrs["shape"])  # type: ignore[attr-defined]
    return sp.csr_matrix((at["value"], (at["row"], at["dof"])), shape=shape)
