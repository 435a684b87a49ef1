"""A contact: pairs and the law that holds between their sides. NumPy and the core's laws alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..errors import InputError
from ..given import masked
from ..kinds import of_their_kinds
from ..texts import shortened
from .law_info import LawInfo, ParameterInfo, Role
from .laws import core_law, laws, springs
from .pairs import Pairs, Values, repeated
from .python_law import PythonLaw, python_law
from .sectors import Term, by_sector, real_csr


@dataclass(init=False)
class Contact:
    """Contact pairs of one law.

    Parameters
    ----------
    law : str or PythonLaw
        Name of a compiled law (see `fretwave.laws`), or a law written in Python.
    B : (n_pairs * components, n_dof) sparse or dense, or dict, or Pairs
        Relative displacement u = B x, rows pair by pair (normal, tangent, tangent for three components).
        On a sector {0: B_0, 1: B_1}: u = B_0 x_j + B_1 x_{j+1} reaches the next sector's dofs.
    parameters : dict
        The law's parameters, a number or one per pair; of `Pairs` those that they bring are taken where none is given.
    pairs : Pairs, optional
        Where the pairs are; B, if given as well, takes the place of theirs.

    Raises
    ------
    InputError
        `Pairs` have not as many components as the law.
    """

    law: str | PythonLaw
    pairs: Pairs
    parameters: Values
    name: str

    @of_their_kinds
    def __init__(
        self,
        law: str | PythonLaw,
        B: Term | Pairs | None = None,
        parameters: Values | None = None,
        name: str = "contact",
        pairs: Pairs | None = None,
    ) -> None:
        self.law, self.name = law, name
        if parameters is not None and not isinstance(parameters, Mapping):
            fix, where = "give each value with its name; fw.laws() tells those of a law", f"contact '{name}'"
            raise InputError("parameters have no names", where, type(parameters).__name__, "a dict", fix)
        known = isinstance(law, PythonLaw) or law in laws()  # another is refused when a model is made
        if isinstance(B, Pairs):
            pairs, B = B, None
            if known:
                self._check_fit(pairs)
        if pairs is None:
            if B is None:
                raise InputError("a contact has no pairs", f"contact '{name}'", None, "B or pairs", "give B as u = B x")
            pairs = Pairs(B, self.components if known else 1)
        elif B is not None:
            pairs = replace(pairs, B=B)
        self.pairs, self.parameters = pairs, {**(self._brought(pairs) if known else {}), **(parameters or {})}

    def __repr__(self) -> str:
        law = self.law if isinstance(self.law, str) else type(self.law).__name__
        given = "".join(f", {name}={span(value)}" for name, value in self.parameters.items())
        rows, n_dof = np.shape(by_sector(self.B)[0])
        return f"Contact({self.name}: {law}, {rows} rows of B on {n_dof} dofs{given})"

    @property
    def B(self) -> Term:
        """u = B x, as it was given."""
        return self.pairs.B

    @property
    def n_pairs(self) -> int:
        """Number of pairs."""
        return self.pairs.n_pairs

    def closed(self, which: npt.ArrayLike = True) -> Contact:
        """Every pair closed at rest and with friction, whatever its load, gap and friction; others, if any, open.

        Parameters
        ----------
        which : (n_pairs,) bool, optional
        """
        return replace(self, parameters={**self.parameters, **self.info.closing(which)})

    def stuck_stiffness(self) -> Array:
        """Of a stuck pair along each row of B [force/length], (n_pairs, components); infinite where nothing gives."""
        law, n_pairs = self.core_law(np.arange(self.n_pairs), self.n_pairs), self.n_pairs
        return np.array([[law.stuck_stiffness(row, pair) for row in range(self.components)] for pair in range(n_pairs)])

    @property
    def never_sticks(self) -> bool:
        """Of a law with friction: some pair has none."""
        bounds = [self.value(role) for role in (Role.FRICTION_COEFFICIENT, Role.FRICTION_LIMIT)]
        return any(bound is not None and bool(np.min(bound) == 0) for bound in bounds)

    def sliding(self) -> Contact | None:
        """What is left of it closed and without friction: springs along the normals; None of a law without any."""
        stiffness, normal = self.value(Role.NORMAL_STIFFNESS), self.info.normal
        if normal is None or stiffness is None:
            return None
        normals = {k: real_csr(B)[normal :: self.components] for k, B in by_sector(self.B).items()}
        law, parameters = springs(stiffness)
        return Contact(law, normals, parameters, self.name)

    def around(self, sectors: int) -> Contact:
        """The pairs of all sectors of a wheel, one after the other."""
        given = {name: repeated(value, sectors) for name, value in self.parameters.items()}
        return replace(self, pairs=self.pairs.around(sectors), parameters=given)

    def _check_fit(self, pairs: Pairs) -> None:
        if pairs.components != self.components:
            raise InputError(
                "the law does not fit the contact pairs",
                f"contact '{self.name}'",
                f"{self.components} components of {self.law}, {pairs.components} of the pairs",
                "the same number",
                "choose another law",
            )

    def _brought(self, pairs: Pairs) -> Values:
        """Parameters of the law that come with the pairs."""
        known = [parameter.name for parameter in self.info.parameters] if pairs.parameters else []
        return {name: value for name, value in pairs.parameters.items() if name in known}

    @property
    def components(self) -> int:
        """Relative displacements per pair."""
        return self.law.components if isinstance(self.law, PythonLaw) else self.info.components

    @property
    def info(self) -> LawInfo:
        """What is known of the law: its parameters with their roles, its normal direction."""
        if isinstance(self.law, PythonLaw):
            return self.law.info()
        if self.law not in laws():
            raise InputError(
                "unknown contact law", f"contact '{self.name}'", self.law, ", ".join(laws()), "choose a known law"
            )
        return laws()[self.law]

    def value(self, role: Role) -> Any:
        """Value of the parameter with a role; None where the law has none."""
        return self.info.value(role, self.parameters)

    def states(self, u: Array, v: Array, f: Array) -> tuple[npt.NDArray[np.int8], Array]:
        """What the law says of displacements, velocities and forces (n_samples, components, n_pairs) of a period.

        Returns
        -------
        status, gap : (n_samples, n_pairs)
            Stick 0, slip 1 or open 2; distance to contact [length], nan of a law without a normal direction.
        """
        samples = [np.ascontiguousarray(values, dtype=float) for values in (u, v, f)]
        n_pairs = samples[0].shape[2]
        found: tuple[npt.NDArray[np.int8], Array] = self.core_law(np.arange(n_pairs), n_pairs).states(*samples)
        return found

    def core_law(self, pairs: npt.NDArray[np.intp], n_pairs: int) -> Any:
        """The compiled law with the parameters of these pairs."""
        if isinstance(self.law, PythonLaw):
            return python_law(copy(self.law), pairs)
        return core_law(self.law, self._values(n_pairs), pairs)

    def _values(self, n_pairs: int) -> dict[str, Array]:
        known = {p.name: p for p in self.info.parameters}
        for name in self.parameters:
            if name not in known:
                raise InputError(
                    "unknown law parameter", f"contact '{self.name}'", name, ", ".join(known), "remove or rename it"
                )
        values = {}
        for name, parameter in known.items():
            value = self.parameters.get(name, parameter.default)
            if value is None or np.size(value) not in (1, n_pairs):
                raise InputError(
                    f"law parameter '{name}' is missing or of the wrong length",
                    f"contact '{self.name}'",
                    "nothing" if value is None else f"{np.size(value)} values",
                    f"1 or {n_pairs} values",
                    "give one number, or one per pair",
                )
            values[name] = np.broadcast_to(self._numbers(name, value).ravel(), (n_pairs,))
            self._check_bound(parameter, values[name])
        return values

    def _numbers(self, name: str, value: npt.ArrayLike) -> Array:
        with suppress(TypeError, ValueError):  # rows of different lengths, None among them
            given = np.asarray(value)
            if given.dtype.kind in "biufO" and not masked(value):
                return given.astype(float)
        what, where = f"law parameter '{name}' is no number", f"contact '{self.name}'"
        raise InputError(what, where, shortened(repr(value)), "real numbers", "give one number, or one per pair")

    def _check_bound(self, parameter: ParameterInfo, values: Array) -> None:
        """Here and not in the core, which knows a rank's own numbers of the pairs."""
        low, sign = parameter.lower, ">" if parameter.strict else ">="
        good = np.isfinite(values) & ((values > low) if parameter.strict else (values >= low))
        if not good.all():
            pair = int(np.argmin(good))
            raise InputError(
                f"law parameter '{parameter.name}' is out of bounds",
                f"contact '{self.name}', pair {pair}",
                f"{values[pair]:g}",
                f"a number{f' {sign} {low:g}' if low > -1e300 else ''} [{parameter.unit}]",
                "give a value within the bound; leave out pairs that stand for no area",
            )


def contact_list(given: Iterable[Contact]) -> list[Contact]:
    """Contacts of a model, as they were given.

    Raises
    ------
    InputError
        Something else stands among them, or a contact without a list.
    """
    members: list[object] = list(given) if isinstance(given, Iterable) else [given]
    contacts = [one for one in members if isinstance(one, Contact)]
    if isinstance(given, Contact) or len(contacts) < len(members):
        expected, fix = "a list of fretwave.Contact", "write `contacts=[contact]`, or leave it out"
        raise InputError("contacts of a model are no list of contacts", "contacts", repr(given), expected, fix)
    names = [one.name for one in contacts]
    if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        fix = 'give each its own: fretwave.Contact(law, B, parameters, "another")'
        raise InputError(
            "two contacts have one name, or one has none", "contacts", names, "a text each, all others", fix
        )
    return contacts


#: Linear limits of a contact: every pair closed and stuck, closed and sliding without friction, no contact at all.
LIMITS = ("stuck", "sliding", "free")


def in_limit(contacts: Sequence[Contact], limit: str) -> list[Contact]:
    """Contacts whose stuck linear modes are those of the given ones in a limit (`LIMITS`)."""
    if limit == "stuck":
        return [contact.closed() for contact in contacts]
    left = [contact.sliding() for contact in contacts] if limit == "sliding" else []
    return [contact for contact in left if contact is not None]


def span(value: npt.ArrayLike) -> str:
    """A parameter in short: a number, or its least and largest over the pairs."""
    low, high = f"{float(np.min(value)):g}", f"{float(np.max(value)):g}"
    return low if low == high else f"{low} to {high}"
