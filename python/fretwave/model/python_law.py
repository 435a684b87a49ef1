"""A base class for contact laws written in Python."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice, product
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..errors import InputError
from ..given import whole
from .law_claims import OF_TANGENTS, check_motion, check_status, check_tangents, check_words, place_of, taken
from .law_info import OPEN, SLIP, LawInfo, Limit, ParameterInfo

#: Entries of the motions that a tangent by differences asks for at once.
AT_ONCE = 1 << 13


class PythonLaw:
    """A contact law for prototypes: the force depends on the present relative displacement and velocity only.

    Subclasses give ``force(u, v)``, and ``tangent(u, v)`` when they can: without it the tangent is a central difference
    and Newton is accurate to about 1e-9. Arrays are (n_samples, components, n_pairs). ``status`` and ``gap`` say which
    pairs stick, slip and are open in tables, pictures and views.

    It is held to what it says of itself (`law_claims`): a force of another shape, odd or with a memory against its word
    is refused, and tangents that are seen not to be those of the force. For that `force` is asked now and then for one
    sample of a motion, for its mirror, and both beside some samples and beside larger motions.

    With `register_law` a case names it as any other; it is then made with its parameters as keywords, each (n_pairs,).

    Attributes
    ----------
    name : str
        Under which a case finds it; by default that of the class.
    parameters : sequence of ParameterInfo
        Of a registered law, with their roles.
    components : int
        1 (tangent), 2 (normal, tangent) or 3 (normal, two tangents).
    normal : int or None
        Component along the normal, > 0 closing; by default the first of several, none of one.
    limit : Limit
        What the tangential force stays within, where that is sharp.
    odd : bool
        f(-u, -v) = -f(u, v): even harmonics may be left out.
    stuck_stiffness : float
        Stiffness of the closed contact [force/length] in stuck linear modes; infinite means no relative motion. Pairs
        that are `status` open at rest, by a `gap` above 0, have none.
    pairs : array of int
        Which pairs (rows of B) the arrays hold, on this rank; set by the model.
    """

    name: str = ""
    parameters: Sequence[ParameterInfo] = ()
    components: int = 1
    normal: int | None = None
    limit: Limit = Limit.NONE
    odd: bool = False
    stuck_stiffness: float = float("inf")
    pairs: npt.NDArray[np.intp]
    _evaluations: int = 0
    _no_number: str = ""

    def __init__(self, **values: Array) -> None:
        self.__dict__.update(values)

    def __init_subclass__(cls, **given: object) -> None:
        super().__init_subclass__(**given)
        if (whole(cls.components) or 0) > 1 and "normal" not in vars(cls) and cls.normal is None:
            cls.normal = 0

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.components} components{', odd' if self.odd else ''})"

    def force(self, u: Array, v: Array) -> Array:
        """Contact force, shape of `u`, in the direction of +u (it resists the motion)."""
        raise NotImplementedError

    def tangent(self, u: Array, v: Array) -> tuple[Array, Array]:
        """(df/du, df/dv), each (n_samples, components, components, n_pairs): [.., row, column, ..]."""
        steps = [6e-6 * max(float(np.abs(moved).max(initial=0.0)), 1e-12) for moved in (u, v)]
        forces = self._forces(self._moved(u, v, steps), u.size)
        slopes = [(next(forces) - next(forces)) / (2 * step) for step in steps for _ in range(self.components)]
        return np.stack(slopes[: self.components], axis=2), np.stack(slopes[self.components :], axis=2)

    def status(self, u: Array, v: Array, f: Array) -> npt.NDArray[Any]:
        """`STICK`, `SLIP` or `OPEN` (n_samples, n_pairs); by default open without a normal force, and slip else."""
        shut = np.ones_like(f[:, 0], dtype=bool) if self.normal is None else f[:, self.normal] > 0
        return np.where(shut, SLIP, OPEN)

    def gap(self, u: Array, v: Array, f: Array) -> Array:
        """Distance to contact [length] (n_samples, n_pairs), 0 where closed; by default not known (nan) where open."""
        return np.where(self.status(u, v, f) == OPEN, np.nan, 0.0 if self.normal is not None else np.nan)

    @staticmethod
    def at_limit(force: Array, limit: Array) -> npt.NDArray[np.bool_]:
        """Whether tangential forces are at their limit, by the one tolerance that all laws share."""
        from .. import _core

        return force >= limit * (1 - _core.limit_tolerance)

    @classmethod
    def info(cls) -> LawInfo:
        """As in the table of laws."""
        name, text = cls.name or cls.__name__, (cls.__doc__ or "").strip().split("\n")[0]
        return LawInfo(name, text, cls.components, cls.parameters, normal=cls.normal, limit=cls.limit)

    def _moved(self, u: Array, v: Array, steps: Sequence[float]) -> Iterator[tuple[Array, Array]]:
        """Motions with a component of u, then of v, a step more and a step less."""
        for which, column, sign in product((0, 1), range(self.components), (1, -1)):
            motion = u.copy(), v.copy()
            motion[which][:, column] += sign * steps[which]
            yield motion

    def _forces(self, motions: Iterator[tuple[Array, Array]], size: int) -> Iterator[Array]:
        """Of motions of so many entries, many small ones at once, as samples: a call costs as much as these."""
        while several := list(islice(motions, max(1, AT_ONCE // max(1, size)))):
            yield from np.split(self._force(*(np.concatenate(parts) for parts in zip(*several))), len(several))

    def _evaluate(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """What the compiled core calls for the force and its tangents."""
        f, tangents = self._force(*_copies(u, v)), self._tangents(u, v)
        if self._is_due():
            check_motion(self, u, v, f)
            if type(self).tangent is not PythonLaw.tangent:
                check_tangents(self, u, v, f)
        return f, *tangents

    def _force_alone(self, u: Array, v: Array) -> Array:
        """And where it needs no tangents."""
        f = self._force(*_copies(u, v))
        if self._is_due():
            check_motion(self, u, v, f)
        return f

    def _is_due(self) -> bool:
        """Whether the law is held to its word at this evaluation: at 1, 2, 4, 8, ..."""
        self._evaluations += 1
        return self._evaluations & (self._evaluations - 1) == 0

    def _force(self, u: Array, v: Array) -> Array:
        f = np.array(taken(self, "a force", self.force(u, v), u.shape))  # a law may keep, and fill again, what it gave
        if not self._no_number and not np.isfinite(f).all():
            self._no_number = _without_number(u, v, f)
        return f

    def take_no_number(self) -> str:
        """Where it gave a force that is no number [length, length/time], since this was asked last; "" if nowhere.

        A step that goes there is shortened, and no error. Continuations ask before each step.
        """
        told, self._no_number = self._no_number, ""
        return told

    def _tangents(self, u: Array, v: Array) -> tuple[Array, Array]:
        given = self.tangent(*_copies(u, v))
        try:
            by_u, by_v = given
        except (TypeError, ValueError):
            what, fix = "a law in Python returned no two tangents", "return both, or leave `tangent` out"
            raise InputError(what, place_of(self), type(given).__name__, "(df/du, df/dv)", fix) from None
        shape = (len(u), self.components, self.components, u.shape[2])
        return taken(self, "a tangent", by_u, shape, OF_TANGENTS), taken(self, "a tangent", by_v, shape, OF_TANGENTS)

    def _states(self, u: Array, v: Array, f: Array) -> tuple[Array, Array]:
        """What it calls for status and gap."""
        shape, given = (len(u), u.shape[2]), _copies(u, v, f)
        status = taken(self, "a status", self.status(*given), shape)
        check_status(self, status)
        return status, taken(self, "a gap", self.gap(*_copies(u, v, f)), shape)


def _without_number(u: Array, v: Array, f: Array) -> str:
    """The first motion, of numbers itself, of a pair that a law gave none for."""
    given, found = (np.isfinite(values).all(axis=1) for values in (np.concatenate([u, v], axis=1), f))
    for sample, pair in np.argwhere(given & ~found)[:1]:
        return f"u = {_row(u[sample, :, pair])}, v = {_row(v[sample, :, pair])}"
    return ""


def _row(values: Array) -> str:
    texts = [f"{value:.4g}" for value in values]
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def _copies(*values: Array) -> list[Array]:
    """A law may change its own in place: it would be another motion to all that is asked after."""
    return [one.copy() for one in values]


def python_law(law: PythonLaw, pairs: npt.NDArray[np.intp]) -> Any:
    """A law in Python as the core takes it.

    Raises
    ------
    InputError
        Its attributes are not what the core can take.
    """
    from .. import _core

    check_words(law, PythonLaw)
    law.pairs = pairs
    return _core.python_law(law, len(pairs))
