"""Keys of a case that would be left aside in silence, or make two branches of one name, are told."""

from __future__ import annotations

from pathlib import Path

import pytest

from fretwave.case.load import load_case
from fretwave.errors import CaseErrors

pytestmark = pytest.mark.ranks(1)
CASES = Path(__file__).parents[2] / "cases"
TWICE = {
    ("two_dof", "forced.levels=[1.0, 2.0, 1.0]"): "forced.levels[2] is 1 again",
    ("two_dof", "mode.report_at=[0.1, 0.1]"): "mode.report_at[1] is 0.1 again",
    ("two_dof", "free_decay.amplitude=[0.5, 0.5]"): "free_decay.amplitude[1] is 0.5 again",
    ("blisk_lumped", "flutter.nodal_diameters=[3, -3, 3]"): "flutter.nodal_diameters[2] is 3 again",
    ("blisk_lumped", "linear.nodal_diameters=[3, 3]"): "linear.nodal_diameters[1] is 3 again",
    ("blisk_lumped", "linear.engine_orders=[4, 4]"): "linear.engine_orders[1] is 4 again",
    ("blade_root", "wear.amplitude=[1e-3, 1e-3]"): "wear.amplitude[1] is 0.001 again",
}
NO_EFFECT = {
    ("blisk_lumped", "reduction={modes=1, interface_waves=3}"): "reduction.interface_waves has no effect",
    ("blisk_lumped", "reduction={modes=1, interface_tolerance=1e-3}"): "reduction.interface_tolerance has no effect",
    ("blisk_lumped", "reduction={modes=1, compare=0, compare_diameters=[3]}"): "compare_diameters has no effect",
    ("two_dof", "reduction={modes=1, interface_waves=3}"): "reduction.interface_waves is of no sector of a wheel",
    ("two_dof", "mode.report_at=[99.0]"): "mode.report_at[0] is outside the branch",
    ("two_dof", "mode.step={maximun=0.1}"): "unknown key 'maximun' in mode.step",
}


@pytest.mark.parametrize("case, override", [*TWICE, *NO_EFFECT])
def test_it_is_told_beforehand(case: str, override: str) -> None:
    with pytest.raises(CaseErrors) as caught:
        load_case(CASES / case / "case.toml", [override])
    assert {**TWICE, **NO_EFFECT}[case, override] in str(caught.value) and "fix:" in str(caught.value)


@pytest.mark.parametrize("error_at, noted", [(0.5, False), (99.0, True)])
def test_an_error_of_the_reduction_on_no_branch_is_noted(error_at: float, noted: bool) -> None:
    notes = load_case(CASES / "two_dof" / "case.toml", [f"reduction={{modes=1, error_at={error_at}}}"]).notes
    assert any(f"reduction.error_at = {error_at:g} is on no mode's branch" in note for note in notes) == noted
