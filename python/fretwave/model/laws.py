"""Contact laws: the table of the compiled ones, and a base class for laws written in Python.

The only module that knows laws and parameters by name. All others ask for a parameter by its role and for the state of
a pair (stick, slip, open) where the law was asked: of the core, or of the results that keep it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..errors import InputError
from ..registry import LAW, admit

#: States of a pair at a sample, as the core counts them (src/contact/law.h); UNKNOWN where results keep none.
STICK, SLIP, OPEN, UNKNOWN = 0, 1, 2, -1
STATUS = {"stick": STICK, "slip": SLIP, "open": OPEN}


class Role(str, Enum):
    """What a parameter is to the mechanics, whatever its name; a law has at most one of a role (but `NONE`)."""

    NONE = "none"
    NORMAL_STIFFNESS = "normal_stiffness"
    TANGENTIAL_STIFFNESS = "tangential_stiffness"
    FRICTION_COEFFICIENT = "friction_coefficient"
    FRICTION_LIMIT = "friction_limit"
    LOAD = "load"
    GAP = "gap"
    REGULARISATION = "regularisation"


class Limit(str, Enum):
    """What the tangential force stays within: nothing sharp, a circle over all tangents, or each its own interval."""

    NONE = "none"
    CIRCLE = "circle"
    EACH = "each"


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter of a law; `strict` means above, not at, the lower bound."""

    name: str
    unit: str
    doc: str
    lower: float = -np.inf
    strict: bool = False
    default: float | None = None
    role: Role = Role.NONE


@dataclass(frozen=True)
class LawInfo:
    """A contact law; `components` is 1 (tangent, or a stop's normal), 2 (normal, tangent) or 3 (normal, two tangents).

    Attributes
    ----------
    memory : bool
        The force depends on the path of the displacement.
    normal : int or None
        Component along the normal, > 0 closing.
    wears : bool
        Worn depth counts as gap.
    limit : Limit
        Of the tangential force.
    """

    name: str
    doc: str
    components: int
    parameters: Sequence[ParameterInfo]
    memory: bool = False
    normal: int | None = None
    wears: bool = False
    limit: Limit = Limit.NONE

    def named(self, role: Role) -> str | None:
        """Name of the parameter with a role; None when the law has none."""
        return next((parameter.name for parameter in self.parameters if parameter.role == role), None)

    def value(self, role: Role, given: Mapping[str, Any]) -> Any:
        """Value of the parameter with a role, the law's default where none is given; None when there is neither."""
        found = next((parameter for parameter in self.parameters if parameter.role == role), None)
        return None if found is None else given.get(found.name, found.default)

    def with_roles(self, values: Mapping[Role, Any]) -> dict[str, Any]:
        """Values by the names of the parameters that have these roles; roles that the law lacks are left out."""
        return {str(self.named(role)): value for role, value in values.items() if self.named(role) is not None}

    def closing(self, which: npt.ArrayLike = True) -> dict[str, Any]:
        """Parameters with which pairs are closed at rest and stick, whatever their load, gap and friction; others open.

        Parameters
        ----------
        which : (n_pairs,) bool, optional
            By default all.
        """
        # by a load, or where the law has none by an interference
        load, gap = np.where(which, 1.0, 0.0), np.where(which, 0.0 if self.named(Role.LOAD) else -1.0, 1.0)
        return self.with_roles(
            {Role.LOAD: load, Role.GAP: gap, Role.FRICTION_COEFFICIENT: 1.0, Role.FRICTION_LIMIT: 1.0}
        )

    def stiffness_along(self, component: int) -> Role:
        """Role of the stiffness of a stuck pair along a component."""
        return Role.NORMAL_STIFFNESS if component == self.normal else Role.TANGENTIAL_STIFFNESS

    def plain(self) -> dict[str, Any]:
        """What results keep of the law, that they may be drawn without it."""
        roles = {parameter.role.value: parameter.name for parameter in self.parameters if parameter.role != Role.NONE}
        parameters = [
            [p.name, p.unit, p.doc, p.lower if np.isfinite(p.lower) else None, p.strict, p.default, p.role.value]
            for p in self.parameters
        ]
        more = {"components": self.components, "memory": self.memory, "wears": self.wears, "doc": self.doc}
        told = {"law": self.name, "normal": self.normal, "limit": self.limit.value, "roles": roles}
        return {**told, **more, "parameters": parameters}

    @classmethod
    def told(cls, plain: Mapping[str, Any]) -> LawInfo:
        """The inverse: a case is read with it where the core is missing."""
        parameters = [
            _parameter(name, unit, doc, -np.inf if lower is None else lower, *others)
            for name, unit, doc, lower, *others in plain["parameters"]
        ]
        name, doc, components = plain["law"], plain["doc"], plain["components"]
        limit = Limit(plain["limit"])
        return cls(name, doc, components, parameters, plain["memory"], plain["normal"], plain["wears"], limit)


@dataclass(frozen=True)
class KeptLaw:
    """What results say of a contact's law; see `LawInfo`. `roles` gives the parameters' names by their roles."""

    law: str
    normal: int | None
    limit: Limit
    roles: Mapping[Role, str]

    def value(self, contact: str, role: Role, case: Mapping[str, Any]) -> Any:
        """Value in the case's keys, as results keep them, of the parameter with a role; None where there is none."""
        return case.get(f"contact.{contact}.{self.roles[role]}") if role in self.roles else None


def kept_laws(kept: Mapping[str, Any]) -> dict[str, KeptLaw]:
    """Laws by contact, from what results hold of each (`LawInfo.plain`)."""
    return {
        contact: KeptLaw(
            told["law"], told["normal"], Limit(told["limit"]), {Role(k): name for k, name in told["roles"].items()}
        )
        for contact, told in kept.items()
    }


def laws() -> dict[str, LawInfo]:
    """All laws that a case can name: the compiled ones and those registered here.

    Without the core those that results told of (`learn_laws`) stand for the compiled ones.
    """
    return {**(_learnt or _compiled()), **{name: law.info() for name, law in _registered.items()}}


def usual_name(role: Role) -> str:
    """What laws call the parameter with a role; of a table of pairs, whatever law will take it."""
    return next(name for law in laws().values() if (name := law.named(role)) is not None)


def learn_laws(kept: Sequence[Mapping[str, Any]]) -> bool:
    """Where the core is missing, know the laws that results keep (`LawInfo.plain`); False if they are too old."""
    with suppress(ImportError):
        _compiled()
        return True
    if not all("parameters" in told for told in kept):
        return False
    _learnt.update({told["law"]: LawInfo.told(told) for told in kept})
    return True


_learnt: dict[str, LawInfo] = {}


@cache
def _compiled() -> dict[str, LawInfo]:
    from .. import _core

    return {
        name: LawInfo(name, doc, components, [_parameter(*p) for p in parameters], memory, normal, wears, Limit(limit))
        for name, doc, components, parameters, memory, normal, wears, limit in _core.law_table()
    }


def _parameter(
    name: str, unit: str, doc: str, lower: float, strict: bool, default: float | None, role: str
) -> ParameterInfo:
    return ParameterInfo(name, unit, doc, lower, strict, default, Role(role))


def law_like(wanted: Callable[[LawInfo], bool]) -> str:
    """Name of the first law that `wanted` accepts, for advice in messages."""
    return next(name for name, info in laws().items() if wanted(info))


def own_load(contacts: Sequence[Any]) -> str | None:
    """Name of the first parameter by which one of these contacts has a load of its own, for advice in messages."""
    return next(filter(None, (contact.info.named(Role.LOAD) for contact in contacts)), None)


def springs(stiffness: float | Array) -> tuple[str, dict[str, Any]]:
    """Law and parameters of linear springs [force/length] on one component: sliders that stuck modes never see slip."""
    return "jenkins", {"tangential_stiffness": stiffness, "friction_limit": 1.0}


class PythonLaw:
    """A contact law for prototypes: the force depends on the present relative displacement and velocity only.

    Subclasses give ``force(u, v)``, and ``tangent(u, v)`` when they can: without it the tangent is a central difference
    and Newton is accurate to about 1e-9. Arrays are (n_samples, components, n_pairs). ``status`` and ``gap`` say which
    pairs stick, slip and are open in tables, pictures and views.

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
        Stiffness of the closed contact [force/length] in stuck linear modes; infinite means no relative motion.
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

    def __init__(self, **values: Array) -> None:
        self.__dict__.update(values)

    def __init_subclass__(cls, **given: object) -> None:
        super().__init_subclass__(**given)
        if cls.components > 1 and "normal" not in vars(cls) and cls.normal is None:
            cls.normal = 0

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.components} components{', odd' if self.odd else ''})"

    def force(self, u: Array, v: Array) -> Array:
        """Contact force, shape of `u`, in the direction of +u (it resists the motion)."""
        raise NotImplementedError

    def tangent(self, u: Array, v: Array) -> tuple[Array, Array]:
        """(df/du, df/dv), each (n_samples, components, components, n_pairs): [.., row, column, ..]."""
        return self._difference(u, v, 0), self._difference(u, v, 1)

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

    def _difference(self, u: Array, v: Array, which: int) -> Array:
        columns = []
        for column in range(self.components):
            moved = (u, v)[which]
            step = np.zeros_like(moved)
            step[:, column] = 6e-6 * max(float(np.abs(moved).max(initial=0.0)), 1e-12)
            plus, minus = ((u + step, v), (u - step, v)) if which == 0 else ((u, v + step), (u, v - step))
            columns.append((self.force(*plus) - self.force(*minus)) / (2 * step[:, column : column + 1]))
        return np.stack(columns, axis=2)

    def _evaluate(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """What the compiled core calls for the force."""
        f, (df_du, df_dv) = self.force(u, v), self.tangent(u, v)
        return _contiguous(f), _contiguous(df_du), _contiguous(df_dv)

    def _states(self, u: Array, v: Array, f: Array) -> tuple[Array, Array]:
        """What it calls for status and gap."""
        return _contiguous(self.status(u, v, f)), _contiguous(self.gap(u, v, f))


def _contiguous(values: npt.ArrayLike) -> Array:
    return np.ascontiguousarray(values, dtype=float)


_registered: dict[str, type[PythonLaw]] = {}


def register_law(law: type[PythonLaw]) -> type[PythonLaw]:
    """Make a law in Python known by its name, on every rank; also as decorator of its class.

    Raises
    ------
    InputError
        A compiled law or one of another file has the name, or two parameters have one role.
    """
    info = law.info()
    where = f"law '{info.name}'"
    with suppress(ImportError):  # where results are only drawn the core need not be there
        if info.name in _compiled():
            raise InputError("a contact law of this name is there already", where, fix="give it another name")
    roles = [parameter.role for parameter in info.parameters if parameter.role != Role.NONE]
    twice = sorted({role.value for role in roles if roles.count(role) > 1})
    if twice:
        raise InputError("two parameters of a law have one role", where, twice, "one each", "leave a role out")
    admit(LAW, info.name, _registered, law)
    _registered[info.name] = law
    return law


def forget_law(law: type[PythonLaw]) -> None:
    """The inverse of `register_law`."""
    _registered.pop(law.info().name, None)


def core_law(name: str, values: Mapping[str, Array], pairs: npt.NDArray[np.intp]) -> Any:
    """The law as the core takes it, with the parameters of these pairs."""
    from .. import _core

    mine = {key: value[pairs] for key, value in values.items()}
    if name in _registered:
        return python_law(_registered[name](**mine), pairs)
    return _core.make_law(name, {key: value.tolist() for key, value in mine.items()})


def python_law(law: PythonLaw, pairs: npt.NDArray[np.intp]) -> Any:
    """A law in Python as the core takes it."""
    from .. import _core

    law.pairs = pairs
    return _core.python_law(law, len(pairs))
