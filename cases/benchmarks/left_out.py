"""What fretwave leaves out where it is not needed, and what that saves: each scene with it left out and forced on.

    OMP_NUM_THREADS=1 .venv/bin/python cases/benchmarks/left_out.py

Every measurement is a process of its own; the two forms of a scene take turns, the least of some counts. Time is
processor time, memory the growth of the process's peak over what it had with fretwave loaded (of a whole process: its
peak). `tests/cases/test_left_out.py` holds the same scenes, smaller, to rounding.
"""

from __future__ import annotations

import argparse
import csv
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

import fretwave as fw
from fretwave import build_model, fe, load_case

CASES = Path(__file__).resolve().parents[1]
TURNS, ENOUGH = 3, 12.0  #: turns, and seconds after which two are enough
PAD = {"normal_stiffness": 4e7, "tangential_stiffness": 3e7, "friction_coefficient": 0.3, "normal_load": 50.0}
STEEL = fe.Material(2.1e11, 0.3, 7800.0)
#: What a scene finds: arrays that are compared each by its own largest entry (by 1 where that is zero).
Found = list[np.ndarray]


def branch(problem: Any, stop: tuple[float, float], reports: Sequence[float], steps: Any = None) -> tuple[Any, Found]:
    """A branch and omega, zeta at some amplitudes."""
    found = fw.follow(problem, stop[0], stop, report_at=reports, errors=False, steps=steps)
    assert found.converged, found.reason
    rows = [row for row, event in enumerate(found["event"]) if event == "report"]
    assert len(rows) == len(reports)
    return found, [found["omega"][rows], found["zeta"][rows]]


def even_harmonics(forced: bool, size: int, comm: MPI.Comm) -> Found:
    """The oscillator's mode, and the largest coefficient of even order [m]."""
    orders = range(size + 1) if forced else range(1, size + 1, 2)
    with build_model(load_case(CASES / "two_dof" / "case.toml"), [], comm) as model:
        start = fw.linear_modes(model, 1)[0]
        problem = fw.NonlinearMode(model, fw.Harmonics(orders, 1024), "CNM", 0, start)
        found, table = branch(problem, (0.02, 3.0), [0.05, 0.25, 2.0])
        labels = problem.harmonics.labels
        even = [k for k, label in enumerate(labels) if int(label.strip("cs")) % 2 == 0]
        Q = comm.bcast(found.coefficients(len(found) - 1))
        problem.destroy()
    return [*table, np.abs(Q[:, even]).max(initial=0.0)[None]]


class Cubic(fw.PythonLaw):
    """The built-in cubic spring once more: a law in Python is given the velocity too."""

    odd, stuck_stiffness = True, 0.0

    def force(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return 0.5 * (u * u * u)

    def tangent(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (1.5 * (u * u))[:, None], np.zeros_like(v)[:, None]


def evaluated(model: fw.Model, orders: Sequence[int], samples: int, times: int) -> Found:
    """Residual and product with the Jacobian (n_dof, m) of a random motion without a mean, some times."""
    comm, n = model.comm, model.n_dof
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics(orders, samples), "CNM", 0, start)
    m, moving = problem.harmonics.block_size, 2 * len([order for order in orders if order])
    q = np.zeros((n, m))
    q[:, m - moving :] = 0.1 * np.random.default_rng(0).standard_normal((n, moving))
    y = problem.core.unknowns()
    y.setArray(np.append(q.ravel(), [0.0, 1.0, 0.0])[slice(*y.getOwnershipRange())])
    for _ in range(times):
        r = problem.residual(y)
        product = problem.jacobian_product(y, y)
    found = [np.concatenate(comm.allgather(v.getArray(readonly=True).copy())) for v in (r, product)]
    problem.destroy()
    return [v[: n * m].reshape(n, m) for v in found]


def mean(forced: bool, size: int, comm: MPI.Comm) -> Found:
    """Friction pairs that move in odd harmonics, and the largest mean of residual and product."""
    eye = sp.identity(32 * size, format="csr")
    law = fw.Contact("regularised_coulomb", eye, {"friction_limit": 0.5, "regularisation_velocity": 0.05})
    with fw.Model(eye, eye, None, [law], comm) as model:
        found = evaluated(model, [0, 1, 3, 5, 7] if forced else [1, 3, 5, 7], 256, 2 * size)
    means = max(np.abs(v[:, :-8]).max(initial=0.0) for v in found)
    return [*(v[:, -8:] for v in found), np.array([means])]


def velocity(forced: bool, size: int, comm: MPI.Comm) -> Found:
    n = 32 * size
    eye = sp.identity(n, format="csr")
    contact = fw.Contact(Cubic(), eye) if forced else fw.Contact("cubic_spring", eye, {"cubic_stiffness": 0.5})
    with fw.Model(eye, eye, None, [contact], comm) as model:
        return evaluated(model, range(8), 256, 2 * size)


def sticking(forced: bool, size: int, comm: MPI.Comm) -> Found:
    """Pairs far from slip, or the springs that they are; all but the load that they bear."""
    n = 3 * 32 * size
    eye, contact = sp.identity(n, format="csr"), []
    K = 1e3 * eye
    if forced:
        pads = {"normal_stiffness": 8.0, "tangential_stiffness": 5.0, "friction_coefficient": 0.4, "normal_load": 1e3}
        contact = [fw.Contact("coulomb_3d", eye, pads)]
    else:
        K = K + sp.diags(np.tile([8.0, 5.0, 5.0], n // 3))
    with fw.Model(eye, K, None, contact, comm) as model:
        found = evaluated(model, range(8), 256, size)
    borne = np.zeros((n, 15), dtype=bool)
    borne[::3, 0] = True
    return [v[~borne] for v in found]


def sector(forced: bool, size: int, comm: MPI.Comm) -> Found:
    sys.path.insert(0, str(CASES / "blisk_lumped"))
    import model as lumped  # type: ignore[import-not-found]

    one, waves, steps = lumped.sector(), 4, fw.StepControl(maximum=0.3)
    with one.model(waves, comm) as model:
        stuck = fw.linear_modes(model, 3)[-1]
        harmonics = fw.choose_harmonics(model, size, 480)
        if not forced:
            return branch(fw.NonlinearMode(model, harmonics, "CNM", 0, stuck), (1e-4, 1e-2), [3e-4, 1e-3], steps)[1]
    with one.wheel(comm) as wheel:
        start = one.around(stuck, waves)
        problem = fw.NonlinearMode(wheel, harmonics, "CNM", 0, start, "wheel_", start.shape - 1j * start.imaginary)
        return branch(problem, (1e-4, 1e-2), [3e-4, 1e-3], steps)[1]


def bar(cells: int) -> tuple[Any, Any, Any, np.ndarray]:
    """Mesh, M and K of a steel bar on springs, and the dofs of the nodes that rub under it."""
    block = fe.Block("bar", (3 * cells, cells, cells), lambda cube: cube * np.array([0.3, 0.05, 0.05]))
    mesh = fe.join([block], order=1)
    M, K = fe.assemble(mesh, STEEL)
    under = np.flatnonzero((mesh.nodes[:, 2] < 1e-9) & (mesh.nodes[:, 0] < 0.11))
    return mesh, M, K + 1e8 * sp.identity(mesh.n_dof), (3 * under[:, None] + np.array([2, 0, 1])).ravel()


def mass_off_diagonal(forced: bool, size: int, comm: MPI.Comm) -> Found:
    """A lumped mass, with the zeros of K's pattern stored beside it or not."""
    _, M, K, _ = bar(size)
    lumped = sp.diags(np.asarray(M.sum(axis=1)).ravel(), format="csr")
    if forced:
        stored = sp.csr_matrix(K, copy=True)
        rows = np.repeat(np.arange(stored.shape[0]), np.diff(stored.indptr))
        stored.data = np.where(rows == stored.indices, lumped.diagonal()[rows], 0.0)
        lumped = stored
    with fw.Model(lumped, K, None, [], comm) as model:
        return evaluated(model, range(8), 64, 10 * size)


def rubbing(M: Any, K: Any, rows: np.ndarray, n: int, comm: MPI.Comm) -> fw.Model:
    B = sp.csr_matrix((np.ones(len(rows)), (np.arange(len(rows)), rows)), (len(rows), n))
    return fw.Model(M, K, 1e-7 * K, [fw.Contact("coulomb_3d", B, PAD, "pads")], comm)


def pads_mode(model: fw.Model, tip: int, worn: Callable[[Any, Any], Any] | None = None) -> Found:
    """The bar's mode from stick through slip, and of all its points what `worn` makes of them."""
    stuck = fw.linear_modes(model, 1)[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", tip, stuck)
    rest = fw.balanced(model, stuck)
    problem.preload(rest.displacement, rest.load)
    found, table = branch(problem, (2e-6, 2e-5), [4e-6, 8e-6, 1.6e-5], fw.StepControl(initial=0.3, maximum=0.3))
    assert found["slip"].max() > 0
    states = []
    for row in range(len(found) if worn else 0):
        y = found.unknowns(row)
        states.append(worn(problem, y))
    problem.destroy()
    return [*table, *(np.array([state[key] for state in states]) for key in ("omega", "zeta") if worn)]


def reduction(forced: bool, size: int, comm: MPI.Comm) -> Found:
    """All component modes kept: nothing is lost, and nothing won."""
    mesh, M, K, rows = bar(size)
    tip = 3 * mesh.nearest([0.3, 0.05, 0.05]) + 1
    if not forced:
        with rubbing(M, K, rows, mesh.n_dof, comm) as model:
            return pads_mode(model, tip)
    keep = np.append(np.unique(rows), tip)
    with fw.reduce(M, K, keep=keep, modes=mesh.n_dof - len(keep), comm=comm) as made:
        places = np.array([made.places[int(row)] for row in rows])
        with rubbing(made.M, made.K, places, made.size, comm) as model:
            return pads_mode(model, made.places[tip])


def wear(forced: bool, size: int, comm: MPI.Comm) -> Found:
    """Every point as it is, or at the end of a march of surfaces that do not wear."""
    mesh, M, K, rows = bar(size)
    areas = {"pads": np.full(len(rows) // 3, 1e-4)}

    def march(problem: Any, y: Any) -> Any:
        mode = fw.WornMode(problem, 0.0, areas)
        *_, last = fw.Wear(mode, y, 1.0)
        state = problem.state(last.state.y)
        mode.destroy()
        return state

    with rubbing(M, K, rows, mesh.n_dof, comm) as model:
        tip = 3 * mesh.nearest([0.3, 0.05, 0.05]) + 1
        return pads_mode(model, tip, march if forced else lambda problem, y: problem.state(y))


def run(analysis: str, *arguments: str) -> Found:
    """Columns of an analysis of the oscillator's short form, by the command line."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["run", str(CASES / "two_dof" / "case.toml"), "--quick", "--only", analysis, "--out", folder]
        subprocess.run([sys.executable, "-m", "fretwave", *command, *arguments], check=True, capture_output=True)
        with open(Path(folder) / f"{analysis}.csv", newline="") as file:
            rows = list(csv.DictReader(file))
    keys = ("amplitude", "omega", "zeta" if analysis == "mode" else "phase")
    return [np.array([float(row[key]) for row in rows]) for key in keys]


def pictures(forced: bool, size: int, comm: MPI.Comm) -> Found:
    short = ["--set", "mode.amplitude=[0.02, 0.05]", "--set", "mode.report_at=[]"]
    return run("mode", *([] if size else short), *([] if forced else ["--no-plots"]))


def time_integration(forced: bool, size: int, comm: MPI.Comm) -> Found:
    """With 4 % of viscous damping: steady state comes the sooner."""
    settings = [f"forced.time_points={int(forced)}", "forced.levels=[2.0]", "model.C=[[2.0, 0.0], [0.0, 0.04]]"]
    short = [] if size else ["forced.frequency=[4.0, 4.05]"]
    return run("forced", "--no-plots", *(part for one in [*settings, *short] for part in ("--set", one)))


@dataclass(frozen=True)
class Row:
    """What is left out of which scene; `size` of the table, `small` of the test."""

    what: str
    scene: str
    where: str
    of: Callable[[bool, int, MPI.Comm], Found]
    size: int
    small: int
    held_by: str = "test_left_out.py"


ROWS = {
    row.of.__name__: row
    for row in (
        Row(
            "even harmonics and the mean, and half of the period",
            "`two_dof`, mode, H = 21",
            "left out where every law is odd and nothing preloads it (`retain`)",
            even_harmonics,
            21,
            7,
            "test_harmonics.py: forced on, half a period",
        ),
        Row(
            "harmonic 0 alone, and half of the period",
            "1,024 `regularised_coulomb` pairs, 1, 3, 5, 7: residual and product",
            "with the even harmonics",
            mean,
            32,
            2,
        ),
        Row(
            "velocity in time",
            "1,024 cubic springs, H = 7, N_t = 256: residual and product",
            "left out for laws that do not read it; forced on by a law in Python, whose arrays are part of "
            "its cost: an upper bound",
            velocity,
            32,
            2,
        ),
        Row(
            "slip of pairs that stick",
            "512 stuck `coulomb_3d` pairs, H = 7: residual and product",
            "left out as long as a pair stands: no nodes, no slider to follow. Nothing forces it on: what "
            "is left of such pairs (whether they stand, a dense block each) beside springs in K",
            sticking,
            16,
            2,
        ),
        Row(
            "all sectors but one",
            "`blisk_lumped`, wave of 4 diameters, 24 sectors, H = 3",
            "left out unless `wheel = true`",
            sector,
            3,
            1,
            "test_wheel.py: the branch of its sector",
        ),
        Row(
            "zeros of a diagonal mass matrix",
            "steel bar of 2,025 nodes, mass lumped, H = 7: residual and product",
            "left out as far as the matrix does not store them: what is stored is worked on",
            mass_off_diagonal,
            8,
            2,
        ),
        Row(
            "pictures and matplotlib",
            "`two_dof --quick`, mode, whole process",
            "left out with `--no-plots`; a run loads matplotlib to draw, for nothing else",
            pictures,
            1,
            0,
        ),
        Row(
            "time integration",
            "`two_dof --quick` with 4 % of damping, forced, one level, one point in time, whole process",
            "left out unless `time_points` or an analysis of free motion asks",
            time_integration,
            1,
            0,
        ),
        Row(
            "reduction",
            "steel bar of 160 nodes on 16 `coulomb_3d` pads, mode, H = 3",
            "left out unless `[reduction]` asks; forced on with all component modes",
            reduction,
            3,
            2,
        ),
        Row(
            "wear",
            "steel bar of 325 nodes on 25 `coulomb_3d` pads, mode, H = 3",
            "left out unless an analysis of wear asks; forced on with k_w = 0 at every point: such a march ends as it "
            "begins, so that this measures that nothing is paid, not what a march costs",
            wear,
            4,
            2,
            "test_wear_case.py: without a coefficient",
        ),
    )
}


def distance(forced: Found, left: Found) -> float:
    """Largest relative difference, array by array."""
    return max(float(np.abs(a - b).max() / (np.abs(b).max() or 1.0)) for a, b in zip(forced, left))


def one(row: Row, forced: bool) -> None:
    """A measurement, in this process."""
    whole = row.of in (pictures, time_integration)
    who = resource.RUSAGE_CHILDREN if whole else resource.RUSAGE_SELF

    def spent() -> tuple[float, float]:
        used = resource.getrusage(who)
        return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024

    if not whole:
        with fw.Model([[1.0]], [[1.0]], None, [], MPI.COMM_SELF) as model:  # loads the solvers
            fw.linear_modes(model, 1)
    began, held = spent()
    found = row.of(forced, row.size, MPI.COMM_SELF)
    ended, most = spent()
    print(json.dumps({"seconds": ended - began, "mb": most - held, "found": [a.tolist() for a in found]}))


def measured(row: Row) -> dict[str, Any]:
    """Both forms in turns."""
    told: dict[bool, list[dict[str, Any]]] = {True: [], False: []}
    for turn in range(TURNS):
        if turn > 1 and sum(result["seconds"] for results in told.values() for result in results) > ENOUGH:
            break
        for forced, results in told.items():
            command = [sys.executable, __file__, "--one", row.of.__name__, *(["--forced"] if forced else [])]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            results.append(json.loads(done.stdout.splitlines()[-1]))
    best = {
        (key, forced): min(result[key] for result in results)
        for forced, results in told.items()
        for key in ("seconds", "mb")
    }
    forced, left = ([np.array(a) for a in told[key][0]["found"]] for key in (True, False))
    return {**{f"{key}_{forced}": value for (key, forced), value in best.items()}, "distance": distance(forced, left)}


def lines(rows: Sequence[Row]) -> Iterator[str]:
    yield "| left out | scene | time [s]: forced on, left out | ratio | memory [MB]: forced on, left out | difference |"
    yield "|---|---|---:|---:|---:|---:|"
    for row in rows:
        m = measured(row)
        times, mbs = (tuple(m[f"{key}_{forced}"] for forced in (True, False)) for key in ("seconds", "mb"))
        yield (
            f"| {row.what} | {row.scene} | {times[0]:.3g}, {times[1]:.3g} | {times[0] / times[1]:.2f} | "
            f"{mbs[0]:.1f}, {mbs[1]:.1f} | {m['distance']:.0e} |"
        )
    yield ""
    yield "| left out | when | held to rounding by |"
    yield "|---|---|---|"
    for row in rows:
        yield f"| {row.what} | {row.where} | {row.held_by} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--one", choices=ROWS, help="measure one form of one scene")
    parser.add_argument("--forced", action="store_true", help="of these, with all of it")
    parser.add_argument("--only", nargs="+", choices=ROWS, default=list(ROWS), help="these rows alone")
    options = parser.parse_args()
    if options.one:
        return one(ROWS[options.one], options.forced)
    for line in lines([ROWS[name] for name in options.only]):
        print(line, flush=True)


if __name__ == "__main__":
    main()
