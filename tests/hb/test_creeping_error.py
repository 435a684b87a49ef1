"""What EPMC says of its error above zeta = 1, where the free motion creeps and lambda knows no frequency."""

from __future__ import annotations

import pytest

import fretwave as fw

BETA = 2.0  #: [1/s] of a mass of 1 kg
W0 = 2 * 1.0 * 2.0 / (1.0 + 2.0)  #: of a mass that is 1 rad/s fast on one side and 2 rad/s on the other


def creeping(comm, harmonics, **asked):
    """Branch of a mass on a spring of 1 N/m that touches a stop of 3 N/m at rest, overdamped."""
    stop = fw.Contact("unilateral_spring", [[1.0]], {"normal_stiffness": 3.0, "gap": 0.0})
    model = fw.Model([[1.0]], [[1.0]], [[2 * BETA]], [stop], comm)
    start = fw.linear_modes(model, count=1, contact="free")[0]
    mode = fw.NonlinearMode(model, fw.choose_harmonics(model, harmonics, 64), method="EPMC", dof=0, start=start)
    return fw.follow(mode, 0.1, 0.2, **asked)


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("harmonics", [1, 4])
def test_the_error_of_zeta_is_told_where_the_motion_does_not_oscillate(comm, harmonics):
    """It was zero: lambda = -beta is exact, w0 is not."""
    branch = creeping(comm, harmonics)
    off = abs(branch["zeta"][0] - BETA / W0)
    assert off > 1e-6 and off / 3 < branch["zeta_error"][0] < 3 * off
    assert branch["omega"][0] == 0.0


@pytest.mark.ranks(1)
def test_an_accuracy_is_of_the_periodic_motion_that_stands_for_it(comm):
    branch = creeping(comm, 1, accuracy=1e-4)
    assert abs(branch["zeta"] * W0 / BETA - 1).max() < 1e-4
