"""Which analysis of a run sees to an option that is given for all of them."""

from __future__ import annotations

import pytest

from fretwave.mpi.petsc_share import HARMONIC_KIND, RunWide, choosing

pytestmark = pytest.mark.ranks(1)

LU, GMRES = {"ksp_type": "preonly"}, {"ksp_type": "gmres"}
#: Solvers of analyses of a kind in their order, and which of them leave an option that none has read to others.
SOLVERS = {
    "alike": ([LU, LU, LU], [False, True, True]),
    "another last": ([LU, GMRES], [True, False]),
    "the first again": ([LU, GMRES, LU], [True, False, True]),
    "two and two": ([LU, GMRES, GMRES, LU], [True, False, True, True]),
}


@pytest.mark.parametrize("solvers, expected", SOLVERS.values(), ids=SOLVERS)
def test_an_option_is_left_to_solvers_that_were_not_there_yet(solvers: list, expected: list[bool]) -> None:
    """Where all solvers have been there, the last of them says that it has no effect, before it begins."""
    own = {f"{letter}_": one for letter, one in zip("abcd", solvers)}
    wide = RunWide([("ksp_restrat", "5")], dict.fromkeys(own, HARMONIC_KIND), own=own)
    assert [wide.left_to_others(prefix, prefix + "ksp_restrat") for prefix in own] == expected


def test_options_of_an_analysis_whose_name_goes_on_are_not_anothers() -> None:
    wide, known = (
        [("mode_epmc_ksp_type", "gmres"), ("mode_pc_type", "lu"), ("mode_ksp_rtol", "1")],
        ["mode_", "mode_epmc_"],
    )
    assert choosing(wide, [("route", "x")], "mode_", known) == {"pc_type": "lu", "route": "x"}
    assert choosing(wide, [], "mode_epmc_", known) == {"ksp_type": "gmres"}
