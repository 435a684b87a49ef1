"""Events in PETSc's log have the same numbers on all ranks, whatever one rank does alone."""

from __future__ import annotations

import json

import pytest

pytestmark = pytest.mark.ranks(1)

NAMES = ["FwTable", "FwPoint", "FwRecord", "FwErrorEstimate", "FwSectors"]
SCRIPT = """
import json
from mpi4py import MPI
from petsc4py import PETSc
from fretwave.mpi.log import event
from fretwave.mpi.petsc_options import AnalysisOptions

comm = MPI.COMM_WORLD
with AnalysisOptions("x_", ["-log_view :{log}:ascii_xml"]).inserted():
    if comm.rank == 0:
        with event("FwTable"):  # a table is written on the first rank alone
            PETSc.Vec().createSeq(3).norm()
    with event("FwPoint"), event("FwRecord"):
        PETSc.Vec().createMPI(8, comm=comm).norm()
numbers = comm.gather([PETSc.Log.Event(name).id for name in {names}])
if comm.rank == 0:
    print(json.dumps(numbers))
"""


def test_a_nested_log_tells_them_by_name_where_a_rank_has_more_of_them(launch, tmp_path):
    log = tmp_path / "log.xml"
    ended = launch(2, "-c", SCRIPT.format(log=log, names=NAMES))
    assert ended.returncode == 0, ended.stderr
    first, second = json.loads(ended.stdout.strip().splitlines()[-1])
    assert first == second and len(set(first)) == len(NAMES)
    told = log.read_text(encoding="utf-8")
    assert "<name>FwRecord</name>" in told and " -> " not in told
