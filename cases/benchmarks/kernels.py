"""What a point of a branch costs on a synthetic model with contact in three dimensions, and where its time goes.

Run it on one core from the top folder:  OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/kernels.py
Times of points are wall time, those of single calls processor time of this process: the same on an idle machine.
Shares by function need `perf`.
What a pair costs alone is in CONTACT.md.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from petsc4py import PETSc

import fretwave as fw
from fretwave import balanced

#: Libraries and functions that perf names, and what they do.
PARTS = {
    "contact, linearised force": r"SliderDerivative|CircularContact::(linearise|add_\w*blocks)",
    "contact, products": r"CircularContact::(blocks|product)",
    "contact, integrals of the force": r"CircularContact::|Indicator|Arc::",
    "contact, motion of the sliders": r"SweptSlider|SliderPeriod|MovingDisc|PanelGrid|Radau|NormalContact",
    "Fourier transforms": r"libfftw|FourierTransform",
    "dense algebra (BLAS, LAPACK)": r"libopenblas|libblas|liblapack",
    "PETSc": r"libpetsc",
    "residual, preconditioner": r"fretwave::",
}


def fastest(run: Callable[[], Any], repeats: int = 7) -> float:
    """Least processor time [s] of one call."""
    run()
    once = max(1e-7, timed(run))
    calls = max(1, int(0.05 / once))
    return min(timed(lambda: [run() for _ in range(calls)]) for _ in range(repeats)) / calls


def timed(run: Callable[[], Any]) -> float:
    began = time.process_time()
    run()
    return time.process_time() - began


def shares_of(arguments: list[str]) -> dict[str, float] | None:
    """Shares of a run's processor time by part; None without perf."""
    if not shutil.which("perf"):
        return None
    with tempfile.TemporaryDirectory() as folder:
        data = f"{folder}/perf.data"
        command = ["perf", "record", "-q", "-F", "499", "-o", data, sys.executable, __file__, *arguments]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            return None
        listing = [
            "perf",
            "report",
            "-i",
            data,
            "--stdio",
            "--no-children",
            "-F",
            "overhead,dso,symbol",
            "-w",
            "0,0,400",
        ]
        report = subprocess.run(listing, capture_output=True, text=True).stdout
    shares = dict.fromkeys([*PARTS, "all else (Python, start, system)"], 0.0)
    for share, name in re.findall(r"^\s*([\d.]+)%\s+(.*)$", report, re.M):
        part = next((part for part, pattern in PARTS.items() if re.search(pattern, name)), list(shares)[-1])
        shares[part] += float(share) / 100
    return shares


def brick(size: Any, young: float = 1.1e11, poisson: float = 0.3) -> tuple[Any, Any]:
    """Mass per density and stiffness (24 x 24) of a trilinear hexahedron of this size [m], titanium."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    lame, shear = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    D = np.diag([lame + 2 * shear] * 3 + [shear] * 3)
    D[:3, :3] += lame * (1 - np.eye(3))
    M, K, volume = np.zeros((24, 24)), np.zeros((24, 24)), np.prod(size) / 8
    for point in corners / np.sqrt(3):
        factors = (1 + corners * point) / 2
        N = factors.prod(axis=1)
        grad = np.stack([corners[:, i] / 2 * np.delete(factors, i, 1).prod(axis=1) * 2 / size[i] for i in range(3)])
        S = np.zeros((6, 24))
        for i in range(3):
            S[i, i::3] = grad[i]
        for row, (i, j) in enumerate([(0, 1), (1, 2), (0, 2)], 3):
            S[row, i::3], S[row, j::3] = grad[j], grad[i]
        shape = np.kron(N[None], np.eye(3))
        M, K = M + volume * shape.T @ shape, K + volume * S.T @ D @ S
    return M, K


def blade() -> tuple[Any, Any, Any]:
    """M, K and node numbers (17, 3, 6) of a plate: ten rows of nodes in the root, seven outside."""
    nodes = np.arange(17 * 3 * 6).reshape(17, 3, 6)
    M, K = np.zeros((2, 3 * nodes.size, 3 * nodes.size))
    parts = {long: brick(np.array([0.012 if long else 0.003, 0.004, 0.006])) for long in (False, True)}
    for i, j, k in np.ndindex(16, 2, 5):
        m, stiffness = parts[i >= 9]
        dofs = (3 * nodes[i : i + 2, j : j + 2, k : k + 2].ravel()[:, None] + np.arange(3)).ravel()
        M[np.ix_(dofs, dofs)] += 4400 * m
        K[np.ix_(dofs, dofs)] += stiffness
    return M, K, nodes


def synthetic() -> tuple[Any, int]:
    """510 dense dofs: 120 contact nodes on the two flanks of a plate's root, its tip, 147 component modes.

    A stop on the innermost row of nodes holds the mean along the flanks, which contact alone would leave free in slip.
    """
    M, K, nodes = blade()
    flanks = np.concatenate([nodes[:10, 0].ravel(), nodes[:10, 2].ravel()])
    kept = (3 * np.append(flanks, nodes[-1, 1, 3])[:, None] + np.arange(3)).ravel()
    stop = (3 * nodes[0, 1][:, None] + [0, 2]).ravel()
    K[stop, stop] += 2e7
    inner = np.setdiff1d(np.arange(len(K)), kept)
    static = -la.solve(K[np.ix_(inner, inner)], K[np.ix_(inner, kept)], assume_a="pos")
    modes = la.eigh(K[np.ix_(inner, inner)], M[np.ix_(inner, inner)])[1][:, : 510 - len(kept)]
    T = np.zeros((len(K), 510))
    T[kept, : len(kept)] = np.eye(len(kept))
    T[inner] = np.hstack([static, modes])
    B = sp.lil_matrix((360, 510))
    for i in range(120):  # normal across the plate, tangents along the blade and along the root
        B[3 * i, 3 * i + 1], B[3 * i + 1, 3 * i], B[3 * i + 2, 3 * i + 2] = (-1.0 if i < 60 else 1.0), 1.0, 1.0
    law = {"normal_stiffness": 2e6, "tangential_stiffness": 1.5e6, "friction_coefficient": 0.3, "normal_load": 50.0}
    return fw.Model(T.T @ M @ T, T.T @ K @ T, None, [fw.Contact("coulomb_3d", B.tocsr(), law)]), 361


def point(options: argparse.Namespace) -> None:
    """Time per point of the synthetic model's branch, and where it goes."""
    model, dof = synthetic()
    first = fw.linear_modes(model, 1, "stuck")[0]
    rest = balanced(model, first)
    print(f"synthetic model: {model.n_dof} dofs, dense, 120 pairs; stuck mode {first.omega / 2 / np.pi:.2f} Hz")
    for highest in options.harmonics:
        branch_cost(model, dof, first, rest, highest, options)
        if options.shares:
            report_shares(highest, options)


def branch_cost(model: Any, dof: int, first: Any, rest: Any, highest: int, options: argparse.Namespace) -> None:
    """One branch from stick to slip and lift-off: time and iterations of its regular points in slip."""
    PETSc.Options()["kernel_route"] = options.route
    problem = fw.NonlinearMode(model, fw.Harmonics(range(highest + 1), options.samples), "CNM", dof, first, "kernel_")
    problem.preload(rest.displacement, rest.load)
    rows = followed(problem, options)
    regular = [row for row in rows if row["slip"] > 0 and row["event"] == ""]
    newton, linear = (sum(row[k] for row in regular) for k in ("newton", "linear"))
    seconds = [row["seconds"] for row in regular]
    print(f"H = {highest}, N_t = {options.samples}, {options.route}: {len(regular)} points in slip (to "
          f"{max(r['slip'] for r in rows):.2f} slip, {max(r['open'] for r in rows):.2f} open), median "
          f"{np.median(seconds):.3f} s a point ({min(seconds):.3f} to {max(seconds):.3f}), {newton / len(regular):.1f} "
          f"Newton steps a point, {linear / newton:.1f} GMRES iterations a step, "
          f"residual <= {max(r['residual'] for r in rows):.0e}")  # fmt: skip


def followed(problem: Any, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Points of the branch with the time of each."""
    steps = fw.StepControl(initial=0.1, max_points=options.points)
    branch = fw.Continuation(problem, problem.initial(options.start), (options.start, 100 * options.start), steps)
    rows: list[dict[str, Any]] = []
    for p in branch:
        names = ("parameter", "event", "newton", "linear", "residual")
        row = {**{name: getattr(p, name) for name in names}, **problem.diagnostics(p.y), "seconds": p.wall_s}
        rows.append(row)
        if options.verbose:
            print("   a {parameter:.3e} slip {slip:.3f} open {open:.3f} newton {newton} GMRES {linear} "
                  "{seconds:.3f} s {event}".format(**row))  # fmt: skip
    return rows


def report_shares(highest: int, options: argparse.Namespace) -> None:
    """The same branch under perf, in a process of its own."""
    found = shares_of(["--no-shares", "--harmonics", str(highest), "--route", options.route])
    if found is None:
        print("   perf is not available here")
        return
    for part, share in sorted(found.items(), key=lambda item: -item[1]):
        print(f"   {100 * share:5.1f} %  {part}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--harmonics", type=int, nargs="+", default=[3, 15])
    parser.add_argument("--points", type=int, default=30)
    parser.add_argument("--start", type=float, default=1e-4)
    parser.add_argument("--route", default="krylov", choices=["krylov", "direct"])
    parser.add_argument("--no-shares", dest="shares", action="store_false", help="without perf")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    point(options)


if __name__ == "__main__":
    main()
