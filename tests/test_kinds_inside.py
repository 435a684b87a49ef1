"""Numbers, lists and matrices of another kind, as scripts give them: one sentence, no error from inside of Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fretwave as fw
from fretwave.post.limit_cycles import others

pytestmark = pytest.mark.ranks(1)

ODD: dict[str, Any] = {
    **{
        "None": None,
        "a dict": {},
        "an object": object(),
        "a text": "x",
        "an endless number": np.inf,
        "no number": np.nan,
    },
    **{
        "a set": {1.0},
        "a list of an object": [object()],
        "a list of None": [None],
        "rows of two lengths": [[1], [1, 2]],
    },
    **{"a long number": 10**400, "a complex number": 1j, "a matrix of another size": np.ones((3, 2)), "a list": []},
}
EYE, K = np.eye(2), np.array([[4.0, -1.0], [-1.0, 4.0]])
SLIDER = {"tangential_stiffness": 5.0, "friction_limit": 1.0}


def model() -> fw.Model:
    return fw.Model([[1.0]], [[4.0]], contacts=[fw.Contact("jenkins", [[1.0]], SLIDER)])


def free() -> fw.Model:
    return fw.Model([[1.0]], [[4.0]])


def mode() -> fw.NonlinearMode:
    return fw.NonlinearMode(model(), fw.choose_harmonics(model(), 1))


@pytest.fixture(scope="module")
def branch() -> fw.Branch:
    return fw.follow(mode(), 0.1, 0.5)


#: What takes one, and which of `ODD` are right there.
TAKES: dict[str, tuple[Callable[[Any, Any], object], set[str]]] = {
    "stop": (lambda it, _: fw.Continuation(mode(), mode().initial(0.1), it), set()),
    "report_at": (
        lambda it, _: fw.Continuation(mode(), mode().initial(0.1), (0.1, 1.0), report_at=it),
        {"a set", "a list"},
    ),
    "unit": (lambda it, _: fw.Model(EYE, K, unit=it), set()),
    "mass": (lambda it, _: fw.Model(it, K), {"None"}),
    "omega": (lambda it, _: fw.Transient(free(), {1: [1.0]}, omega=it), set()),
    "level": (lambda it, _: fw.Transient(free(), {1: [1.0]}, it, 1.0), set()),
    "force": (lambda it, _: fw.Transient(free(), it, omega=1.0), {"None", "a dict"}),
    "force of an order": (lambda it, _: fw.Transient(free(), {1: it}, omega=1.0), set()),
    "prefix": (lambda it, _: fw.Transient(free(), prefix=it), {"a text"}),
    "closed": (lambda it, _: fw.static_preload(model(), [0.0], closed=it), {"None"}),
    "sliders": (lambda it, _: fw.static_preload(model(), [0.0], sliders=it), {"None"}),
    "sliders of a contact": (lambda it, _: fw.static_preload(model(), [0.0], sliders={"contact": it}), set()),
    "amplitude": (lambda it, one: fw.wear(one, it, 1e-9, {}, 10.0), set()),
    "areas": (lambda it, one: fw.wear(one, 0.1, 1e-9, it, 10.0), set()),
    "M of modal damping": (lambda it, _: fw.modal_damping(it, K, 0.01), set()),
    "K of modal damping": (lambda it, _: fw.modal_damping(EYE, it, 0.01), set()),
    "contacts": (lambda it, _: fw.modal_damping(EYE, K, 0.01, it), {"a dict", "a list"}),
    "sectors": (lambda it, _: fw.modal_damping(EYE, K, 0.01, (), it), set()),
    "M of a sector": (lambda it, _: fw.Sector(it, K, 4), {"None"}),
    "K of a sector": (lambda it, _: fw.Sector(EYE, it, 4), {"None"}),
    "wave": (lambda it, _: fw.Sector(EYE, K, 4).model(it), set()),
    "row that is observed": (lambda it, _: fw.NonlinearMode(model(), fw.Harmonics([1], 64), dof=it), set()),
    "unknowns": (lambda it, _: mode().coefficients(it), set()),
}


@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("name", TAKES)
def test_what_is_of_another_kind_is_refused_in_a_sentence(name: str, odd: str, branch: fw.Branch) -> None:
    work, right = TAKES[name]
    if odd not in right:
        with pytest.raises(fw.InputError) as caught:
            work(ODD[odd], branch)
        assert caught.value.what and caught.value.expected


def test_what_is_right_is_taken_as_before() -> None:
    """Numbers to go through once or in any order, and NumPy's own."""
    for stop, report in (([0.1, 0.5], {0.2, 0.3}), (np.array([0.1, 0.5]), (x for x in (0.2, 0.3)))):
        branch = fw.Continuation(mode(), mode().initial(0.1), stop, report_at=report)
        assert sum("report" in point.event for point in branch) == 2
    assert fw.Model(EYE, K, unit=np.int64(2)).n_dof == 2
    assert fw.Transient(free(), {np.int64(1): [1.0]}, np.float64(2.0), omega=3)
    assert fw.modal_damping(EYE, K, 0.01)[0].shape == (2, 2)


def test_points_of_results_are_a_list(tmp_path) -> None:
    from command_line import call

    case = '[model]\ndofs = ["a"]\nM = [[1.0]]\nK = [[4.0]]\nC = [[0.1]]\n[[analysis]]\nname = "mode"\ntype = "mode"\n'
    case += 'harmonics = 1\nsamples = 8\nnormalise = "a"\namplitude = [0.1, 1.0]\n'
    (tmp_path / "case.toml").write_text(case)
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    found = fw.open_run(tmp_path / "run")["mode"]
    for points in (0, "0", [0.5], [10**6], [None], []):
        with pytest.raises(fw.InputError, match="no points of the analysis"):
            found.coefficients(points)
    np.testing.assert_array_equal(found.coefficients((0, np.int64(-1))), found.coefficients()[[0, -1]])


def test_modes_beside_a_limit_cycle_are_joined_by_one_but() -> None:
    fed = [{"mode": 2, "contact": "stuck contact", "frequency_hz": 5.0, "zeta": -0.01}]
    fed.append({"mode": 2, "contact": "free contact", "frequency_hz": 4.0, "zeta": -0.03})
    said = others(fed)
    assert said.count("but ") + said.count("though ") == 1 and "5 Hz" in said and ", and linear mode 2, 4 Hz" in said
    assert others([]) == ""
