"""What contact costs: the march of 3-D Coulomb contact beside the machine's limits, and a point of a synthetic model.

Run it on one core from the top folder:  OMP_NUM_THREADS=1 .venv/bin/python cases/kernel_benchmark.py [march | point]
Times are processor time of this process, the same as wall time on an idle machine. Shares by function need `perf`.
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
from fretwave.preload import balanced

PAIRS, SAMPLES = (48, 192, 768, 5000), (128, 256)
LAW = {"normal_stiffness": 2.0, "tangential_stiffness": 1.5, "friction_coefficient": 0.4, "normal_load": 1.0}
#: Doubles that a march moves for a pair and a sample of the period: two periods of 3 displacements in, 3 forces out
#: and 5 entries of the record (written by the force, read by the product).
TRAFFIC = 2 * (3 + 3 + 5) * 8
#: Functions that perf names, and what they do.
PARTS = {
    "march, force": r"Coulomb3d.*::force",
    "march, product": r"Coulomb3d.*::product",
    "Fourier transforms": r"fftw|FourierTransform|\b[nrht][1-9]\w*_\d+\b|hc2|r2cf|r2cb|\bapply\b",
    "dense algebra (BLAS, LAPACK)": r"gemm|gemv|trsm|trsv|getr|laswp|axpy|dot|scal|_k_|kernel_|nrm2|copy_",
    "PETSc": r"^Vec|^Mat|^KSP|^SNES|^PC|Petsc",
    "dynamic stiffness, residual, preconditioner": r"fretwave::hb|fretwave::solve|fretwave::model",
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


def limits() -> tuple[float, float]:
    """Memory bandwidth of b + s c on arrays far beyond the caches [B/s], and flops of dgemm [1/s]."""
    n, size = 8_000_000, 800
    a, b, c = (np.ones(n) for _ in range(3))
    A, B = np.ones((2, size, size))

    def triad() -> None:
        np.multiply(c, 3.0, out=a)
        np.add(a, b, out=a)

    return 5 * 8 * n / fastest(triad, 3), 2 * size**3 / fastest(lambda: A @ B, 3)


def pairs_alone(pairs: int, samples: int, highest: int = 3) -> tuple[Any, PETSc.Vec, PETSc.Vec]:
    """Pairs on a mass each: a problem that is contact and transforms only, and a motion that sticks, slips and opens."""
    n = 3 * pairs
    unit = sp.identity(n, format="csr")
    model = fw.Model(unit, unit, None, [fw.Contact("coulomb_3d", unit, LAW)])
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics(range(highest + 1), samples), "EPMC", 0, start)
    y, dy = (problem.core.unknowns() for _ in range(2))
    size, rng = y.getSize() - 3, np.random.default_rng(0)
    y.setArray(np.concatenate([0.5 * rng.standard_normal(size), [0, 1, 0]]))
    dy.setArray(np.concatenate([rng.standard_normal(size), [0, 0, 0]]))
    return problem, y, dy


def march(options: argparse.Namespace) -> None:
    """Residual and Jacobian product of pairs alone: transforms, march, transforms; per pair and sample of a period."""
    bandwidth, flops = limits()
    print(f"machine: triad {1e-9 * bandwidth:.1f} GB/s, dgemm {1e-9 * flops:.1f} Gflop/s (one core, as it is now)")
    print(f"limit by memory: {1e9 * TRAFFIC / bandwidth:.1f} ns ({TRAFFIC} B a pair and sample, nothing in the caches)")
    print("ns per pair and sample of the period (the law marches two periods):")
    print("   pairs  samples   residual    product   stick/slip/open")
    for pairs in PAIRS:
        for samples in SAMPLES:
            problem, y, dy = pairs_alone(pairs, samples)
            r = problem.core.equations()
            whole, product = (
                1e9 * fastest(run) / (pairs * samples)
                for run in (lambda: problem.core.residual(y, r), lambda: problem.core.product(y, dy, r))
            )
            shares = problem.diagnostics(y)
            status = "/".join(f"{shares[k]:.2f}" for k in ("stick", "slip", "open"))
            print(f"{pairs:8d} {samples:8d} {whole:10.1f} {product:10.1f}   {status}")


def workload(options: argparse.Namespace) -> None:
    """What `perf` looks into: one size of pairs, residuals and products in turn."""
    problem, y, dy = pairs_alone(options.pairs, options.samples)
    r, calls = problem.core.equations(), max(1, int(2e7 / (options.pairs * options.samples)))
    began = time.process_time()
    for _ in range(calls):
        problem.core.residual(y, r)
        problem.core.product(y, dy, r)
    print(f"{1e9 * (time.process_time() - began) / (calls * options.pairs * options.samples):.3f}")


def shares_of(arguments: list[str]) -> tuple[dict[str, float], str] | None:
    """Shares of a run's processor time by part, and what it printed; None without perf."""
    if not shutil.which("perf"):
        return None
    with tempfile.TemporaryDirectory() as folder:
        data = f"{folder}/perf.data"
        command = ["perf", "record", "-q", "-F", "499", "-o", data, sys.executable, __file__, *arguments]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            return None
        listing = ["perf", "report", "-i", data, "--stdio", "--no-children", "-F", "overhead,symbol", "-w", "0,400"]
        report = subprocess.run(listing, capture_output=True, text=True).stdout
    shares = dict.fromkeys([*PARTS, "all else (Python, start, system)"], 0.0)
    for share, name in re.findall(r"^\s*([\d.]+)%\s+\[.\]\s+(.*)$", report, re.M):
        part = next((part for part, pattern in PARTS.items() if re.search(pattern, name)), list(shares)[-1])
        shares[part] += float(share) / 100
    return shares, done.stdout


def march_alone(options: argparse.Namespace) -> None:
    """The march inside residual and product, by perf."""
    print("of which the march alone, by perf (ns per pair and sample of the period):")
    for pairs in PAIRS:
        found = shares_of(["--workload", "--pairs", str(pairs), "--samples", "128"])
        if found is None:
            print("   perf is not available here")
            return
        shares, printed = found
        busy = 1 - shares["all else (Python, start, system)"]
        force, product = (shares[part] / busy * float(printed) for part in ("march, force", "march, product"))
        print(f"{pairs:8d} pairs: force {force:.1f}, product {product:.1f} of {float(printed):.1f} for both in all")


def synthetic(pairs: int = 120, component_modes: int = 150) -> tuple[Any, int]:
    """Dense reduced model of a blade held by contact at its root: 3 dofs a pair, then component modes.

    A chain of stations on an elastic foundation at its root is condensed on the root (Craig-Bampton form), so that the
    first mode bends the blade and loads the root's pairs.
    """
    rng, n_root = np.random.default_rng(1), 3 * pairs
    where = np.column_stack([rng.uniform(-1, 1, pairs), rng.choice([-1.0, 1.0], pairs), rng.uniform(-1, 1, pairs)])
    distance = np.linalg.norm(where[:, None] - where[None], axis=2)
    link = 0.05 * np.exp(-((distance / 0.4) ** 2))  # elastic root: neighbours pull on each other in all directions
    K_root = np.kron(np.diag(link.sum(1)) - link, np.eye(3))
    omega = 1.0 * np.arange(1, component_modes + 1) ** 1.5  # fixed-interface modes
    rigid = np.vstack([np.hstack([np.eye(3), _cross(p)]) for p in where])  # root motion of a rigid root
    share = rng.standard_normal((6, component_modes)) / np.arange(1, component_modes + 1)
    share[:, 0] = [0.0, 1.0, 0.1, 0.05, 0.0, 1.5]  # the first mode pulls across and turns the root
    coupling = rigid @ la.solve(rigid.T @ rigid, share)
    M = la.block_diag(rigid @ la.solve(rigid.T @ rigid, la.solve(rigid.T @ rigid, rigid.T)) * 3, np.eye(component_modes))
    M[:n_root, :n_root] += 1e-4 * np.eye(n_root)
    M[:n_root, n_root:], M[n_root:, :n_root] = coupling, coupling.T
    K = la.block_diag(K_root + 0.02 * np.eye(n_root), np.diag(omega**2))
    normal = where[:, 1]
    B = sp.lil_matrix((n_root, n_root + component_modes))
    for i in range(pairs):  # normal across (y, towards its flank), tangents along x and z
        B[3 * i, 3 * i + 1], B[3 * i + 1, 3 * i], B[3 * i + 2, 3 * i + 2] = normal[i], 1.0, 1.0
    parameters = {"normal_stiffness": 0.2, "tangential_stiffness": 0.15, "friction_coefficient": 0.4}
    load = rng.uniform(0.5, 1.5, pairs)
    model = fw.Model(M, K, None, [fw.Contact("coulomb_3d", B.tocsr(), {**parameters, "normal_load": load})])
    return model, n_root


def _cross(p: Any) -> Any:
    x, y, z = p
    return np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])


def point(options: argparse.Namespace) -> None:
    """Time per point of the synthetic model's branch, by the Krylov route."""
    model, dof = synthetic()
    began = time.process_time()
    first = fw.linear_modes(model, 1, "stuck")[0]
    print(f"synthetic model: {model.n_dof} dofs, dense, 120 pairs; stuck mode {first.omega:.4f} rad/s, "
          f"{time.process_time() - began:.2f} s")
    rest = balanced(model, first)
    for highest in options.harmonics:
        branch_cost(model, dof, first, rest, highest, options)


def branch_cost(model: Any, dof: int, first: Any, rest: Any, highest: int, options: argparse.Namespace) -> None:
    PETSc.Options()["kernel_route"] = options.route
    problem = fw.NonlinearMode(model, fw.Harmonics(range(highest + 1), options.samples), "CNM", dof, first, "kernel_")
    problem.preload(rest.displacement, rest.load)
    steps = fw.StepControl(initial=0.1, max_points=options.points)
    branch = fw.Continuation(problem, problem.initial(options.start), (options.start, 1e3 * options.start), steps)
    rows, points = [], iter(branch)
    while True:
        began = time.process_time()
        p = next(points, None)
        spent = time.process_time() - began
        if p is None:
            break
        contact = problem.diagnostics(p.y)
        rows.append((p.parameter, contact["slip"], contact["open"], p.newton, p.linear, spent, p.residual))
        if options.verbose:
            print("   a {:.3e} slip {:.3f} open {:.3f} newton {} GMRES {} {:.3f} s residual {:.1e}".format(*rows[-1]))
    moving = [row for row in rows[1:] if row[1] > 0]
    total, newton, linear = (sum(row[k] for row in moving) for k in (5, 3, 4))
    print(f"H = {highest}, N_t = {options.samples}, {options.route}: {len(moving)} points in slip "
          f"(to {max(row[1] for row in rows):.2f} slip, {max(row[2] for row in rows):.2f} open), "
          f"{total / max(1, len(moving)):.3f} s a point, {newton / max(1, len(moving)):.1f} Newton a point, "
          f"{linear / max(1, newton):.1f} GMRES a Newton step; {branch.reason}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", default="all", choices=["all", "march", "point"])
    parser.add_argument("--workload", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--pairs", type=int, default=768)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--harmonics", type=int, nargs="+", default=[3, 15])
    parser.add_argument("--points", type=int, default=25)
    parser.add_argument("--start", type=float, default=0.5)
    parser.add_argument("--route", default="krylov", choices=["krylov", "direct"])
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    if options.workload:
        return workload(options)
    if options.what != "point":
        march(options)
        march_alone(options)
    if options.what != "march":
        point(options)


if __name__ == "__main__":
    main()
