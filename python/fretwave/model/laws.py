"""All contact laws by their names: those compiled into the core, and those registered in Python.

With `law_info` the only module that knows laws and parameters by name. All others ask for a parameter by its role and
for the state of a pair (stick, slip, open) where the law was asked: of the core, or of the results that keep it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..errors import InputError
from ..registry import LAW, admit
from .law_info import LawInfo, Limit, ParameterInfo, Role
from .python_law import PythonLaw, python_law


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
        name: LawInfo(
            name, doc, components, [ParameterInfo.told(*p) for p in parameters], memory, normal, wears, Limit(limit)
        )
        for name, doc, components, parameters, memory, normal, wears, limit in _core.law_table()
    }


def law_like(wanted: Callable[[LawInfo], bool]) -> str:
    """Name of the first law that `wanted` accepts, for advice in messages."""
    return next(name for name, info in laws().items() if wanted(info))


def no_wear(what: str, where: str | None, laws_given: str) -> InputError:
    """Of contact that is to wear and cannot."""
    fix = f'use law = "{law_like(lambda law: law.wears)}"'
    return InputError(what, where, laws_given, "a compiled law of friction along a normal direction", fix)


def own_load(contacts: Sequence[Any]) -> str | None:
    """Name of the first parameter by which one of these contacts has a load of its own, for advice in messages."""
    return next(filter(None, (contact.info.named(Role.LOAD) for contact in contacts)), None)


def springs(stiffness: float | Array) -> tuple[str, dict[str, Any]]:
    """Law and parameters of linear springs [force/length] on one component: sliders that stuck modes never see slip."""
    return "jenkins", {"tangential_stiffness": stiffness, "friction_limit": 1.0}


_registered: dict[str, type[PythonLaw]] = {}


def register_law(law: type[PythonLaw]) -> type[PythonLaw]:
    """Make a law in Python known by its name, on every rank; also as decorator of its class.

    Raises
    ------
    InputError
        Another law has the name, two parameters have one role, or one has the name of a method.
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
    hidden = sorted(
        p.name for p in info.parameters if hasattr(PythonLaw, p.name) or p.name in PythonLaw.__annotations__
    )
    if hidden:
        what, fix = (
            "a parameter of a law has the name of a method or attribute of laws in Python",
            "rename the parameter",
        )
        raise InputError(what, where, ", ".join(hidden), "other names", fix)
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
