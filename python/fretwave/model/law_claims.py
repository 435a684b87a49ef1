"""What a contact law in Python says of itself, held against what it gives: the core takes it at its word."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..errors import InputError
from ..given import masked, real, whole
from ..texts import shortened
from .law_info import STATUS

if TYPE_CHECKING:
    from .python_law import PythonLaw

#: Of the largest force: what two answers to one motion may differ by. Of the largest real part: what a Fourier
#: transform and its inverse leave of an imaginary one; of tangents, which may be differences.
SAME, ROUNDING, OF_TANGENTS = 1e-6, 1e-12, 1e-4
#: Of a pair's own motion: steps of the differences that its tangents are held to. How far those may be off, and how far
#: two differences, and the two sides of one, where they tell a tangent: not across a corner, nor at a steep place.
#: And the motions, as multiples of its own, in all of which they are off.
STEPS, OFF, AGREE, SIDES = (1e-3, 5e-4), 1e-3, 1e-4, 1e-2
LARGER = (1.0, 1e2, 1e4)
MEMORY = "a law with a memory is a compiled one (src/CONTRIBUTING.md); else return what u and v of a sample alone give"


def check_words(law: PythonLaw, base: type[PythonLaw]) -> None:
    """Its attributes are what the core can take, and hide no method of all laws.

    Raises
    ------
    InputError
    """
    count, stiff = whole(law.components) or 0, law.stuck_stiffness
    stiff_enough = real(stiff, in_array=True) is not None or (np.size(stiff) == 1 and bool(np.all(stiff == np.inf)))
    wanted = {
        "components": (count >= 1, "a whole number >= 1", "say how many directions a pair has"),
        "normal": (
            law.normal is None or whole(law.normal) in range(count),
            f"None, or 0 to {count - 1}",
            "say which component is along the normal",
        ),
        "odd": (isinstance(law.odd, bool), "True or False", "say whether f(-u, -v) = -f(u, v)"),
        "stuck_stiffness": (stiff_enough, "a number, or inf", "give the stiffness of the closed contact"),
        **{
            name: (callable(value), "a method", "give what hides it another name")
            for name, value in vars(law).items()
            if callable(getattr(base, name, None))
        },
    }
    for name, (good, expected, fix) in wanted.items():
        if not good:
            measured = shortened(repr(getattr(law, name)))
            raise InputError(f"`{name}` of a law in Python is wrong", place_of(law), measured, expected, fix)


def taken(
    law: PythonLaw, what: str, values: npt.ArrayLike, shape: tuple[int, ...], rounding: float = ROUNDING
) -> Array:
    """Values that a law gave as an array of real numbers, of which axes of length one may be missing.

    Raises
    ------
    InputError
    """
    if type(values) is np.ndarray and values.dtype == np.float64 and values.shape == shape:  # in time, at each step
        return np.ascontiguousarray(values)
    found, where = np.asanyarray(values), place_of(law)
    if found.dtype.kind == "O" and values is not None:  # which would be one that is not a number
        with suppress(TypeError, ValueError):
            found = found.astype(float)
    if found.dtype.kind not in "biufc" or masked(found):
        kind = "None" if values is None else "masked values" if masked(found) else found.dtype.name
        fix = "return an array of numbers"
        raise InputError(f"a law in Python returned {what} that is no number", where, kind, "real numbers", fix)
    flat = found.shape == (math.prod(shape),)
    if not flat and np.squeeze(np.empty(found.shape, "b")).shape != np.squeeze(np.empty(shape, "b")).shape:
        fix = f"return {what} with these axes, the last of them the pairs"
        raise InputError(f"a law in Python returned {what} of another shape", where, found.shape, shape, fix)
    if np.iscomplexobj(found):  # NumPy would keep the real part
        if abs(np.imag(found)).max(initial=0.0) > rounding * abs(np.real(found)).max(initial=0.0):
            fix = "return real forces; damping is a force of v"
            raise InputError("a law in Python returned complex values", where, "complex", "real arrays", fix)
        found = np.real(found)
    return np.ascontiguousarray(found, dtype=float).reshape(shape)


def check_status(law: PythonLaw, status: Array) -> None:
    """States are those that there are.

    Raises
    ------
    InputError
    """
    other = status[~np.isin(status, list(STATUS.values()))]
    if other.size:
        what, fix = "a law in Python returned a status other than STICK, SLIP and OPEN", "return one for each pair"
        expected = ", ".join(f"{name.upper()} ({value})" for name, value in STATUS.items())
        raise InputError(what, place_of(law), other[0], expected, fix)


def check_motion(law: PythonLaw, u: Array, v: Array, f: Array) -> None:
    """Two samples of it give the same forces by themselves, and of an odd law their mirrors the opposite ones.

    Where it is farthest a slider stands as if it had just been pushed there, and as it begins: not where it is fastest.

    Raises
    ------
    InputError
    """
    # pairs of which nothing rests: a step of a force may be there
    moving = ((u != 0) & (v != 0)).all(axis=1)
    if not moving.any():
        return
    for part in (u, v):
        sample = int(np.argmax(np.where(moving, np.abs(part).min(axis=1), 0.0).max(axis=1)))
        at, pairs = slice(sample, sample + 1), moving[sample]
        if not _same(_alone(law, u[at], v[at]), f[at], f):
            what = "the force of a law in Python depends on more than the present displacement and velocity"
            raise InputError(what, place_of(law), "a sample by itself has another force", "the same force", MEMORY)
        if law.odd and not _same(-_alone(law, -u[at], -v[at])[..., pairs], f[at][..., pairs], f):
            what, fix = "a law in Python says `odd = True`, and is not", "leave `odd` out, or say False"
            raise InputError(what, place_of(law), "f(-u, -v) is not -f(u, v)", "an odd force", fix)


def check_tangents(law: PythonLaw, u: Array, v: Array, f: Array) -> None:
    """Tangents that it gives are those of its force, at two samples and along one direction of u and of v.

    Newton finds the same motion with others; peaks, folds and estimated errors are read off them.

    Raises
    ------
    InputError
    """
    if not u.size:  # a rank without pairs
        return
    samples = [int(np.argmax(size.max(axis=1))) for size in (np.abs(u * v).min(axis=1), np.abs(f).max(axis=1))]
    for sample, (which, name) in product(samples, enumerate(("du", "dv"))):
        wrong = _wrong_tangent(law, u[sample : sample + 1], v[sample : sample + 1], which)
        if wrong is not None:
            row, given, found = wrong
            what, fix = "the tangents of a law in Python are not those of its force", "mend `tangent`, or leave it out"
            measured = f"of component {row}, df/{name} times a small motion is {given:.6g}"
            raise InputError(what, place_of(law), measured, f"{found:.6g}, by differences of `force`", fix)


def _wrong_tangent(law: PythonLaw, u: Array, v: Array, which: int) -> tuple[int, float, float] | None:
    """Component, its change by the tangent and by differences, of a pair where these differ in larger motions too.

    Inside a law terms may cancel that are far larger than its force: of a small motion that leaves steps, between which
    differences agree (and are none). A law may end, or raise, beyond the motion.
    """
    off, at_first = np.ones(u.shape[1:], dtype=bool), None
    for larger in LARGER:
        motion = [larger * part if k == which else part for k, part in enumerate((u, v))]
        try:
            with np.errstate(all="ignore"):
                given, found, here = _compared(law, motion, which)
        except Exception:
            return None
        off, at_first = off & here, at_first or (given, found)
        if not off.any():
            return None
    assert at_first is not None
    row, pair = np.argwhere(off)[0]
    return int(row), float(at_first[0][row, pair]), float(at_first[1][row, pair])


def _compared(law: PythonLaw, motion: Sequence[Array], which: int) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Changes by the tangent and by differences of one sample (components, pairs), and where the one is wrong."""
    sides = np.array([0.0, *(side * step for step in STEPS for side in (1.0, -1.0))])[:, None, None]
    way = (-0.7) ** np.arange(law.components)[:, None] * np.abs(motion[which][0]).max(axis=0)
    moved = [part + sides * way if k == which else np.repeat(part, len(sides), axis=0) for k, part in enumerate(motion)]
    raw, tangent = law.force(*(part.copy() for part in moved)), law.tangent(*(part.copy() for part in motion))[which]
    given, hidden = (np.asarray(tangent, dtype=float)[0] * way).sum(axis=1), _hidden(raw)
    f, *forces = taken(law, "a force", raw, moved[0].shape)
    found, told = _slope(forces, f, hidden)
    return given, found, told & (np.abs(given - found) > OFF * np.maximum(np.abs(given), np.abs(found)) + hidden)


def _slope(forces: Sequence[Array], f: Array, hidden: float) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Change of the force with a motion, by differences (components, pairs), and where these tell it."""
    wide, narrow = ((forces[k] - forces[k + 1]) / (2 * step) for k, step in zip((0, 2), STEPS))
    bent = np.abs(forces[0] + forces[1] - 2 * f) / (2 * STEPS[0])
    agree = (np.abs(wide - narrow) <= AGREE * np.abs(narrow) + hidden) & (narrow != 0)
    return narrow, agree & (bent <= SIDES * np.abs(wide) + hidden)


def _hidden(forces: npt.ArrayLike) -> float:
    """What rounding hides of such a change."""
    found = np.asarray(forces)
    rounding = SAME if found.dtype == np.float32 else ROUNDING
    return rounding * float(np.abs(found).astype(float).max(initial=0.0)) / STEPS[-1]


def _alone(law: PythonLaw, u: Array, v: Array) -> Array:
    return taken(law, "a force", law.force(u.copy(), v.copy()), u.shape)


def _same(one: Array, other: Array, among: Array) -> bool:
    with np.errstate(all="ignore"):
        return not np.any(np.abs(one - other) > SAME * np.abs(among).max(initial=0.0))


def place_of(law: PythonLaw) -> str:
    """Of messages."""
    return f"law '{law.name or type(law).__name__}'"
