"""What contact costs: the march of 3-D Coulomb contact beside the machine's limits, and a point of a synthetic model.

Run it on one core from the top folder:  OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/kernels.py [march | point]
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
from fretwave import balanced

PAIRS, SAMPLES, HARMONICS = (48, 192, 768, 3072), 128, 7
LAW = {"normal_stiffness": 2.0, "tangential_stiffness": 1.5, "friction_coefficient": 0.4}
#: Normal loads under the same motion: every pair sticks; slips on a curved path; slips and lifts off.
LOADS = {"stick": 100.0, "slip": 4.0, "lift-off": 1.0}
#: Doubles that leave the caches for a pair and a sample: the record, written by the force and read by the product
#: (displacements and forces live in tiles). All of it in one pass would be 3 displacements and 3 forces more.
TRAFFIC, ONE_PASS = 3 * 8, (3 + 3 + 3) * 8
#: Libraries and functions that perf names, and what they do.
PARTS = {
    "march, force": r"contact::(march|left_rest|shoot|farthest|extent)\b|SliderClosure|Coulomb3d::(force|close)",
    "march, product": r"contact::linear_march\b|Coulomb3d::(linearised|product)",
    "march, tangents": r"Coulomb3d",
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


def limits() -> tuple[float, float, float]:
    """Memory bandwidth of b + s c far beyond the caches [B/s], flops of dgemm [1/s], 1 / sqrt(x) in the cache [1/s]."""
    n, size, few = 8_000_000, 800, 4096
    a, b, c = (np.ones(n) for _ in range(3))
    A, B = np.ones((2, size, size))
    x, y = np.ones((2, few))

    def triad() -> None:
        np.multiply(c, 3.0, out=a)
        np.add(a, b, out=a)

    def direction() -> None:
        np.sqrt(x, out=y)
        np.divide(1.0, y, out=y)

    return 5 * 8 * n / fastest(triad, 3), 2 * size**3 / fastest(lambda: A @ B, 3), few / fastest(direction, 3)


def pairs_alone(pairs: int, samples: int, load: float) -> tuple[Any, PETSc.Vec, PETSc.Vec]:
    """Pairs on a mass each: contact and transforms only, and a motion of the first four orders."""
    n, m = 3 * pairs, 2 * HARMONICS + 1
    unit = sp.identity(n, format="csr")
    model = fw.Model(unit, unit, None, [fw.Contact("coulomb_3d", unit, {**LAW, "normal_load": load})])
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics(range(HARMONICS + 1), samples), "EPMC", 0, start)
    y, dy = (problem.core.unknowns() for _ in range(2))
    rng = np.random.default_rng(0)
    motion = np.where(np.arange(m) < 7, 0.5, 0.0) * rng.standard_normal((n, m))
    y.setArray(np.concatenate([motion.ravel(), [0, 1, 0]]))
    dy.setArray(np.concatenate([rng.standard_normal(n * m), [0, 0, 0]]))
    return problem, y, dy


def march(options: argparse.Namespace) -> None:
    """Residual and Jacobian product of pairs alone, and inside them the march and the transforms."""
    bandwidth, flops, directions = limits()
    m = 2 * HARMONICS + 1
    print(f"machine: triad {1e-9 * bandwidth:.1f} GB/s, dgemm {1e-9 * flops:.1f} Gflop/s, "
          f"1/sqrt(x) {1e-9 * directions:.2f} G/s (one core, as it is now)")  # fmt: skip
    print(f"limits a pair and sample: memory {1e9 * TRAFFIC / bandwidth:.1f} ns for the record alone ({TRAFFIC} B; "
          f"{1e9 * ONE_PASS / bandwidth:.1f} ns if nothing were tiled), slip directions {1e9 / directions:.1f} ns a "
          f"march, transforms {1e9 * 12 * m / flops:.1f} ns ({12 * m} flops, H = {HARMONICS})")  # fmt: skip
    print(f"ns per pair and sample of the period (N_t = {SAMPLES}); the march alone by perf:")
    print("   pairs  motion      residual  product   force  d force  transforms   stick/slip/open")
    for name, load in LOADS.items():
        for pairs in PAIRS:
            problem, y, dy = pairs_alone(pairs, SAMPLES, load)
            times = (1e9 * t / (pairs * SAMPLES) for t in evaluation_times(problem, y, dy))
            status = "/".join(f"{problem.diagnostics(y)[k]:.2f}" for k in ("stick", "slip", "open"))
            inside = "  ".join(f"{part:7.1f}" for part in march_alone(pairs, load)) or "(no perf)"
            print(f"{pairs:8d}  {name:10s}" + "".join(f"{t:10.1f}" for t in times) + f"{inside}   {status}", flush=True)


def evaluation_times(problem: Any, y: PETSc.Vec, dy: PETSc.Vec) -> tuple[float, float]:
    """Processor time [s] of a residual and of a Jacobian product."""
    r = problem.core.equations()
    return fastest(lambda: problem.core.residual(y, r)), fastest(lambda: problem.core.product(y, dy, r))


def workload(options: argparse.Namespace) -> None:
    """What `perf` looks into: one size of pairs, residuals and products in turn."""
    problem, y, dy = pairs_alone(options.pairs, options.samples, options.load)
    r, calls = problem.core.equations(), max(1, int(3e7 / (options.pairs * options.samples)))
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
    return shares, done.stdout


def march_alone(pairs: int, load: float) -> list[float]:
    """[ns] of the law's force, of its linearisation and of a pair of transforms; nothing without perf."""
    found = shares_of(["--workload", "--pairs", str(pairs), "--samples", str(SAMPLES), "--load", str(load)])
    if found is None:
        return []
    shares, printed = found
    scale = float(printed) / (1 - shares["all else (Python, start, system)"])
    transforms = (shares["Fourier transforms"] + shares["dense algebra (BLAS, LAPACK)"]) / 2  # of force and product
    return [scale * share for share in (shares["march, force"], shares["march, product"], transforms)]


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
    """Points of the branch with the processor time of each."""
    steps = fw.StepControl(initial=0.1, max_points=options.points)
    branch = fw.Continuation(problem, problem.initial(options.start), (options.start, 100 * options.start), steps)
    rows: list[dict[str, Any]] = []
    points = iter(branch)
    while True:
        began = time.process_time()
        p = next(points, None)
        seconds = time.process_time() - began
        if p is None:
            return rows
        names = ("parameter", "event", "newton", "linear", "residual")
        row = {**{name: getattr(p, name) for name in names}, **problem.diagnostics(p.y), "seconds": seconds}
        rows.append(row)
        if options.verbose:
            print("   a {parameter:.3e} slip {slip:.3f} open {open:.3f} newton {newton} GMRES {linear} "
                  "{seconds:.3f} s {event}".format(**row))  # fmt: skip


def report_shares(highest: int, options: argparse.Namespace) -> None:
    """The same branch under perf, in a process of its own."""
    found = shares_of(["point", "--no-shares", "--harmonics", str(highest), "--route", options.route])
    if found is None:
        print("   perf is not available here")
        return
    for part, share in sorted(found[0].items(), key=lambda item: -item[1]):
        print(f"   {100 * share:5.1f} %  {part}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", default="all", choices=["all", "march", "point"])
    parser.add_argument("--workload", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--pairs", type=int, default=768)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--load", type=float, default=1.0, help=argparse.SUPPRESS)
    parser.add_argument("--harmonics", type=int, nargs="+", default=[3, 15])
    parser.add_argument("--points", type=int, default=30)
    parser.add_argument("--start", type=float, default=1e-4)
    parser.add_argument("--route", default="krylov", choices=["krylov", "direct"])
    parser.add_argument("--no-shares", dest="shares", action="store_false", help="without perf")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    if options.workload:
        return workload(options)
    if options.what != "point":
        march(options)
    if options.what != "march":
        point(options)


if __name__ == "__main__":
    main()
