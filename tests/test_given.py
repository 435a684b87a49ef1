"""Numbers that a script gives and no key of a case has looked at: one sentence, and no result made of them."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fretwave as fw
from fretwave import given

NAN, INF = float("nan"), float("inf")
M, K = np.diag([1.0, 0.02]), np.array([[640.0, -40.0], [-40.0, 40.0]])
MODE = fw.LinearMode(1.0, 0.0, np.array([1.0, 0.0]), np.zeros(2))
STILL = np.zeros(2)
SIDE = {"normal_stiffness": 100.0, "tangential_stiffness": 40.0, "friction_coefficient": 0.5, "normal_load": 3.0}


def refused(work: Callable[[], object]) -> str:
    with pytest.raises(fw.InputError) as error:
        work()
    return str(error.value)


@pytest.mark.parametrize("value, found", [(3, 3), (np.int8(3), 3), (np.array(3), 3), (True, 1)], ids=str)
def test_whole_numbers_of_any_kind_are_some(value: Any, found: int) -> None:
    assert given.whole(value) == found and given.place("dof", value, 4) == found


@pytest.mark.parametrize("value", [3.0, "3", None, [3], 1j, NAN], ids=str)
def test_nothing_else_is_a_whole_number(value: Any) -> None:
    assert given.whole(value) is None and "0 to 8" in refused(lambda: given.place("dof", value, 9))


@pytest.mark.parametrize("value", [0.0, -1.0, NAN, INF, "1", None, 1j, [1.0], [1.0, 2.0]], ids=str)
def test_a_positive_number_is_finite_and_one(value: Any) -> None:
    assert "> 0" in refused(lambda: given.positive("x", value))


@pytest.mark.parametrize("value", [-1e-300, NAN, -INF, "1", None, [0.0]], ids=str)
def test_one_that_is_not_negative_may_be_zero(value: Any) -> None:
    assert ">= 0" in refused(lambda: given.not_negative("x", value)) and given.not_negative("x", 0) == 0.0


@pytest.mark.parametrize("ratios", [-0.1, NAN, INF, 0.1j, [0.1, -0.1], {2: NAN}, np.array([0.1, -0.2])], ids=str)
def test_a_damping_ratio_is_not_negative(ratios: Any) -> None:
    """The matrix was made of nan."""
    assert "damping ratio" in refused(lambda: fw.modal_damping(M, K, ratios))


def test_damping_ratios_may_stand_in_an_array() -> None:
    one, other = (fw.modal_damping(M, K, ratios)[0].toarray() for ratios in ([0.01, 0.02], np.array([0.01, 0.02])))
    assert np.array_equal(one, other)


@pytest.mark.parametrize("sectors", [-2, 0, 1, 2.5, NAN], ids=str)
@pytest.mark.parametrize(
    "work",
    [
        lambda n: fw.deviations(n, 0.02),
        lambda n: fw.travelling_wave(MODE, 1, n),
        lambda n: fw.standing_wave(MODE, 1, n, 0),
        lambda n: fw.Aerodynamics.from_damping({0: 0.1}, n, 1.0),
        lambda n: fw.match_faces(np.eye(3), [0], [1], n),
        lambda n: fw.modal_damping(M, K, 0.1, sectors=n or 1),
    ],
)
def test_a_wheel_has_two_sectors_or_more(work: Callable[[Any], object], sectors: Any) -> None:
    """Division by zero, numbers of a wheel of one sector, or nan."""
    assert "two sectors" in refused(lambda: work(sectors))


@pytest.mark.parametrize(
    "work",
    [
        lambda: fw.standing_wave(MODE, 1, 6, 9),  # the crest stood in another sector
        lambda: fw.standing_wave(MODE, 1, 6, 0, 7),
        lambda: fw.standing_wave(MODE, 1, 6, 1),  # a dof that does not move: nan
        lambda: fw.deviations(6, -0.1),
        lambda: fw.deviations(6, NAN),
        lambda: fw.deviations(6, 0.1, -1),
        lambda: fw.Aerodynamics({0: 1j}, INF),
        lambda: fw.Aerodynamics({0: complex(NAN, 0.0)}, 1.0),
        lambda: fw.Aerodynamics.from_damping({0: NAN}, 6, 1.0),  # no coefficient was left
        lambda: fw.match_faces(np.eye(3), [0], [9], 4),
        lambda: fw.match_faces(np.eye(3), [-1], [1], 4),
        lambda: fw.StepControl(max_points=3.5),  # type: ignore[arg-type]
        lambda: fw.StepControl(initial="a"),  # type: ignore[arg-type]
        lambda: fw.WearControl(stepper="euler"),
    ],
)
def test_what_is_not_there_makes_nothing(work: Callable[[], object]) -> None:
    refused(work)


@pytest.mark.parametrize("name", ["t_end", "dt_out", "rtol", "limit", "most_steps"])
@pytest.mark.parametrize("value", [0.0, -1.0, NAN], ids=str)
def test_integration_in_time_has_positive_numbers(name: str, value: float) -> None:
    """With rtol = nan steps had no control."""
    options = {"t_end": 1.0, "dt_out": 0.1, name: value}
    assert re.search(f"{name}|duration", refused(lambda: fw.Transient(fw.Model(M, K)).run(STILL, STILL, **options)))


def test_integration_in_time_has_an_end() -> None:
    assert "t_end" in refused(lambda: fw.Transient(fw.Model(M, K)).run(STILL, STILL, INF, 0.1))


@pytest.fixture(scope="module")
def worn() -> fw.Branch:
    side = fw.Contact("coulomb_2d", np.eye(2), SIDE)
    model = fw.Model(M, K, contacts=[side])
    problem = fw.NonlinearMode(model, fw.choose_harmonics(model, 1), dof=1, rest=fw.balanced(model))
    return fw.follow(problem, 0.01, 0.2)


@pytest.mark.parametrize(
    "changed",
    [
        *({name: value} for name in ("cycles", "cycle_unit") for value in (0.0, -1.0, NAN)),
        *({"coefficient": value} for value in (-1.0, NAN)),
        *({"areas": areas} for areas in ({}, *({"contact": a} for a in ([0.0], [-1.0], [1.0, 1.0], 1.0, [NAN])))),
        *({"areas": areas} for areas in (None, "contact", 1.0)),
        *({"report_at": reports} for reports in (0.5, None, "soon")),
        {"amplitude": NAN},
    ],
    ids=str,
)
def test_wear_has_positive_numbers(changed: dict[str, Any], worn: fw.Branch) -> None:
    """Negative ones ended "wear has stopped", as asked; two areas made two pairs of one, areas of zero no end."""
    options = {"amplitude": 0.1, "coefficient": 1e-3, "areas": {"contact": [1.0]}, "cycles": 1.0, **changed}
    assert next(iter(changed)) in refused(lambda: fw.wear(worn, **options))


def test_a_march_is_printed_over_its_cycles(worn: fw.Branch) -> None:
    march = fw.wear(worn, 0.1, 1e-3, {"contact": [1.0]}, 1.0)
    head, *_, last = march.text().splitlines()
    place = head.split().index("cycles")
    assert float(last.split()[place]) == pytest.approx(march["cycles"][-1], rel=1e-5)


def test_wear_is_that_of_a_mode(worn: fw.Branch) -> None:
    """Of a forced response it found the frequency's motion and looked for a mode's columns in it."""
    problem = worn.problem
    assert isinstance(problem, fw.NonlinearMode)
    force, rest = {1: np.array([0.0, 0.1])}, fw.balanced(problem.model)
    forced = fw.ForcedResponse(problem.model, problem.harmonics, force, 1.0, 1, problem.start, rest=rest)
    response = fw.follow(forced, 0.5, 0.6)
    assert "not that of a mode" in refused(lambda: fw.wear(response, 0.1, 1e-3, {"contact": [1.0]}, 1.0))
    assert "another kind" in refused(lambda: fw.WornMode(forced, 1e-3, {"contact": [1.0]}))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "stop", [-1.0, NAN, (0.2, NAN), (-0.1, 0.2), (0.1, 0.2, 0.3), (0.1, 0.2), (0.001, 0.005)], ids=str
)
def test_a_branch_ends_where_it_can_get_to(stop: Any, worn: fw.Branch) -> None:
    """From outside its range it went round and was told to be a closed loop; below zero Newton met nan."""
    refused(lambda: fw.follow(worn.problem, 0.01, stop))


def test_a_branch_is_one_of_a_problem(worn: fw.Branch) -> None:
    assert "Branch" in refused(lambda: fw.follow(worn, 0.1, 0.2))  # type: ignore[arg-type]
    assert "LinearMode" in refused(lambda: fw.follow(MODE, 0.1, 0.2))  # type: ignore[arg-type]


#: Numbers that are not whole, where a place is meant: each was rounded down, or gave numbers of no wave.
NOT_WHOLE: dict[str, Callable[[], object]] = {
    "travelling": lambda: fw.travelling_wave(MODE, 1.5, 6),  # type: ignore[arg-type]
    "standing": lambda: fw.standing_wave(MODE, 1.5, 6, 0),  # type: ignore[arg-type]
    "wave of the flow": lambda: fw.Aerodynamics({0: 1.0}, 1.0).wave(0.5, 6),  # type: ignore[arg-type]
    "ratios of the flow": lambda: fw.Aerodynamics.from_damping({0.5: 0.1}, 6, 1.0),  # type: ignore[dict-item]
    "blade": lambda: fw.Aerodynamics({0.5: 1.0}, 1.0),  # type: ignore[dict-item]
    "face": lambda: fw.match_faces(np.eye(3), [0.7], [1.2], 4),
    "mask": lambda: fw.match_faces(np.eye(3), [True, False, False], [False, True, False], 4),
    "interface": lambda: fw.reduce_sector(np.eye(3), np.eye(3), [0], [2], 6, interface_diameters=[0.5]),  # type: ignore[list-item]
    "ratio of a mode": lambda: fw.modal_damping(M, K, {1.5: 0.1}),  # type: ignore[dict-item]
}


@pytest.mark.parametrize("name", NOT_WHOLE)
def test_places_and_waves_are_whole_numbers(name: str) -> None:
    assert re.search("whole number|mode that is not there|integers", refused(NOT_WHOLE[name]))


@pytest.mark.parametrize("dof", [0.5, -1, 2, "0", None], ids=repr)
def test_dampers_flow_and_names_are_of_dofs_that_there_are(dof: Any) -> None:
    """A half was rounded down, -1 SciPy's own error, of a shape the last dof."""
    assert "0 to 1" in refused(lambda: fw.Structure(M, K).damped([(dof, 1.0)]))
    assert "0 to 1" in refused(lambda: fw.WheelShape(np.eye(12), 6, dof, 1.0))
    assert "dof 'a'" in str(fw.Structure(M, K, dofs={"a": dof}).complaint())
    if dof is not None:
        assert "0 .. 1" in refused(lambda: fw.Aerodynamics({0: 1.0}, 1.0, dof).terms(M))


@pytest.mark.parametrize("constant", [NAN, "1", None, 1j], ids=repr)
def test_a_damper_has_a_number(constant: Any) -> None:
    assert "damper constant" in refused(lambda: fw.Structure(M, K).damped([(0, constant)]))


@pytest.mark.parametrize("omega", [0.0, NAN, INF, "1", None, 1j], ids=repr)
def test_a_flow_has_a_frequency(omega: Any) -> None:
    assert "frequency" in refused(lambda: fw.Aerodynamics({0: 1.0}, omega))


@pytest.mark.parametrize("ratios", [{1: 0.1, 7: 0.2}, {3: 0.1, -3: 0.2}, {-1: 0.1, 5: 0.3}], ids=str)
def test_a_wave_of_the_flow_has_one_ratio(ratios: dict[int, float]) -> None:
    """The last one was taken."""
    assert "one wave has two" in refused(lambda: fw.Aerodynamics.from_damping(ratios, 6, 1.0))


@pytest.mark.parametrize(
    "work",
    [
        lambda hidden: fw.Model(M, K, None, [fw.Contact("jenkins", [[0.0, 1.0]], hidden)]),
        lambda hidden: fw.static_preload(fw.Model(M, K), np.ma.masked_array([1.0, 2.0], [True, False])),
        lambda hidden: given.positive("x", hidden["tangential_stiffness"][0]),
        lambda hidden: given.numbers("x", hidden["tangential_stiffness"], (1,)),
        lambda _: fw.modal_damping(M, K, np.ma.masked_array([0.1, 0.2], [True, False])),
        lambda _: fw.modal_damping(M, K, {1: np.ma.masked}),
        lambda _: fw.match_faces(np.ma.masked_array(np.eye(3), np.eye(3) > 0), [0], [1], 4),
        lambda _: fw.match_faces(np.eye(3), np.ma.masked_array([0], [True]), [1], 4),
    ],
)
def test_what_is_masked_is_no_number(work: Callable[[Any], object]) -> None:
    """What stood behind the mask was taken."""
    refused(lambda: work({"tangential_stiffness": np.ma.masked_array([40.0], [True]), "friction_limit": 1.0}))


@pytest.mark.parametrize("components", [0, -1, 1.0, "1", None], ids=repr)
def test_pairs_have_a_number_of_components(components: Any) -> None:
    assert "components" in refused(lambda: fw.Pairs([[0.0, 1.0]], components))


@pytest.mark.parametrize(
    "wrong, word",
    [
        ({"dofs": ["a", "b"]}, "dofs are a list"),
        ({"pairs": [fw.Pairs([[0.0, 1.0]], 1)]}, "pairs are a list"),
        ({"pairs": {"p": [[0.0, 1.0]]}}, "no fretwave.Pairs"),
        ({"loads": [1.0, 2.0]}, "loads are a list"),
        ({"loads": {"g": ["1", "2"]}}, "not a number"),
        ({"loads": {"g": [1j, 2.0]}}, "not a number"),
        ({"parts": [K]}, "parts are a list"),
        ({"loads": {"g": np.ma.masked_array([0.0, 0.1], [True, False])}}, "load 'g' has masked entries"),
        ({"coordinates": np.ma.masked_array(np.eye(3)[:2], np.eye(3)[:2] > 0)}, "coordinates have masked entries"),
        ({"pairs": {"p": fw.Pairs([[0.0, 1.0]], 1, areas=np.ma.masked_array([1.0], [True]))}}, "areas of contact 'p'"),
        ({"pairs": {"p": fw.Pairs([[0.0, 1.0]], 1, {"a": np.ma.masked_array([1.0], [True])})}}, "a of contact 'p'"),
        ({"dofs": {"tip": 1.0}}, "1.0, which is not whole"),
    ],
)
def test_a_builder_gives_dicts_of_numbers(wrong: Any, word: str) -> None:
    """Each was told as a defect of fretwave, or lost its imaginary part."""
    assert word in str(fw.Structure(M, K, **wrong).complaint())


@pytest.mark.parametrize("names", [("contact", "contact"), ("a", "a"), ("a", None), (3, "a"), ([1], "a")], ids=str)
def test_contacts_have_names_of_their_own(names: Any) -> None:
    """Sliders at rest go by name: those of one contact were taken for the other's, and the motion was about them."""
    both = [fw.Contact("jenkins", [[0.0, 1.0]], {"tangential_stiffness": 4.0, "friction_limit": 1.0}, n) for n in names]
    assert "one name" in refused(lambda: fw.Model(M, K, None, both))


@pytest.mark.parametrize("kind", [float, np.float32, object, np.uint8, str], ids=lambda kind: kind.__name__)
def test_nodes_of_faces_are_whole_numbers_of_any_type(kind: Any) -> None:
    """Floats are what NumPy's `loadtxt` makes of a file."""
    xyz = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 1.0, 0.0]])
    low, high = np.array([0, 1]).astype(kind), np.array([2, 3]).astype(kind)
    if kind is str:
        assert "not whole numbers" in refused(lambda: fw.match_faces(xyz, low, high, 4))
    else:
        assert [nodes.tolist() for nodes in fw.match_faces(xyz, low, high, 4)] == [[0, 1], [3, 2]]


def test_a_number_in_an_array_of_no_dimension_is_one(worn: fw.Branch) -> None:
    """It was told to be no number above 0."""
    flow = fw.Aerodynamics.from_damping({0: 0.1}, 4, np.array(2.0))  # type: ignore[arg-type]
    assert flow == fw.Aerodynamics.from_damping({0: 0.1}, 4, 2.0) and type(flow.omega) is float
    model = worn.problem.model
    mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 1), dof=1, rest=fw.balanced(model))
    assert len(fw.follow(mode, 0.01, 0.02, accuracy=np.array(0.1))) > 0  # type: ignore[arg-type]


@pytest.mark.parametrize("words", [{"stop": "4"}, {"stop": ("0.1", "4")}, {"stop": 0.2, "report_at": ["0.2"]}], ids=str)
def test_texts_are_no_numbers_of_a_branch(words: Any, worn: fw.Branch) -> None:
    """A start was refused, these were taken."""
    refused(lambda: fw.follow(worn.problem, 0.01, **words))
    refused(lambda: fw.follow(worn.problem, 0.01, 0.2, accuracy="0.1"))  # type: ignore[arg-type]


def test_one_ratio_may_be_named_twice() -> None:
    """-3 and 3 of six sectors are one wave."""
    one, other = (fw.Aerodynamics.from_damping({d: 0.01 for d in range(low, 4)}, 6, 2.0).influence for low in (-3, -2))
    assert one == other


def test_what_an_array_of_each_dof_lacks_is_told() -> None:
    values = np.ma.masked_array([1.0, 2.0], [True, False])
    assert "masked entries" in refused(lambda: fw.Model(M, K).numbers(values))
    assert "finite real numbers" in refused(lambda: fw.Model(M, K).numbers([[1.0], [2.0, 3.0]]))  # type: ignore[list-item]


def test_four_components_are_a_number_of_them() -> None:
    assert fw.Pairs(np.eye(4), 4).n_pairs == 1
    assert "a whole number >= 1" in refused(lambda: fw.Pairs(np.eye(4), 0))
