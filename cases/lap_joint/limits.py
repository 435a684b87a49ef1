"""Frequencies of the whole model (no reduction), stuck and sliding, beside CalculiX' own with ties and with springs.

Ties (*EQUATION) hold the pairs of a limit rigidly: contact of 1e10 N/mm. Springs (SPRING2) are the case's 1e5 N/mm.

    .venv/bin/python cases/lap_joint/limits.py       # after cases/run; with mpirun -n 2 on two ranks
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

import fretwave as fw

HERE = Path(__file__).parent
STIFFNESS = {"ties": 1e10, "springs": 1e5}  # N/mm


def calculix(kind: str, limit: str) -> np.ndarray:
    """Six lowest frequencies [Hz] of the deck with the pairs joined. Rank 0."""
    deck = HERE / "model" / f"{kind}_{limit}.inp"
    deck.write_text(subprocess.check_output([sys.executable, HERE / "deck.py", f"--{kind}", limit], text=True))
    subprocess.run(["ccx", deck.stem], cwd=deck.parent, check=True, capture_output=True)
    rows = (line.split() for line in deck.with_suffix(".dat").read_text().splitlines())
    return np.array([float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()][:6])


def fretwave(kind: str, limit: str) -> np.ndarray:
    """The same of the model file. Collective."""
    plates, k = fw.read_model(HERE / "model" / "joint.h5"), STIFFNESS[kind]
    law = {"normal_stiffness": k, "tangential_stiffness": k, "friction_coefficient": 0.3, "normal_load": 20.0}
    joint = fw.Contact("coulomb_3d", B=plates.pairs["joint"].B, parameters=law)
    joint = joint.sliding() if limit == "sliding" else joint
    with fw.Model(plates.M, plates.K, contacts=[joint], units="mm-t-s") as model:
        return np.array([mode.omega for mode in fw.linear_modes(model, 6, "stuck")]) / (2 * np.pi)


def main() -> None:
    comm = MPI.COMM_WORLD
    if not (HERE / "model").exists():
        sys.exit("error: the model is not made yet\nfix: cases/run lap_joint --quick" if comm.rank == 0 else 1)
    for kind in STIFFNESS:
        for limit in ("stuck", "sliding"):
            expected = comm.bcast(calculix(kind, limit) if comm.rank == 0 else None)
            own = fretwave(kind, limit)
            off = [f"{f:.5f} ({f / c - 1:+.1e})" for f, c in zip(own, expected) if c > 1.0]
            if comm.rank == 0:
                print(f"{kind:8} {limit:8} {', '.join(off)}; {sum(expected <= 1.0)} rigid")


if __name__ == "__main__":
    main()
