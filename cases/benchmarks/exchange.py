"""Messages of a rank in one exchange between all ranks, as Open MPI itself counts them (its component `monitoring`).

    .venv/bin/python cases/benchmarks/exchange.py

In two stages as the parts of a wheel exchange what they hold, and by `MPI_Alltoallv`. Ranks share cores as they must.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
from pathlib import Path

RANKS = (2, 3, 4, 7, 16, 37, 64)
TURNS = 20  #: exchanges of a run; what starting sends is counted in one without any
NUMBERS = 3  #: for each rank


def exchange(kind: str, turns: int) -> None:
    """What each rank does."""
    import numpy as np
    from mpi4py import MPI

    from fretwave import _core

    comm = MPI.COMM_WORLD
    out = float(comm.rank) + np.zeros((comm.size, NUMBERS))
    expected = np.repeat(np.arange(comm.size), NUMBERS)
    for _ in range(turns):
        found = np.empty(out.size)
        if kind == "two_stages":
            found[:] = _core.exchange(comm.py2f(), list(out), out.size)
        else:
            counts = [NUMBERS] * comm.size
            comm.Alltoallv([out, counts], [found, counts])
        assert (found == expected).all(), (comm.rank, found)


def sent(kind: str, ranks: int, turns: int) -> list[int]:
    """Messages by rank."""
    with tempfile.TemporaryDirectory() as folder:
        watch = {"enable": 1, "enable_output": 3, "filename": f"{folder}/of"}
        options = [text for key, value in watch.items() for text in ("--mca", f"pml_monitoring_{key}", str(value))]
        command = ["mpirun", "--oversubscribe", "-n", str(ranks), *options, sys.executable, __file__]
        subprocess.run([*command, "--kind", kind, "--turns", str(turns)], check=True)
        files = [Path(folder, f"of.{rank}.prof").read_text().splitlines() for rank in range(ranks)]
    lines = [[line.split("\t") for line in file if line.startswith(("E", "I"))] for file in files]
    return [sum(int(line[4].split()[0]) for line in file) for file in lines]


def most(kind: str, ranks: int) -> float:
    """Messages in one exchange of the rank that sends most."""
    return max((b - a) / TURNS for a, b in zip(sent(kind, ranks, 0), sent(kind, ranks, TURNS)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", help=argparse.SUPPRESS)
    parser.add_argument("--turns", type=int, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.kind:
        exchange(asked.kind, asked.turns)
    else:
        print("| ranks | two stages | MPI_Alltoallv | 2 sqrt(p) |\n|---|---|---|---|")
        for ranks in RANKS:
            figures = [most(kind, ranks) for kind in ("two_stages", "alltoallv")]
            print(f"| {ranks} | {figures[0]:.3g} | {figures[1]:.3g} | {2 * math.sqrt(ranks):.1f} |", flush=True)
