"""What is no object of the kind that a function of scripts takes: one sentence, no error from inside of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

import fretwave as fw

pytestmark = pytest.mark.ranks(1)
OTHERS: dict[str, Any] = {"None": None, "a dict": {}, "a list": [], "an object": object()}
LINEAR = fw.LinearMode(2.0, 0.0, np.ones(1), np.zeros(1))


def model() -> fw.Model:
    return fw.Model([[1.0]], [[4.0]])


def mode() -> fw.NonlinearMode:
    return fw.NonlinearMode(model(), fw.choose_harmonics(model(), 1))


TAKES: dict[str, Callable[[Any], object]] = {
    "choose_harmonics(model": lambda it: fw.choose_harmonics(it, 1),
    "NonlinearMode(model": lambda it: fw.NonlinearMode(it, fw.Harmonics([1], 64)),
    "NonlinearMode(harmonics": lambda it: fw.NonlinearMode(model(), it),
    "ForcedResponse(reference": lambda it: fw.ForcedResponse(mode().model, mode().harmonics, {1: [1]}, 1.0, 0, it),
    "Transient(model": lambda it: fw.Transient(it),
    "linear_modes(model": lambda it: fw.linear_modes(it),
    "Continuation(y0": lambda it: fw.Continuation(mode(), it, (0.1, 1.0)),
    "static_preload(model": lambda it: fw.static_preload(it, np.zeros(1)),
    "balanced(model": lambda it: fw.balanced(it),
    "wear(branch": lambda it: fw.wear(it, 0.1, 1e-9, {}, 10.0),
    "WornMode(problem": lambda it: fw.WornMode(it, 1e-9, {}),
    "standing_wave(mode": lambda it: fw.standing_wave(it, 1, 4, 0),
    "travelling_wave(mode": lambda it: fw.travelling_wave(it, 1, 4),
    "on_pair_coordinates(structure": lambda it: fw.on_pair_coordinates(it),
    "sweep(work": lambda it: fw.sweep(it, a=[1.0]),
    "open_run(folder": lambda it: fw.open_run(it),
    "Run(folder": lambda it: fw.Run(it),
    "has_results(folder": lambda it: fw.has_results(it),
    "open_results(path": lambda it: fw.open_results(it),
    "read_model(path": lambda it: fw.read_model(it),
    "write_model(structure": lambda it: fw.write_model("model.h5", it),
    "load_case(path": lambda it: fw.load_case(it),
    "Harmonics orders": lambda it: fw.Harmonics(it, 64),
}
MAY_BE_NONE: dict[str, Callable[[Any], object]] = {
    "follow(steps": lambda it: fw.follow(mode(), 0.1, 0.2, steps=it),
    "follow(tell": lambda it: fw.follow(mode(), 0.1, 0.2, tell=it),
    "NonlinearMode(rest": lambda it: fw.NonlinearMode(mode().model, mode().harmonics, rest=it),
    "Model(comm": lambda it: fw.Model([[1.0]], [[4.0]], comm=it),
    "Contact(pairs": lambda it: fw.Contact("jenkins", [[1.0]], pairs=it),
    "reduce(comm": lambda it: fw.reduce(np.eye(2), np.diag([1.0, 2.0]), keep=[0], modes=1, comm=it),
}


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
@pytest.mark.parametrize("name", [*TAKES, *MAY_BE_NONE], ids=lambda name: name.replace("(", " "))
def test_an_argument_of_another_kind_is_refused_where_it_is_given(name: str, other: Any) -> None:
    if name in MAY_BE_NONE and other is None:
        return
    if name.startswith("Harmonics") and other == []:
        return
    with pytest.raises(fw.InputError) as caught:
        {**TAKES, **MAY_BE_NONE}[name](other)
    said = caught.value
    assert said.fix and said.expected and str(said.measured)
    if "(" in name:
        assert said.where == f"{name}=...)" and type(other).__name__ in str(said.measured)


def test_names_of_files_are_of_any_kind_of_path_and_none_may_be_left_out(tmp_path) -> None:
    assert not fw.has_results(tmp_path) and not fw.has_results(str(tmp_path)) and not fw.has_results(folder=tmp_path)
    with pytest.raises(TypeError, match="missing"):
        fw.has_results()  # type: ignore[call-arg]
    assert len(fw.follow(mode(), 0.1, 0.2, steps=fw.StepControl(), tell=print)) > 1
    assert fw.linear_modes(model(), near=2.5)[0].omega == pytest.approx(2.0)
    for near in (0.0, "2", np.inf, {}):
        with pytest.raises(fw.InputError, match="near"):
            fw.linear_modes(model(), near=near)


class Model:
    """Of another package."""


@pytest.mark.parametrize(
    "given",
    [lambda: fw.linear_modes(Model()), lambda: fw.Model([[1]], [[4]], comm=PETSc.COMM_SELF)]
    + [lambda: fw.Model([[1]], [[4]], comm=MPI.COMM_NULL), lambda: fw.linear_modes(model(), 1, stable=7)],
    ids=["a Model of another package", "a communicator of petsc4py", "no communicator", "neither true nor false"],
)
def test_a_name_is_not_enough(given: Callable[[], object]) -> None:
    with pytest.raises(fw.InputError, match="of another kind"):
        given()


def test_what_is_true_may_be_a_number_of_any_kind() -> None:
    for one in (True, np.True_, 1, np.int64(1)):
        assert len(fw.linear_modes(model(), 1, stable=one)) == 1


def test_python_names_the_function_whose_arguments_are_not_its_own() -> None:
    with pytest.raises(TypeError, match=r"follow\(\) got an unexpected keyword argument 'foo'"):
        fw.follow(mode(), 0.1, 0.2, foo=1)


def test_harmonics_are_taken_from_any_collection() -> None:
    """An array without dimensions says that it can be gone through, and cannot."""
    for orders in ([1, 3], (1, 3), {1, 3}, range(1, 4, 2), np.array([1, 3]), (n for n in (1, 3))):
        assert fw.Harmonics(orders, 64).orders == (1, 3)
    with pytest.raises(fw.InputError, match="no list"):
        fw.Harmonics(np.array(3), 64)
