"""Analyses that follow branches, written as a run writes them."""

from __future__ import annotations

import numpy as np
from models.duffing import steps

import fretwave as fw
from fretwave.analyses.parts.branch import points_of, record
from fretwave.columns import FLUTTER, FORCED, MODE
from fretwave.results.results import AnalysisWriter

COLUMNS = {"mode": MODE, "flutter": FLUTTER, "forced": FORCED}


def write_branches(
    folder, comm, kind, problems, ends, length=0.05, stop_after=None, name="", rows=(), report_at=(), **attributes
):
    """The branches of some problems in one table. Collective.

    Parameters
    ----------
    stop_after : rows after which each is interrupted, and gone on with from its snapshot
    rows : further columns of each branch
    """
    name, described = name or kind, {"type": kind, **attributes}
    on = comm.rank == 0
    writer = AnalysisWriter(folder, name, COLUMNS[kind], described, ["x"], ["1c", "1s"], active=on)
    for number, problem in enumerate(problems):

        def more(*_, number=number):
            return rows[number] if rows else {}

        branch = fw.Continuation(problem, problem.initial(ends[0]), ends, steps(length), report_at)
        for point in points_of(branch):
            record(writer, problem, point, None, {}, more)
            if writer.rows == stop_after:
                snapshot = branch.snapshot()
                break
        if stop_after is not None:
            branch = fw.Continuation.restore(problem, snapshot, ends, steps(length), report_at)
            for point in points_of(branch):
                record(writer, problem, point, None, {}, more)
    writer.close("done", "stop value reached")
    comm.barrier()
    return fw.open_run(folder)[name]


def relative(found, expected):
    """Largest difference as a share of the largest value expected."""
    return np.abs(np.asarray(found) - expected).max() / np.abs(expected).max()
