"""What the core's tests share counts and restores as it says."""

from __future__ import annotations

import pytest
from models.core_models import counting
from petsc4py import PETSc


@pytest.mark.ranks(1)
def test_an_event_that_an_error_left_open_does_not_hide_those_behind_it():
    PETSc.Log.begin()
    event = PETSc.Log.Event("fw_left_open")
    event.begin()
    try:
        before = event.getPerfInfo()["count"]
        event.begin()
        event.end()
        assert event.getPerfInfo()["count"] == before  # PETSc's own rule, which this is about
        with counting("fw_left_open") as events:
            event.begin()
            event.end()
            assert events() == 1
    finally:
        event.end()
