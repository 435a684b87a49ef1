"""Reading VTKHDF as its specification says, and a mesh to write."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from fretwave import fe


def read_step(path: Path, step: int) -> dict[str, np.ndarray]:
    """Points, cells and fields of a step, by the offsets of the specification's section on temporal data."""
    with h5py.File(path) as file:
        root, steps = file["VTKHDF"], file["VTKHDF/Steps"]
        part, parts = steps["PartOffsets"][step], steps["NumberOfParts"][step]
        n, n_cells, ids = (
            root[f"NumberOf{name}"][part : part + parts] for name in ("Points", "Cells", "ConnectivityIds")
        )
        point, cell, at = (steps[f"{name}Offsets"][step] for name in ("Point", "Cell", "ConnectivityId"))
        found = {"points": root["Points"][point : point + n.sum()]}
        found["types"] = root["Types"][cell[0] : cell[0] + n_cells.sum()]
        found["cells"] = []
        first, offset, start = 0, cell[0] + part, at[0]
        for points, cells, length in zip(n, n_cells, ids):
            cut = root["Offsets"][offset : offset + cells + 1]
            nodes = root["Connectivity"][start : start + length]
            found["cells"] += [first + nodes[a:b] for a, b in zip(cut, cut[1:])]
            first, offset, start = first + points, offset + cells + 1, start + length
        for name, data in root["PointData"].items():
            begin = steps[f"PointDataOffsets/{name}"][step]
            found[name] = data[begin : begin + n.sum()]
        for name, data in root["FieldData"].items():
            found[name] = data[steps[f"FieldDataOffsets/{name}"][step]]
    return found


def skewed_mesh() -> fe.Mesh:
    """2 x 1 x 1 triquadratic cells under a trilinear map."""
    corners = np.array(
        [[0, 0, 0], [2.2, 0, 0.1], [0, 1, 0], [2, 1.3, 0], [0.1, 0, 1], [2, 0.2, 1.4], [0, 1.1, 1], [2, 1, 1]]
    )

    def place(u: np.ndarray) -> np.ndarray:
        weights = [(1 - u[:, 0], u[:, 0]), (1 - u[:, 1], u[:, 1]), (1 - u[:, 2], u[:, 2])]
        return sum(
            (weights[0][i] * weights[1][j] * weights[2][k])[:, None] * corners[i + 2 * j + 4 * k]
            for i in (0, 1)
            for j in (0, 1)
            for k in (0, 1)
        )

    return fe.join([fe.Block("skewed", (2, 1, 1), place)], 2)
