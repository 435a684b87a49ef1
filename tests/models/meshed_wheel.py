"""A small shrouded wheel of hexahedra: a sector as an FE code gives it, and the whole wheel assembled in one frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.linalg
import scipy.sparse as sp

import fretwave as fw
from fretwave import fe
from fretwave.commands.main import main
from fretwave.mpi.guard import on_first_rank

SECTORS, HEIGHT = 5, 0.03
#: Bore (held), rim, under the shroud, over it.
RADII = (0.1, 0.14, 0.2, 0.21)
STEEL = fe.Material(youngs_modulus=210e9, poisson_ratio=0.3, density=7800.0)
STIFFNESS = 3e8


def angle_of(sector: float, offset: float = 0.0) -> float:
    """Of a sector's middle [rad]."""
    return offset + 2 * np.pi / SECTORS * sector


def place(sector: float, sides: tuple[float, float], radii: tuple[float, float]) -> Callable[[np.ndarray], np.ndarray]:
    """A block between two angles (-1 and 1 are the sector's faces) and two radii, about z."""

    def mapped(u: np.ndarray) -> np.ndarray:
        angle = angle_of(sector) + np.pi / SECTORS * (sides[0] + u[:, 0] * (sides[1] - sides[0]))
        r = radii[0] + u[:, 2] * (radii[1] - radii[0])
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), HEIGHT * (u[:, 1] + 0.2 * r * u[:, 1])])

    return mapped


def mesh(sector: float) -> fe.Mesh:
    """Of one sector in its place."""
    sides = {"low": (-1.0, -0.3), "middle": (-0.3, 0.4), "high": (0.4, 1.0)}
    rim = [fe.Block(f"rim_{n}", (1, 1, 1), place(sector, s, RADII[:2])) for n, s in sides.items()]
    shroud = [fe.Block(f"shroud_{n}", (1, 1, 1), place(sector, s, RADII[2:])) for n, s in sides.items()]
    return fe.join([*rim, fe.Block("blade", (1, 1, 2), place(sector, sides["middle"], RADII[1:3])), *shroud], order=1)


@dataclass
class Wheel:
    """Faces and shroud ends are matched by the blocks' grids, not by `fretwave`."""

    offset: float = 0.0  #: of the sector that is cut out [sectors]

    @cached_property
    def sector(self) -> fe.Mesh:
        return mesh(self.offset)

    @cached_property
    def matrices(self) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """M and K, all nodes free."""
        return fe.assemble(self.sector, STEEL)

    def face(self, part: str, side: str) -> np.ndarray:
        """Nodes of a face of the rim or the shroud, in the same order on both sides."""
        return self.sector.block_side(f"{part}_{side}", 0, 0 if side == "low" else 1).ravel()

    @cached_property
    def free(self) -> np.ndarray:
        """Nodes beyond the bore."""
        return np.flatnonzero(np.hypot(*self.sector.nodes[:, :2].T) > RADII[0] * (1 + 1e-9))

    def hz(self, springs: str = "") -> np.ndarray:
        """Frequencies of the whole wheel, its shrouds joined by springs: "stuck", "sliding" or "" for none."""
        n = len(self.sector.nodes)
        number = np.arange(SECTORS * n).reshape(SECTORS, n)
        for j in range(SECTORS):
            number[j, self.face("rim", "high")] = number[(j + 1) % SECTORS, self.face("rim", "low")]
        places = [(3 * number[j][:, None] + np.arange(3)).ravel() for j in range(SECTORS)]
        total = 3 * number.size
        M, K = np.zeros((2, total, total))
        for j in range(SECTORS):
            M_j, K_j = fe.assemble(mesh(self.offset + j), STEEL)
            M[np.ix_(places[j], places[j])] += M_j.toarray()
            K[np.ix_(places[j], places[j])] += K_j.toarray()
            self._add_springs(K, number[j], number[(j + 1) % SECTORS], self.offset + j + 0.5, springs)
        kept = (3 * np.unique(number[:, self.free])[:, None] + np.arange(3)).ravel()
        squares = scipy.linalg.eigh(K[np.ix_(kept, kept)], M[np.ix_(kept, kept)], eigvals_only=True)
        return np.sqrt(squares) / (2 * np.pi)

    def _add_springs(self, K: np.ndarray, own: np.ndarray, ahead: np.ndarray, at: float, springs: str) -> None:
        angle = angle_of(at)
        normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
        directions = {"": [], "sliding": [normal], "stuck": list(np.eye(3))}[springs]
        for a, b in zip(own[self.face("shroud", "high")], ahead[self.face("shroud", "low")]):
            for direction in directions:
                row = np.zeros(len(K))
                row[3 * a : 3 * a + 3], row[3 * b : 3 * b + 3] = direction, -direction
                dofs = np.flatnonzero(row)
                K[np.ix_(dofs, dofs)] += STIFFNESS * np.outer(row[dofs], row[dofs])

    def write(self, folder: Path, axis: str = "z") -> list[str]:
        """Files of the sector, wheel about `axis`, and the command that imports it; nodes are numbered from 1."""
        turn = np.roll(np.eye(3), "xyz".index(axis) + 1, axis=0)  # x, y, z of the mesh along the next axes
        T = sp.kron(sp.identity(len(self.sector.nodes)), turn, format="csr")
        dofs = (3 * self.free[:, None] + np.arange(3)).ravel()
        for letter, A in zip("MK", self.matrices):
            sp.save_npz(folder / f"{letter}.npz", sp.csr_matrix((T @ A @ T.T).tocsr()[dofs][:, dofs]))
        table = "".join(f"{node + 1},{direction}\n" for node in self.free for direction in (1, 2, 3))
        (folder / "dofs.csv").write_text(table, encoding="utf-8")
        mixed = np.random.default_rng(1).permutation
        faces = {
            f"{part}{side}": mixed(self.face(part, side)) + 1 for part in ("rim", "shroud") for side in ("low", "high")
        }
        faces |= {
            f"whole{side}": np.concatenate([faces[f"rim{side}"], faces[f"shroud{side}"]]) for side in ("low", "high")
        }
        np.savez(folder / "nodes.npz", coordinates=self.sector.nodes @ turn.T, **faces)
        given = ["--mass", "M.npz", "--stiffness", "K.npz", "--dofs", "dofs.csv", "--coordinates", "nodes.npz"]
        return ["import", str(folder / "m.h5"), *(str(folder / w) if "." in w else w for w in given)]


def sector_of(axis: str = "z", **changes: str) -> list[str]:
    """Options that say what the sector is."""
    given = {"sectors": str(SECTORS), "low": "RIMLOW", "high": "RIMHIGH", "axis": axis, **changes}
    return [word for key, value in given.items() for word in (f"--{key}", value) if value]


PAIRS = ["--pairs", "shroud=SHROUDHIGH", "SHROUDLOW@next"]


def imported(comm, folder: Path, wheel: Wheel, *options: str, axis: str = "z") -> fw.Structure:
    """The sector as the model file m.h5 of an import gives it. Collective."""
    command = on_first_rank(comm, lambda: wheel.write(folder, axis))
    assert main([*command, *options]) == 0
    comm.barrier()
    return on_first_rank(comm, lambda: fw.read_model(folder / "m.h5"))
