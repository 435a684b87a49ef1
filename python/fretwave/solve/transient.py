"""Direct time integration of the unreduced equations with PETSc TS, for verification."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from .. import _core
from ..arrays import Array
from ..errors import InputError
from ..given import array_of, numbers, positive_or_infinite, relative_tolerance, whole
from ..kinds import of_their_kinds
from ..model.model import Model
from ..mpi.gather import on_all_ranks
from .steps import TIME_TOLERANCE

#: Of one run, unless told: a minute of a small model.
MOST_STEPS = 400_000


class Transient:
    """M x'' + C x' + K x + B^T f = level Re sum P_n e^{i n w t} from given initial conditions. Collective.

    Runge-Kutta 5(4) with step control; where contact is so stiff that it would take too many steps, linearly implicit
    steps (Rosenbrock-W, order 3) with the laws' tangents, to the same tolerance.
    For contact laws that depend on the present motion only.

    A step in which a stop closes and opens again is taken shorter, where it goes deeper than `rtol` of the motion.

    Parameters
    ----------
    force : dict, optional
        Order n -> complex (n_dof,).
    omega : float [rad/s], needed with a force

    Raises
    ------
    InputError
        A contact law has a memory, the model is one sector, or a force has no frequency.
    """

    @of_their_kinds
    def __init__(
        self,
        model: Model,
        force: Mapping[int, npt.NDArray[Any]] | None = None,
        level: float = 1.0,
        omega: float | None = None,
        prefix: str = "transient_",
    ) -> None:
        level, omega = float(numbers("level", level)), float(numbers("omega", 0.0 if omega is None else omega))
        if not isinstance(prefix, str):
            raise InputError("a prefix is no text", "Transient(prefix=...)", repr(prefix), "a text", "leave it out")
        if force is not None and not isinstance(force, Mapping):
            what, expected = "the force has no harmonics", "a dict by whole orders"
            raise InputError(what, "force", repr(force), expected, "write {1: P}, P one number a dof")
        if force and not omega:
            raise InputError("a force needs its frequency", None, omega, "omega > 0", "give omega")
        if model.sectors > 1:
            raise InputError(
                "one sector with a wave has no equations in time",
                None,
                f"a sector of {model.sectors}",
                "a model of the whole structure",
                "integrate the wheel: sector.wheel()",
            )
        model.check_unchanged()
        self.model = model
        parts = [self._part(model, order, array_of(P), level) for order, P in (force or {}).items()]
        self._core = _core.Transient(model.core, parts, omega, prefix)

    @staticmethod
    def _part(model: Model, order: int, P: Array, level: float) -> tuple[int, PETSc.Vec, PETSc.Vec]:
        """Order and vectors of the cosine and the sine of a harmonic of the force."""
        number = whole(order)
        if number is None or P.dtype.kind not in "biufc":
            measured, fix = f"{order!r}: {P.dtype}", "write {1: P}, P one number a dof"
            raise InputError("the force has no harmonics", "force", measured, "a dict by whole orders", fix)
        return number, model.vector(level * np.real(P)), model.vector(-level * np.imag(P))

    def __repr__(self) -> str:
        return f"Transient(of {self.model})"

    def run(
        self,
        x0: Array,
        v0: Array,
        t_end: float,
        dt_out: float,
        rtol: float = TIME_TOLERANCE,
        limit: float = float("inf"),
        most_steps: float = MOST_STEPS,
    ) -> dict[str, Any]:
        """Integrate to `t_end`, or until |x| of any dof exceeds `limit`. Collective.

        Parameters
        ----------
        most_steps : explicit steps that would be more than a quarter of these give way to implicit ones; if those would
            be more too, it ends

        Returns
        -------
        dict
            t (n,), x and v (n, n_dof) every `dt_out`; steps; implicit; finished (reached the end); reason ("end",
            "limit" of the motion, too many "steps", or why the method stopped). On every rank.

        Raises
        ------
        InputError
            An array does not fit the model, a number is not above zero, or the tolerance not below one.
        """
        self.model.check_unchanged()
        for name, value in (("t_end", t_end), ("dt_out", dt_out)):
            numbers(name, value)
        relative_tolerance("rtol", rtol)
        for name, value in (("limit", limit), ("most_steps", most_steps)):
            positive_or_infinite(name, value)
        with self.model.vectors(x0, v0) as (start, speed):
            t, x, v, steps, implicit, finished, reason = self._core.run(
                start, speed, t_end, dt_out, rtol, limit, float(most_steps)
            )
        whole = {name: on_all_ranks(self.model.comm, local, axis=1) for name, local in (("x", x), ("v", v))}
        return {"t": t, **whole, "steps": steps, "implicit": implicit, "finished": finished, "reason": reason}
