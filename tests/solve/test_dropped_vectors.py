"""Vectors dropped without their destroy(): petsc4py keeps them, and the next point of any branch frees them."""

from __future__ import annotations

import gc
import re

import numpy as np
import pytest
from models.duffing import mode
from petsc4py import PETSc

import fretwave as fw


def left_half_way() -> None:
    problem = mode()
    branch = fw.Continuation(problem, problem.initial(0.1), (0.1, 4.0))
    for _ in range(4):
        next(branch)


def to_its_end() -> None:
    problem = mode()
    for _ in fw.Continuation(problem, problem.initial(0.1), (0.1, 4.0)):
        pass


def with_accuracy() -> None:
    fw.follow(mode(), 0.1, 4.0, accuracy=1e-3)


def at_rest() -> None:
    parameters = {"tangential_stiffness": 100.0, "normal_stiffness": 100.0, "friction_coefficient": 0.3}
    pad = fw.Contact("coulomb_2d", np.eye(2)[[1, 0]], parameters)
    fw.static_preload(fw.Model(np.eye(2), np.diag([640.0, 40.0]), contacts=[pad]), np.array([5.0, 2.0]))


@pytest.mark.parametrize("work", [left_half_way, to_its_end, with_accuracy, at_rest])
def test_repeated_work_leaves_no_more_to_petsc_than_done_once(work, capfd, comm):
    """It left as much each time: 5, 33, 16 and 30 vectors."""

    def kept() -> int:
        gc.collect()
        capfd.readouterr()
        PETSc.garbage_view(comm)
        comm.barrier()
        found = re.search(r"Rank 0:: Total entries: (\d+)", capfd.readouterr().out)
        return int(comm.bcast(int(found.group(1)) if found else None))

    PETSc.garbage_cleanup(comm)
    work()
    once = kept()
    for _ in range(3):
        work()
    assert kept() <= once <= 12
