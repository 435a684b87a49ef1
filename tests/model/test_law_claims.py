"""A law in Python is held to what it says of itself: the core would compute another one without a word."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import fretwave as fw
from fretwave.model.law_claims import check_motion, check_tangents

pytestmark = pytest.mark.ranks(1)


class Cubic(fw.PythonLaw):
    """Two components; of five pairs three on the first of two ranks."""

    odd, stuck_stiffness, components, normal = True, 0.0, 2, None

    def force(self, u: Any, v: Any) -> Any:
        return 0.5 * u**3

    def tangent(self, u: Any, v: Any) -> Any:
        slope = np.zeros((len(u), 2, 2, u.shape[2]))
        slope[:, 0, 0], slope[:, 1, 1] = (1.5 * u[:, k] ** 2 for k in range(2))
        return slope, 0.0 * slope


class NotOdd(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        return 0.5 * u**3 + 0.6 * u**2


class Turned(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        return super().force(u, v).transpose(0, 2, 1)


class TurnedTangent(Cubic):
    def tangent(self, u: Any, v: Any) -> Any:
        return [one.transpose(3, 1, 2, 0) for one in super().tangent(u, v)]


class OneTangent(Cubic):
    def tangent(self, u: Any, v: Any) -> Any:
        return super().tangent(u, v)[0]


class Masked(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        return np.ma.masked_where(u > 0.05, super().force(u, v))


class Words(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        return np.full(u.shape, "a")


class Counting(Cubic):
    calls = 0

    def force(self, u: Any, v: Any) -> Any:
        self.calls += 1
        return 0.5 * u**3 * (1 + 1e-3 * self.calls)


class Slider(Cubic):
    """A memory, along the samples of two periods."""

    def force(self, u: Any, v: Any) -> Any:
        f, at = np.empty_like(u), np.zeros_like(u[0])
        for k in [*range(len(u)), *range(len(u))]:
            f[k] = np.clip(0.5 * (u[k] - at), -0.02, 0.02)
            at = u[k] - f[k] / 0.5
        return f


class SliderAsItBegins(Cubic):
    """The same through one period: the first sample, the farthest, has the same force by itself."""

    def force(self, u: Any, v: Any) -> Any:
        f, at = np.empty_like(u), np.zeros_like(u[0])
        for k in range(len(u)):
            f[k] = np.clip(0.5 * (u[k] - at), -0.02, 0.02)
            at = u[k] - f[k] / 0.5
        return f


class Masing(Cubic):
    """A slider in closed form, whose loop is that of the largest displacement."""

    def force(self, u: Any, v: Any) -> Any:
        end = np.abs(u).max(axis=0)
        loop = 0.5 * (u + np.where(v > 0, end, -end)) - np.where(v > 0, 0.02, -0.02)
        return np.where(end < 0.04, 0.5 * u, np.clip(loop, -0.02, 0.02))


class Forgetful(Cubic):
    """Without `return`: where a force is one number, None was one that is not a number."""

    def force(self, u: Any, v: Any) -> Any:
        super().force(u, v)


class Steeper(Cubic):
    """A tangent by 1 %: peaks of responses were off by far more than the errors told of them."""

    def tangent(self, u: Any, v: Any) -> Any:
        by_u, by_v = super().tangent(u, v)
        by_u[:, 1, 1] *= 1.01
        return by_u, by_v


class Undamped(Cubic):
    """A small force of the velocity that its tangents leave out."""

    def force(self, u: Any, v: Any) -> Any:
        return super().force(u, v) + 1e-4 * v


class Hidden(Cubic):
    def __init__(self) -> None:
        self.__dict__["gap"] = np.zeros(5)


def followed(law: fw.PythonLaw) -> fw.Branch:
    model = fw.Model(np.eye(10), np.diag(1.0 + np.arange(10)) + 0.1, contacts=[fw.Contact(law, np.eye(10))])
    mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 3, samples=64), dof=0)
    return fw.follow(mode, 0.1, 1.0, errors=False)


WRONG = {
    NotOdd: "says `odd = True`, and is not",
    Turned: "returned a force of another shape",
    TurnedTangent: "returned a tangent of another shape",
    OneTangent: "returned no two tangents",
    Masked: "returned a force that is no number",
    Words: "returned a force that is no number",
    Counting: "depends on more than the present",
    Slider: "depends on more than the present",
    Forgetful: "returned a force that is no number",
    Steeper: "the tangents of a law in Python are not those of its force",
    Undamped: "the tangents of a law in Python are not those of its force",
    Hidden: "`gap` of a law in Python is wrong",
}


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("law", WRONG, ids=lambda law: law.__name__)
def test_a_law_that_is_not_what_it_says_is_refused(law: type[Cubic]) -> None:
    """One that is not odd had 8 % of negative damping without any; numbers of other pairs acted on these."""
    with pytest.raises(fw.InputError, match=WRONG[law]) as error:
        followed(law())
    # ranks tell each other all of it
    assert error.value.where == f"law '{law.__name__}'" and str(error.value).endswith(error.value.fix)


@pytest.mark.parametrize("law", [SliderAsItBegins, Masing], ids=lambda law: law.__name__)
def test_a_memory_that_the_farthest_sample_does_not_show_is_refused(law: type[Cubic]) -> None:
    """Masing's loop was followed to zeta = 0.84 %, and a slider through one period until it was killed."""
    t = 1e-3 + np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
    u, v = (np.tile(part[:, None, None], (1, 2, 5)) for part in (np.cos(t), -np.sin(t)))
    with pytest.raises(fw.InputError, match="depends on more than the present"):
        check_motion(law(), u, v, law().force(u, v))


#: With another traceback in them.
WORDS = 'out of\nluck:\n  File "other.py", line 7, in force\nof old'


class Raising(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        if u.shape[2] == 3:  # on the first rank alone
            raise ValueError(WORDS)
        return super().force(u, v)


@pytest.mark.ranks(2)
def test_other_ranks_are_told_what_a_law_raises_and_where() -> None:
    """The last line of its words was all that they were told."""
    with pytest.raises(fw.FretwaveError) as error:
        followed(Raising())
    assert error.value.what == f"ValueError: {WORDS}"
    assert error.value.where is not None and f'rank 0, contact at rest, File "{__file__}", line' in error.value.where


class Interrupting(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        if u.shape[2] != 2:  # on the first rank alone, or the only one
            raise KeyboardInterrupt
        return super().force(u, v)


@pytest.mark.ranks(1, 2)
def test_an_interrupt_in_a_law_interrupts_all_ranks() -> None:
    """It came out as an error of the law."""
    with pytest.raises(KeyboardInterrupt):
        followed(Interrupting())


class Counting(Cubic):
    asked = {"force": 0, "tangent": 0}

    def force(self, u: Any, v: Any) -> Any:
        self.asked["force"] += 1
        return super().force(u, v)

    def tangent(self, u: Any, v: Any) -> Any:
        self.asked["tangent"] += 1
        return super().tangent(u, v)


def test_an_explicit_step_in_time_asks_for_forces_alone() -> None:
    """And for tangents once, where it looks for corners; they were asked for as often as forces."""
    model = fw.Model(np.eye(2), np.eye(2), None, [fw.Contact(Counting(), np.eye(2))])
    Counting.asked.update(force=0, tangent=0)
    run = fw.Transient(model).run([1.0, 0.5], [0.0, 0.0], 20.0, 0.5, 1e-6)
    energy = [0.5 * (v @ v + x @ x) + 0.125 * (x**4).sum() for x, v in zip(run["x"], run["v"])]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-4)
    assert 0 < Counting.asked["tangent"] < 0.5 * Counting.asked["force"], Counting.asked


@pytest.mark.parametrize(
    ("name", "value"),
    [("normal", 5), ("odd", "no"), ("odd", 1), ("stuck_stiffness", np.nan), ("stuck_stiffness", None)],
    ids=["normal", "text", "one", "nan", "none"],
)
def test_attributes_of_another_kind_are_refused(name: str, value: Any) -> None:
    with pytest.raises(fw.InputError, match=f"`{name}` of a law in Python"):
        followed(type("Odd", (Cubic,), {name: value})())


class Across(fw.PythonLaw):
    """A spring across its own direction: terms of 1 leave u^3 / 2."""

    def force(self, u: Any, v: Any) -> Any:
        return u * (1 - 1 / np.sqrt(1 + u**2))

    def tangent(self, u: Any, v: Any) -> Any:
        slope = (1 - (1 + u**2) ** -1.5)[:, :, None]
        return slope, 0.0 * slope


class Bounded(Cubic):
    """It has no force beyond a motion, and says so."""

    def force(self, u: Any, v: Any) -> Any:
        if (np.abs(u) > 1).any():
            raise ValueError("beyond the stop")
        return super().force(u, v)


class Late(Cubic):
    """The tangents of a stop are twice its own."""

    def force(self, u: Any, v: Any) -> Any:
        return np.maximum(u - 0.9, 0.0)

    def tangent(self, u: Any, v: Any) -> Any:
        slope = np.zeros((len(u), 2, 2, u.shape[2]))
        slope[:, 0, 0], slope[:, 1, 1] = (2.0 * (u[:, k] > 0.9) for k in range(2))
        return slope, 0.0 * slope


def turn(components: int, size: float) -> list[Any]:
    """Displacement and velocity of three pairs round their period."""
    turned = np.arange(32)[:, None, None] * np.pi / 16 + np.arange(3) + 0.4 * np.arange(components)[:, None]
    return [size * np.cos(turned), -size * np.sin(turned)]


@pytest.mark.parametrize("size", [1e-12, 1e-10, 1e-8, 1e-6, 1e-3, 0.9995])
def test_rounding_inside_a_law_and_the_end_of_it_tell_no_tangents(size: float) -> None:
    for law, components in ((Across(), 1), (Bounded(), 2)):
        u, v = turn(components, size)
        check_tangents(law, u, v, law.force(u, v))


def test_tangents_are_looked_at_where_the_force_is_largest() -> None:
    u, v = turn(2, 1.0)
    with pytest.raises(fw.InputError, match="the tangents of a law in Python are not those of its force"):
        check_tangents(Late(), u, v, Late().force(u, v))


class Unlike(Cubic):
    """The same law: not odd by its own word, in single precision, as lists, as it jumps at rest."""

    odd = False


class Single(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        return super().force(u, v).astype(np.float32)


class Lists(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        return super().force(u, v).tolist()


class Objects(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        return super().force(u, v).astype(object)

    def tangent(self, u: Any, v: Any) -> Any:
        return np.stack(super().tangent(u, v))


def test_an_odd_law_may_jump_where_a_pair_rests() -> None:
    class Jumping(fw.PythonLaw):
        odd, stuck_stiffness = True, 0.0

        def force(self, u: Any, v: Any) -> Any:
            return 0.3 * u + 1e-2 * np.where(v >= 0, 1.0, -1.0)

    phase = np.linspace(0.1, 6.0, 16)
    u, v = (np.stack([part, 0 * part], axis=-1)[:, None] for part in (np.cos(phase), -np.sin(phase)))
    np.testing.assert_array_equal(Jumping()._evaluate(u, v)[0], Jumping().force(u, v))


@pytest.mark.parametrize("law", [Unlike, Single, Lists, Objects], ids=lambda law: law.__name__)
def test_a_law_that_is_what_it_says_is_taken(law: type[Cubic]) -> None:
    one, other = followed(law()), followed(Cubic())
    assert one.converged and one["omega"][-1] == pytest.approx(other["omega"][-1], rel=1e-6)


def test_axes_of_length_one_may_be_missing() -> None:
    """Of one component and one pair, also where its tangent is found by differences."""

    class Flat(fw.PythonLaw):
        odd, stuck_stiffness = True, 0.0

        def force(self, u: Any, v: Any) -> Any:
            return 0.5 * u.ravel() ** 3

    f, df_du, _ = Flat()._evaluate(u := np.linspace(0.1, 1.0, 5)[:, None, None], 0 * u)
    assert f == pytest.approx(0.5 * u**3) and df_du[:, 0] == pytest.approx(1.5 * u**2, rel=1e-8)


class Corner(fw.PythonLaw):
    """With a corner in its force, a steep place or a jump at a sample: a difference there is no tangent."""

    stuck_stiffness = 0.0

    def __init__(self, u: Any, v: Any) -> None:
        self.at = u, v

    def force(self, u: Any, v: Any) -> Any:
        past = v - self.at[1]
        return np.maximum(0.0, u - self.at[0]) + np.tanh(past / 1e-9) + np.where(past > 0, 1.0, -1.0)

    def tangent(self, u: Any, v: Any) -> Any:
        steep = 1 / (1e-9 * np.cosh(np.clip((v - self.at[1]) / 1e-9, -300, 300)) ** 2)
        return np.where(u > self.at[0], 1.0, 0.0)[:, :, None], steep[:, :, None]


def test_where_differences_are_no_tangents_they_are_not_held_to_them() -> None:
    u, v = np.full((1, 1, 1), 0.3), np.full((1, 1, 1), -0.7)
    assert Corner(u, v)._evaluate(u, v)[2] == pytest.approx(1e9)


@pytest.mark.parametrize("shape", [(16, 2, 0), (0, 2, 5)], ids=["pairs", "samples"])
def test_where_nothing_moves_there_is_nothing_to_hold_a_law_to(shape: tuple[int, ...]) -> None:
    assert Cubic()._evaluate(np.ones(shape), np.ones(shape))[0].shape == shape


@pytest.mark.parametrize("name", ["gap", "odd", "pairs", "stuck_stiffness"])
def test_a_parameter_does_not_hide_what_laws_have(name: str) -> None:
    """One of the name `pairs` was the numbers of the pairs, one of the name `gap` the method's place."""
    parameters = (fw.ParameterInfo(name, "-", "of its own"),)
    with pytest.raises(fw.InputError, match="has the name of a method") as error:
        fw.register_law(type("Hiding", (Cubic,), {"parameters": parameters}))
    assert error.value.measured == name


SCRIPT = """
import numpy as np
import fretwave as fw

class Spring(fw.PythonLaw):
    stuck_stiffness = 2.0

    def force(self, u, v):
        return 2.0 * u

model = fw.Model(np.eye(2), np.diag([1.0, 2.0]), contacts=[fw.Contact(Spring(), np.eye(2))])
mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 1), dof=0)
"""


def test_a_script_with_an_own_law_ends_without_words() -> None:
    """Its model and its functions hold each other to the end: nanobind had 40 lines on that."""
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


class Twisted(fw.PythonLaw):
    """f = A u + sin(C v), of three components and pairs that differ; counts how often it is asked."""

    components, calls = 3, 0
    A, C = np.arange(9.0).reshape(3, 3), np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 3.0], [0.5, 0.0, 1.0]])

    def force(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        self.calls += 1
        weight = 1.0 + np.arange(u.shape[2])
        return weight * (np.einsum("ij,njp->nip", self.A, u) + np.sin(np.einsum("ij,njp->nip", self.C, v)))


@pytest.mark.parametrize("samples", [0, 1, 300, 3000], ids=["none", "one", "some", "many"])
def test_tangents_by_differences_take_few_calls_of_a_force(samples: int) -> None:
    """All twelve motions at once where they are small; exact for what is linear, else to the square of a step."""
    random, law = np.random.default_rng(1), Twisted()
    u, v = random.normal(size=(2, samples, 3, 2))
    by_u, by_v = law.tangent(u, v)
    assert law.calls == {300: 3, 3000: 12}.get(samples, 1)
    weight = 1.0 + np.arange(2)
    slope = np.cos(np.einsum("ij,njp->nip", law.C, v))
    np.testing.assert_allclose(by_u, np.broadcast_to(law.A[:, :, None] * weight, by_u.shape), atol=1e-8)
    np.testing.assert_allclose(by_v, weight * np.einsum("ij,nip->nijp", law.C, slope), atol=1e-8)
