"""The blade root without reduction against the reduced model, and what the reduced model says of its own error.

``python cases/blade_root/unreduced.py [--harmonics 7] [--modes 10] [--coarse] [amplitudes]`` prints the table; it runs
under mpirun as well. Each unreduced point starts from the reduced model's motion.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

import fretwave as fw
from fretwave import _core, balanced

sys.path.insert(0, str(Path(__file__).parent))
from model import build  # noqa: E402

FRICTION, STIFFNESS_DAMPING = 0.5, 2e-6  #: as in case.toml
COARSE = {"axial_cells": 6, "thickness_cells": 1, "radial_cells": (2, 1, 1, 2, 11)}
START = 2e-4  #: amplitude at which the reduced branch begins, stuck [m]


def problem(M: Any, K: Any, B: Any, parameters: Any, dof: int, harmonics: fw.Harmonics, prefix: str) -> Any:
    """A complex nonlinear mode of the first bending."""
    contact = fw.Contact("coulomb_3d", B, {**parameters, "friction_coefficient": FRICTION}, "root")
    model = fw.Model(M, K, STIFFNESS_DAMPING * K, [contact])
    first = fw.linear_modes(model, 1, "stuck")[0]
    rest = balanced(model, first)
    mode = fw.NonlinearMode(model, harmonics, "CNM", dof, first, prefix)
    mode.preload(rest.displacement, rest.load)
    return mode


def lifted(full: Any, reduction: fw.Reduction, small: Any, y: Any) -> Any:
    """Unknowns of the unreduced problem from a reduced point (no static displacement). Collective."""
    state = small.state(y)
    Q = small.model.comm.bcast(small.coefficients(y))
    q = reduction.expand(Q).ravel() / state["amplitude"]
    scalars = [state["beta"] / full.start.omega, state["omega"] / full.start.omega, np.log(state["amplitude"])]
    out = full.core.unknowns()
    out.setArray(np.append(q, scalars)[slice(*out.getOwnershipRange())])
    return out


def solve(newton: Any, mode: Any, y: Any, amplitude: float) -> tuple[bool, int, int, float, str]:
    """Newton at this amplitude, in place. Collective."""
    row = mode.core.unknowns()
    row.set(0)
    row.setValue(row.getSize() - 1, 1.0)
    row.assemble()
    newton.system.close(row, np.log(amplitude))
    return newton.solve(y)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--harmonics", type=int, default=7)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--modes", type=int, default=10, help="component modes")
    parser.add_argument("--coarse", action="store_true", help="7,215 dofs in place of 31,275")
    parser.add_argument("amplitudes", type=float, nargs="*", default=[4e-4, 1e-3, 1.3e-3])
    chosen = parser.parse_args()
    rank = MPI.COMM_WORLD.rank

    built = build(**(COARSE if chosen.coarse else {}))
    root, tip = built.pairs["root"], built.dofs["tip"]
    harmonics = fw.Harmonics(range(chosen.harmonics + 1), chosen.samples)
    keep = np.union1d(np.unique(root.B.indices), [tip])
    reduction = fw.reduce(built.M, built.K, STIFFNESS_DAMPING * built.K, keep=keep, modes=chosen.modes)
    B = sp.hstack([root.B[:, keep], sp.csr_matrix((root.B.shape[0], chosen.modes))])
    small = problem(reduction.M, reduction.K, B, root.parameters, int(np.searchsorted(keep, tip)), harmonics, "small_")
    full = problem(built.M, built.K, root.B, root.parameters, tip, harmonics, "full_")
    newton = _core.Newton(full.core, "full_")
    if rank == 0:
        print(f"{reduction.size} of {built.M.shape[0]} dofs, H = {chosen.harmonics}, {MPI.COMM_WORLD.size} ranks")
        print(f"{'':11}{'omega [rad/s]':>32}{'':14}{'zeta':>26}{'':12}slip Newton GMRES  estimate[s] solve[s]")
        print("amplitude     unreduced       difference    estimated      unreduced   difference    estimated")
    stop = (0.5 * START, 1.001 * chosen.amplitudes[-1])
    branch = fw.Continuation(small, small.initial(START), stop, report_at=chosen.amplitudes, upwards=True)
    for point in branch:
        if point.event == "report":
            compare(reduction, small, full, newton, point, rank)
    if not branch.converged:
        raise fw.NotConverged("the reduced branch breaks off", None, branch.reason, f"{stop[1]:.4g} m")
    if rank == 0:
        print(newton.route)
        print(f"peak memory of rank 0: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024} MB")


def compare(reduction: fw.Reduction, small: Any, full: Any, newton: Any, point: Any, rank: int) -> None:
    """One line of the table. Collective."""
    reduced, estimate = small.state(point.y), fw.nonlinear_error(reduction, small, point.y)
    y, began = lifted(full, reduction, small, point.y), time.process_time()
    converged, steps, iterations, _, reason = solve(newton, full, y, reduced["amplitude"])
    cost = time.process_time() - began
    found, slip = full.state(y), full.diagnostics(y)["slip"]
    if rank:
        return
    words = [f"{reduced['amplitude']:9.2e}"]
    for key, form in (("omega", "17.9f"), ("zeta", "15.10f")):
        words.append(f"{found[key]:{form}} {found[key] - reduced[key]:12.4e} {getattr(estimate, key):12.4e}")
    words.append(f"{slip:7.3f} {steps:5d} {iterations:6d} {estimate.wall_s:9.1f} {cost:9.1f}")
    print(*words, "" if converged else reason, flush=True)


if __name__ == "__main__":
    main()
