"""What a sweep says of wear whose normalised cycles are not the same, older results among them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fretwave.results import summaries

pytestmark = pytest.mark.ranks(1)


@pytest.mark.parametrize("first", [True, False], ids=["first", "last"])
def test_results_without_a_unit_do_not_silence_the_note(first: bool) -> None:
    known = [{"cycle_unit": 1e6}, {"cycle_unit": 2e6}]
    for unknown in ({}, {"cycle_unit": math.nan}):
        assert "1e+06 to 2e+06 vibrations" in summaries._wear_note([unknown, *known] if first else [*known, unknown])
    assert not summaries._wear_note([{}, known[0]]) and not summaries._wear_note([{}])


def test_older_results_have_no_unit() -> None:
    table = {name: np.ones(2) for name in ("amplitude", "cycles", "zeta", "frequency_hz")}
    assert math.isnan(summaries._wear(table, {}, {})["cycle_unit"])
