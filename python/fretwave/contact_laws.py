"""Contact laws: the table of the compiled ones, and a base class for laws written in Python."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import _core

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter of a law; `strict` means above, not at, the lower bound."""

    name: str
    unit: str
    doc: str
    lower: float
    strict: bool
    default: float | None


@dataclass(frozen=True)
class LawInfo:
    """A compiled contact law; `components` is 1 (tangent) or 3 (normal, two tangents).

    One with a `memory` depends on the path of the displacement.
    """

    name: str
    doc: str
    components: int
    parameters: list[ParameterInfo]
    memory: bool = False


def laws() -> dict[str, LawInfo]:
    """All compiled laws by name."""
    return {
        name: LawInfo(name, doc, components, [ParameterInfo(*p) for p in parameters], memory)
        for name, doc, components, parameters, memory in _core.law_table()
    }


class PythonLaw:
    """A contact law for prototypes: the force depends on the present relative displacement and velocity only.

    Subclasses give ``force(u, v)``, and ``tangent(u, v)`` when they can: without it the tangent is a central difference
    and Newton is accurate to about 1e-9. Arrays are (n_samples, components, n_pairs).

    Attributes
    ----------
    components : int
        1 (tangent) or 3 (normal, two tangents).
    odd : bool
        f(-u, -v) = -f(u, v): even harmonics may be left out.
    stuck_stiffness : float
        Stiffness of the closed contact [N/m] in stuck linear modes; infinite means no relative motion.
    pairs : array of int
        Which pairs (rows of B) the arrays hold, on this rank; set by the model.
    """

    components: int = 1
    odd: bool = False
    stuck_stiffness: float = float("inf")
    pairs: npt.NDArray[np.intp]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.components} components{', odd' if self.odd else ''})"

    def force(self, u: Array, v: Array) -> Array:
        """Contact force, shape of `u`, in the direction of +u (it resists the motion)."""
        raise NotImplementedError

    def tangent(self, u: Array, v: Array) -> tuple[Array, Array]:
        """(df/du, df/dv), each (n_samples, components, components, n_pairs): [.., row, column, ..]."""
        return self._difference(u, v, 0), self._difference(u, v, 1)

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
        """What the compiled core calls."""
        f, (df_du, df_dv) = self.force(u, v), self.tangent(u, v)
        return _contiguous(f), _contiguous(df_du), _contiguous(df_dv)


def _contiguous(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=float)
