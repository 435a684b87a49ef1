"""Tuned constants: each an option of PETSc with its meaning, refused where it is no number above zero."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from models.core_models import options

import fretwave as fw
from fretwave import _core
from fretwave.commands import doctor


def newton(comm):
    model = fw.Model(np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]]), comm=comm)
    problem = fw.NonlinearMode(model, fw.Harmonics([1, 3], 16), "CNM", 0)
    return _core.Newton(problem.core, "tuned_")


def test_each_has_a_value_and_a_meaning_of_its_own():
    options, values, meanings = zip(*_core.tuned_constants())
    assert len(options) > 40 and len(set(options)) == len(options) and min(values) > 0
    assert len(set(meanings)) > len(meanings) - 3 and all(len(meaning) > 15 for meaning in meanings)


@pytest.mark.ranks(1)
def test_none_is_an_integer_by_the_other_side_of_a_conditional():
    """`first ? 1 : small` is an int in C++, and a constant of 1e-3 was zero."""
    for file in (Path(__file__).parents[2] / "src").rglob("*.cpp"):
        text = file.read_text()
        for name in re.findall(r"Tuned (\w+)\(", text):
            found = re.search(rf"\? *\d+ *: *{name}\b(?! *[*/+-])|\? *{name} *: *\d+\b(?!\.)", text)
            assert not found, f"{file.name}: {found and found[0]}"


def test_an_option_takes_its_place(comm):
    assert newton(comm).route == "direct (11 unknowns)"
    with options(fw_linear_krylov_limit=5):
        assert newton(comm).route.startswith("krylov (11 unknowns)")


@pytest.mark.parametrize("value", [0, -1, "inf"])
def test_no_number_above_zero_is_refused(comm, value):
    with options(fw_linear_krylov_limit=value), pytest.raises(fw.InputError, match="fw_linear_krylov_limit"):
        newton(comm)


@pytest.mark.ranks(1)
def test_doctor_lists_them():
    said: list[str] = []
    assert doctor.main(["--constants"], said.append) == 0
    lines = "\n".join(said).splitlines()
    assert len(lines) == len(_core.tuned_constants())
    assert any(line.split()[:2] == ["-fw_linear_krylov_limit", "300"] for line in lines)


@pytest.mark.ranks(1)
def test_none_is_cast_to_an_integer():
    """1e300 is none; `count` bounds it."""
    for file in (Path(__file__).parents[2] / "src").rglob("*.cpp"):
        text = file.read_text()
        for name in re.findall(r"Tuned (\w+)\(", text):
            found = re.search(rf"\b(int|size_t|PetscInt)(\(| \w+ = )(double\()?{name}\b(?!\.)", text)
            assert not found, f"{file.name}: {found and found[0]}"


def slider(comm) -> fw.NonlinearMode:
    law = {"tangential_stiffness": 1.0, "friction_limit": 1.0}
    model = fw.Model(np.eye(1), np.eye(1), None, [fw.Contact("jenkins", np.eye(1), law)], comm=comm)
    return fw.NonlinearMode(model, fw.Harmonics([1, 3], 64), "CNM", 0)


@pytest.mark.ranks(1)
def test_a_share_of_one_and_more_is_refused(comm):
    with options(fw_error_tolerance=2), pytest.raises(fw.InputError, match="above zero and below 1"):
        fw.follow(slider(comm), 2.0, 2.5)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("given", [{"fw_error_slowest": 10, "fw_error_fastest": 2}, {"fw_error_steps": 1e300}])
def test_numbers_that_cross_or_are_huge_stop_nothing(comm, given):
    """Bounds that cross aborted the process where the library asserts their order."""
    with options(**given):
        branch = fw.follow(slider(comm), 2.0, 2.5)
    assert branch.converged and np.isfinite(branch["zeta_error"]).all()
