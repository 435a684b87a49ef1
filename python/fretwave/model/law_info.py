"""What is told of a contact law: its parameters with their roles, its components and the limit of its force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

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

    @classmethod
    def told(
        cls, name: str, unit: str, doc: str, lower: float, strict: bool, default: float | None, role: str
    ) -> ParameterInfo:
        """Of a row of the core's table, or of what results keep."""
        return cls(name, unit, doc, lower, strict, default, Role(role))


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
            ParameterInfo.told(name, unit, doc, -np.inf if lower is None else lower, *others)
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
