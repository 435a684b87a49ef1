"""Estimated errors of a worn mode against many more harmonics at the same depths, and what they leave alone."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import whole
from test_wear_of_a_blade import AREAS, CYCLES, K_W, worn_blade
from tolerances import REPEATED

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

REPORTS = (0.3, 1.0, 4.0, 5.0)


def eigenvalue(mode: fw.WornMode, state) -> complex:
    found = mode.problem.state(state.y)
    return complex(-found["beta"], found["omega"])


@pytest.mark.ranks(1, 2)
def test_they_are_those_of_the_mode_at_these_depths(comm):
    """New and worn, H = 3 against H = 31 from the same motion: within a factor of 3, of a frequency that is 0.2 to 2 %
    off."""
    mode, y = worn_blade(comm)
    finer, other = worn_blade(comm, highest=31)
    other.destroy()
    for point in fw.Wear(mode, y, CYCLES, report_at=REPORTS):
        if point.event not in ("start", "report"):
            continue
        found, here = mode.errors(point.state), eigenvalue(mode, point.state)
        guess = mode.problem.embedded(finer.problem, point.state.y)
        true = abs(here - eigenvalue(finer, finer.solve(point.state.depth, guess)))
        mode.wear(point.state.depth)
        assert true > 1e-3 * abs(here) and true / 3 < found["omega_error"] < 3 * true
        assert found["zeta_error"] == pytest.approx(found["omega_error"] / abs(here), rel=REPEATED)


@pytest.mark.parametrize("route", ["direct", "krylov"])
def test_a_march_is_the_same_with_them_and_without(comm, route):
    """Their solver is their own: beside the march's a point's last digits chose other steps later on."""
    ends = []
    for estimated in (False, True):
        mode, y = worn_blade(comm, route=route, highest=5)
        march = fw.Wear(mode, y, CYCLES, fw.WearControl(tolerance=1e-3))
        errors = [mode.errors(point.state, estimated)["omega_error"] for point in march]
        assert np.isfinite(errors).all() == estimated
        ends.append((march.eta, *march.state.depth, *whole(march.state.y)))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("errors", [None, True, False])
def test_a_script_has_them_where_it_asks_for_them(comm, errors):
    mode, y = worn_blade(comm)
    y.destroy()
    problem = mode.problem
    mode.destroy()
    branch = fw.follow(problem, 1e-3, 4e-3, report_at=[3.5e-3])
    worn = fw.wear(branch, 3.5e-3, K_W, AREAS, 1.0, cycle_unit=CYCLES, report_at=[0.3, 2.0], errors=errors)
    assert worn.missed == ["report at 2 cycles: beyond the last of 1 cycles"] and worn.missed[0] in repr(worn)
    known = np.isfinite(worn["omega_error"])
    assert len(worn) > 4 and (known == ((worn["event"] != "") if errors is None else errors)).all()
    assert (known == np.isfinite(worn["lambda_error_harmonics"])).all()
    if errors is not False:
        at = branch.at(amplitude=3.5e-3)
        assert worn["omega_error"][0] == pytest.approx(at["omega_error"][0], rel=1e-2)
