"""What a script gives that does not fit, or uses after its end: one sentence; no other numbers, and no crash."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tolerances import SOLVED

import fretwave as fw

pytestmark = pytest.mark.ranks(1, 2)

M = np.diag([1.0, 0.02])
K = np.array([[640.0, -40.0], [-40.0, 40.0]])
FEW = fw.StepControl(max_points=4)


def model_of() -> fw.Model:
    slider = fw.Contact("jenkins", [[0.0, 1.0]], {"tangential_stiffness": 40.0, "friction_limit": 1.0})
    return fw.Model(M, K, contacts=[slider])


@pytest.fixture
def mode() -> fw.NonlinearMode:
    model = model_of()
    return fw.NonlinearMode(model, fw.choose_harmonics(model, 3))


@pytest.fixture
def other() -> fw.LinearMode:
    """Of a model of three dofs."""
    return fw.linear_modes(fw.Model(np.eye(3), np.diag([1.0, 2.0, 3.0])), 1)[0]


@pytest.mark.parametrize("force", [[1.0], [[1.0, 0.0]], [1.0, 0.0, 0.0], 1.0, [np.nan, 0.0], [1.0, np.inf]], ids=str)
def test_a_force_has_a_number_for_every_dof(force: Any, mode: fw.NonlinearMode) -> None:
    """[1.0] stood for 1 N on every dof."""
    with pytest.raises(fw.InputError, match=r"force does not fit the model[\s\S]*order 1[\s\S]*\(2,\), finite"):
        fw.ForcedResponse(mode.model, mode.harmonics, {1: force}, 1.0, 0, mode.start)


@pytest.mark.parametrize("force", [[1.0, 0.0], {1.0: [1.0, 0.0]}, {"1": [1.0, 0.0]}, None], ids=str)
def test_a_force_has_whole_orders(force: Any, mode: fw.NonlinearMode) -> None:
    """Python's own errors came out."""
    with pytest.raises(fw.InputError, match=r"no harmonics[\s\S]*whole orders"):
        fw.ForcedResponse(mode.model, mode.harmonics, force, 1.0, 0, mode.start)


@pytest.mark.parametrize("level", [np.nan, np.inf, -np.inf, None, "1", [1.0, 2.0]], ids=str)
def test_a_level_is_a_finite_number(level: Any, mode: fw.NonlinearMode) -> None:
    """The excitation was said to be zero."""
    with pytest.raises(fw.InputError, match=r"cannot be used[\s\S]*level[\s\S]*a finite number"):
        fw.ForcedResponse(mode.model, mode.harmonics, {1: [1.0, 0.0]}, level, 0, mode.start)


@pytest.mark.parametrize("size", [1e155, 1e200, 1e308])
def test_what_has_no_square_is_refused(size: float, mode: fw.NonlinearMode) -> None:
    """Responses and states at rest were nan, modes stuck, and all of them converged."""
    force = {1: [1.0, 0.0]}
    with pytest.raises(fw.InputError, match=r"excitation is too large[\s\S]*whose square is a number"):
        fw.ForcedResponse(mode.model, mode.harmonics, force, size, 0, mode.start)
    with pytest.raises(fw.InputError, match=r"excitation is too small[\s\S]*whose square is a number"):
        fw.ForcedResponse(mode.model, mode.harmonics, force, 1 / size, 0, mode.start)
    with pytest.raises(fw.InputError, match=r"too large[\s\S]*whose square is a number"):
        fw.static_preload(mode.model, [size, 0.0])
    with pytest.raises(fw.InputError, match=r"end of the branch is too large[\s\S]*whose square is a number"):
        fw.follow(mode, 0.1 * size, size)


def test_what_has_a_square_is_scaled_alone(mode: fw.NonlinearMode) -> None:
    """Nothing slips at 1e-100 N, all slips at 1e100 N."""
    for level, law in ((1e-100, "stuck"), (1e100, "free")):
        linear = fw.linear_modes(mode.model, 1, contact=law)[0]
        response = fw.ForcedResponse(mode.model, mode.harmonics, {1: [1.0, 0.0]}, level, 0, mode.start)
        found = fw.follow(response, 0.5 * linear.omega, 0.6 * linear.omega)[0]
        Kc = K + np.diag([0.0, 40.0 * (law == "stuck")])
        expected = np.linalg.solve(Kc - found["omega"] ** 2 * M, [level, 0.0])[0]
        assert found["amplitude"] == pytest.approx(expected, rel=SOLVED)


def test_an_order_may_be_any_whole_number(mode: fw.NonlinearMode) -> None:
    """Of True, which is 1, Python's own error came out."""
    for order in (1, np.int64(1), True):
        response = fw.ForcedResponse(mode.model, mode.harmonics, {order: [1.0, 0.0]}, 1.0, 0, mode.start)
        assert response.amplitude_scale(mode.initial(0.1)) > 0


@pytest.mark.parametrize("load", [[0.0, np.nan], [np.inf, 0.0], [0.0, 1.0 + 1.0j], [1.0], 1.0, None], ids=str)
def test_a_static_load_is_a_real_number_for_every_dof(load: Any) -> None:
    """Of a complex one the real part acted; one that is no number was said to want a stop."""
    with pytest.raises(fw.InputError, match=r"does not fit the model[\s\S]*\(2,\) finite real numbers"):
        fw.static_preload(model_of(), load)


@pytest.mark.parametrize("kind", [complex, object])
def test_a_row_without_imaginary_part_is_real(kind: type, mode: fw.NonlinearMode) -> None:
    row = np.array([0.0, 2.0], dtype=kind)
    assert fw.NonlinearMode(mode.model, mode.harmonics, dof=row).row == [(1, 2.0)]


@pytest.mark.parametrize(
    "dof", [2, -1, 7, 1.0, "tip", None, [1j, 0.0], pytest.param(np.array([1j, 0.0]), id="complex row")]
)
def test_what_is_observed_is_of_the_model(dof: Any, mode: fw.NonlinearMode) -> None:
    """A column of a dof that is not there was zero."""
    said = "does not exist|is real"
    if not isinstance(dof, str):
        with pytest.raises(fw.InputError, match=said):
            fw.follow(mode, 0.01, 0.1, observe={"x": dof}, steps=FEW)
    with pytest.raises(fw.InputError, match=said):
        fw.NonlinearMode(mode.model, mode.harmonics, dof=dof)


def test_a_mode_of_another_model_begins_nothing(mode: fw.NonlinearMode, other: fw.LinearMode) -> None:
    for given, said in ((other, "3 dofs"), (3, "int")):
        with pytest.raises(fw.InputError, match=said):
            fw.NonlinearMode(mode.model, mode.harmonics, start=given)  # type: ignore[arg-type]
        with pytest.raises(fw.InputError, match=said):
            fw.ForcedResponse(mode.model, mode.harmonics, {1: [1.0, 0.0]}, 1.0, 0, given)  # type: ignore[arg-type]


@pytest.mark.parametrize("accuracy", [0, 0.0, -1e-3, 1.0, 2.0, float("nan")])
def test_accuracy_is_a_share(accuracy: float, mode: fw.NonlinearMode) -> None:
    with pytest.raises(fw.InputError, match="accuracy is a share"):
        fw.follow(mode, 0.01, 0.1, accuracy=accuracy)


@pytest.mark.parametrize("kind", [np.int64, np.int32, np.uint8, np.array])
def test_numbers_of_numpy_are_numbers(kind: Any, mode: fw.NonlinearMode) -> None:
    chosen = fw.choose_harmonics(mode.model, kind(3), samples=kind(64))
    assert (chosen.orders, chosen.samples) == ((1, 3), 64) and repr(chosen) == "Harmonics(1, 3; 64 samples)"
    assert len(fw.linear_modes(mode.model, np.int64(1))) == 1


@pytest.mark.parametrize("highest", [1.5, "3", None, [1, 3], 10**10, 0], ids=str)
def test_the_highest_harmonic_is_one_number(highest: Any, mode: fw.NonlinearMode) -> None:
    """10^10 filled the memory."""
    with pytest.raises(fw.InputError, match="harmonic"):
        fw.choose_harmonics(mode.model, highest)


@pytest.mark.parametrize("samples", [10**20, 2**31, 2.5, "64", 7], ids=str)
def test_the_number_of_samples_is_one(samples: Any, mode: fw.NonlinearMode) -> None:
    with pytest.raises(fw.InputError, match="samples"):
        fw.choose_harmonics(mode.model, 3, samples=samples)


class Lossy(fw.PythonLaw):
    """A loss factor in a force of the displacement."""

    stuck_stiffness = 1.0

    def force(self, u: Any, v: Any) -> Any:
        return (1 + 0.1j) * u


class Transformed(Lossy):
    """A force by way of a transform, which leaves an imaginary part of rounding."""

    def force(self, u: Any, v: Any) -> Any:
        return np.fft.ifft(np.fft.fft(u, axis=0), axis=0)


def test_rounding_makes_no_force_complex() -> None:
    model = fw.Model(M, K, contacts=[fw.Contact(Transformed(), [[0.0, 1.0]])])
    branch = fw.follow(fw.NonlinearMode(model, fw.choose_harmonics(model, 1)), 0.01, 0.1, steps=FEW)
    stiffer = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K + np.diag([0.0, 1.0]))).real.min())
    assert np.allclose(branch["omega"], stiffer, rtol=1e-9)


@pytest.mark.ranks(1)
def test_a_complex_force_of_a_law_is_refused() -> None:
    """Its real part alone acted, without damping."""
    model = fw.Model(M, K, contacts=[fw.Contact(Lossy(), [[0.0, 1.0]])])
    with pytest.raises(fw.InputError, match="returned complex values"):
        fw.follow(fw.NonlinearMode(model, fw.choose_harmonics(model, 1)), 0.01, 0.1, steps=FEW)


@pytest.mark.parametrize("count", [0, -1, 1.5, None, "2"], ids=str)
def test_the_number_of_modes_is_one(count: Any, mode: fw.NonlinearMode) -> None:
    with pytest.raises(fw.InputError, match="by their number"):
        fw.linear_modes(mode.model, count)


def test_a_branch_has_no_places_beyond_its_ends(mode: fw.NonlinearMode) -> None:
    """They were those of its ends."""
    branch = fw.follow(mode, 0.01, 0.1, steps=FEW)
    last = len(branch) - 1
    branch.unknowns(last).destroy()
    for place in (-1, last + 0.5, last + 1, float("nan")):
        with pytest.raises(fw.InputError, match="no such place"):
            branch.unknowns(place)


def test_what_was_destroyed_says_so(mode: fw.NonlinearMode) -> None:
    """PETSc ended the process."""
    model, branch = mode.model, fw.follow(mode, 0.01, 0.1, steps=FEW)
    y = branch.unknowns(0)
    model.destroy()
    model.destroy()
    for asked in (
        lambda: fw.linear_modes(model, 1),
        lambda: fw.follow(mode, 0.01, 0.1),
        lambda: fw.choose_harmonics(model, 3),
        lambda: fw.NonlinearMode(model, mode.harmonics, start=mode.start),
        lambda: fw.static_preload(model, np.zeros(2)),
        lambda: fw.Transient(model),
        lambda: model.inertia(np.ones(2)),
        lambda: model.entries,
    ):
        with pytest.raises(fw.InputError, match="the model has been destroyed"):
            asked()
    mode.destroy()
    mode.destroy()
    for ask in (lambda: mode.residual(y), lambda: mode.jacobian(y), lambda: branch.coefficients(0)):
        with pytest.raises(fw.InputError, match="problem has been destroyed"):
            ask()
    assert "NonlinearMode" in repr(mode) and "2 dofs" in repr(model) and len(branch["zeta"]) == len(branch)
    y.destroy()


def test_a_destroyed_reduction_says_so() -> None:
    """`error` ended the process, others in words about None."""
    reduction = fw.reduce(M, K, keep=[0], modes=1)
    reduction.destroy()
    for use in (
        lambda: reduction.error(1),
        lambda: reduction.expand(np.ones(2)),
        lambda: reduction.project(np.ones(2)),
    ):
        with pytest.raises(fw.InputError, match="the reduction has been destroyed"):
            use()


def test_reports_outside_the_range_are_told(mode: fw.NonlinearMode) -> None:
    """They were left out without a word; those on the ends, and within, are met."""
    branch = fw.follow(mode, 0.01, (0.01, 0.1), report_at=[0.001, 0.01, 0.05, 0.1, 3.0])
    assert [text.split(":")[0] for text in branch.missed] == ["report at 0.001", "report at 3"]
    assert "outside the range, 0.01 to 0.1" in branch.missed[0]
    assert branch["amplitude"][branch.met("report")] == pytest.approx([0.05, 0.1], rel=1e-9)


@pytest.mark.parametrize("given", [[np.nan], ["tip"], 0.05, [[0.05]], [np.inf]], ids=str)
def test_reports_are_a_list_of_numbers(given: Any, mode: fw.NonlinearMode) -> None:
    with pytest.raises(fw.InputError, match="report_at"):
        fw.follow(mode, 0.01, 0.1, report_at=given)


SECTOR = fw.Sector(np.eye(2), np.diag([2.0, 1.0]), 6)
TIED = fw.Sector.from_faces(np.eye(3), np.diag([1.0, 2.0, 1.0]), [0], [2], 6)


@pytest.mark.parametrize("sector", [SECTOR, TIED], ids=["alone", "tied"])
@pytest.mark.parametrize(
    "q", [1.0, [1.0], [1.0, 2.0, 3.0], [[1.0, 2.0]], np.eye(2).tolist(), "ab", [np.nan, 1.0], None], ids=str
)
def test_a_wave_is_given_by_the_dofs_of_a_sector(q: Any, sector: fw.Sector) -> None:
    """Three numbers went round the wheel as a sector of three dofs."""
    for found in (sector.wave, sector.expand):
        with pytest.raises(fw.InputError, match=r"do not fit the sector[\s\S]*\(2,\), finite"):
            found(q, 1)


def test_a_wave_has_a_whole_number_of_diameters_and_an_own_mode(other: fw.LinearMode) -> None:
    for found in (SECTOR.wave, SECTOR.expand):
        assert np.shape(found([1.0, 2j], 1, order=3)) in ((6, 2), (2,))
        for diameters, order in ((1.5, 1), ("1", 1), (1, 0.5)):
            with pytest.raises(fw.InputError, match="whole number"):
                found([1.0, 2.0], diameters, order)  # type: ignore[arg-type]
    with pytest.raises(fw.InputError, match="do not fit the sector"):
        SECTOR.around(other, 1)


CHANGES: dict[str, Any] = {
    "a number": lambda slider: slider.parameters.update(friction_limit=3.0),
    "an array": lambda slider: slider.parameters["tangential_stiffness"].fill(80.0),
    "one more": lambda slider: slider.parameters.update(gap=0.0),
    "one less": lambda slider: slider.parameters.pop("friction_limit"),
    "B": lambda slider: slider.B.fill(2.0),
    "the law": lambda slider: setattr(slider, "law", "regularised_coulomb"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_model_does_not_answer_for_contacts_that_have_changed(change: str) -> None:
    """The branch of the old ones came out, in a loop over friction the same one every time."""
    values = {"tangential_stiffness": np.array([40.0]), "friction_limit": 1.0}
    slider = fw.Contact("jenkins", np.array([[0.0, 1.0]]), values)
    model = fw.Model(M, K, contacts=[slider])
    mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 3))
    assert fw.follow(mode, 0.01, 0.1, steps=FEW)
    CHANGES[change](slider)
    for asked in (
        lambda: fw.linear_modes(model, 1),
        lambda: fw.NonlinearMode(model, mode.harmonics, start=mode.start),
        lambda: fw.follow(mode, 0.01, 0.1, steps=FEW),
        lambda: fw.balanced(model, mode.start),
    ):
        with pytest.raises(fw.InputError, match=r"contact has changed[\s\S]*contact 'contact'[\s\S]*the model took"):
            asked()


def test_contacts_of_a_model_are_not_exchanged() -> None:
    """One that was appended to its list had no force."""
    model = model_of()
    with pytest.raises(AttributeError):
        model.contacts = []  # type: ignore[misc]
    with pytest.raises(AttributeError):
        model.contacts.append(model.contacts[0])  # type: ignore[attr-defined]


@pytest.mark.parametrize("tolerance", [1.0, 10.0])
def test_a_relative_tolerance_is_below_one(comm, tolerance):
    """At 10 an undamped oscillator reached 150,000 times its start, and the run its end."""
    with fw.Model([[1.0]], [[4.0]], comm=comm) as model, pytest.raises(fw.InputError, match="allows anything"):
        fw.Transient(model).run([1.0], [0.0], 10.0, 0.1, rtol=tolerance)
    with pytest.raises(fw.InputError, match="allows anything"):
        fw.WearControl(tolerance=tolerance)
