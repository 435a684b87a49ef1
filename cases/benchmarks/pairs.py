"""What a point of a mode costs on reduced models of more and more contact pairs, by kind of preconditioner.

Run it on one core from the top folder:  OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/pairs.py
The plate of kernels.py, its root meshed finer and finer: 48, 192 and 768 pairs with as many component modes each, the
same stiffness and load of the flanks as a whole. Times are processor time, of regular points at which pairs slip.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from kernels import brick, followed
from petsc4py import PETSc

import fretwave as fw
from fretwave import balanced

MODES = 40


def plate(rows: int, across: int) -> tuple[Any, Any, Any]:
    """M, K and node numbers (rows + 7, 3, across): `rows` rows of nodes in the root, seven outside."""
    nodes = np.arange((rows + 7) * 3 * across).reshape(rows + 7, 3, across)
    M, K = np.zeros((2, 3 * nodes.size, 3 * nodes.size))
    root, width = 0.027 / (rows - 1), 0.03 / (across - 1)
    parts = {long: brick(np.array([0.012 if long else root, 0.004, width])) for long in (False, True)}
    for i, j, k in np.ndindex(rows + 6, 2, across - 1):
        m, stiffness = parts[i >= rows - 1]
        dofs = (3 * nodes[i : i + 2, j : j + 2, k : k + 2].ravel()[:, None] + np.arange(3)).ravel()
        M[np.ix_(dofs, dofs)] += 4400 * m
        K[np.ix_(dofs, dofs)] += stiffness
    return M, K, nodes


def reduced(rows: int, across: int) -> tuple[Any, int]:
    """A model with contact on both flanks, 2 rows across pairs, and the dof that is observed."""
    M, K, nodes = plate(rows, across)
    flanks = np.concatenate([nodes[:rows, 0].ravel(), nodes[:rows, 2].ravel()])
    kept = (3 * np.append(flanks, nodes[-1, 1, across // 2])[:, None] + np.arange(3)).ravel()
    stop = (3 * nodes[0, 1][:, None] + [0, 2]).ravel()
    K[stop, stop] += 2e7 * 6 / across
    inner = np.setdiff1d(np.arange(len(K)), kept)
    K_ii, K_ik = K[np.ix_(inner, inner)], K[np.ix_(inner, kept)]
    modes = la.eigh(K_ii, M[np.ix_(inner, inner)], subset_by_index=[0, MODES - 1])[1]
    T = np.zeros((len(K), len(kept) + MODES))
    T[kept, : len(kept)] = np.eye(len(kept))
    T[inner] = np.hstack([-la.solve(K_ii, K_ik, assume_a="pos"), modes])
    half, share = len(flanks) // 2, 120 / len(flanks)
    B = sp.lil_matrix((3 * len(flanks), T.shape[1]))
    for i in range(len(flanks)):
        B[3 * i, 3 * i + 1], B[3 * i + 1, 3 * i], B[3 * i + 2, 3 * i + 2] = (-1.0 if i < half else 1.0), 1.0, 1.0
    law = {"normal_stiffness": 2e6, "tangential_stiffness": 1.5e6, "friction_coefficient": 0.3, "normal_load": 50.0}
    law = {name: value if name == "friction_coefficient" else share * value for name, value in law.items()}
    contact = fw.Contact("coulomb_3d", B.tocsr(), law)
    return fw.Model(T.T @ M @ T, T.T @ K @ T, None, [contact]), len(kept) - 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--meshes", nargs="+", default=["6x4", "12x8", "24x16"], help="rows x nodes across")
    parser.add_argument("--blocks", nargs="+", default=["auto", "dense"])
    parser.add_argument("--harmonics", type=int, default=7)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--points", type=int, default=16)
    parser.add_argument("--start", type=float, default=2e-4)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    print("| pairs | dofs | blocks | points in slip | s a point, median (most) | Newton a point | GMRES a step |")
    print("|---:|---:|---|---:|---|---:|---:|")
    for mesh in options.meshes:
        model, dof = reduced(*(int(n) for n in mesh.split("x")))
        first = fw.linear_modes(model, 1, "stuck")[0]
        rest = balanced(model, first)
        for blocks in options.blocks:
            measure(model, dof, first, rest, blocks, options)


def measure(model: Any, dof: int, first: Any, rest: Any, blocks: str, options: argparse.Namespace) -> None:
    PETSc.Options()["pairs_route"], PETSc.Options()["pairs_blocks"] = "krylov", blocks
    problem = fw.NonlinearMode(
        model, fw.Harmonics(range(options.harmonics + 1), options.samples), "CNM", dof, first, "pairs_"
    )
    problem.preload(rest.displacement, rest.load)
    rows = followed(problem, options)
    regular = [row for row in rows if row["slip"] > 0.01 and row["event"] == "" and row["seconds"] > 0]
    seconds = [row["seconds"] for row in regular]
    newton, linear = (sum(row[name] for row in regular) for name in ("newton", "linear"))
    print(
        f"| {model.contacts[0].n_pairs if hasattr(model.contacts[0], 'n_pairs') else ''} | {model.n_dof} | {blocks} | "
        f"{len(regular)} | {np.median(seconds):.3g} ({max(seconds):.3g}) | {newton / len(regular):.1f} | "
        f"{linear / newton:.1f} |",
        flush=True,
    )


if __name__ == "__main__":
    main()
