"""The forced response as a problem: steady motion under a periodic force over its frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from .. import _core
from ..errors import InputError
from ..given import numbers, whole, with_a_square
from ..kinds import of_their_kinds
from ..model.model import Model
from ..model.modes import LinearMode
from ..model.rest import Rest
from ..texts import shortened
from .harmonic_problem import HarmonicProblem, check_mode
from .harmonics import Harmonics
from .observed import Observed, named, row_of
from .states import ForcedState


class ForcedResponse(HarmonicProblem):
    """Steady response to a periodic force over its frequency. Collective.

    Parameters
    ----------
    force : dict
        Order n -> complex (n_dof,), p(t) = level Re sum P_n e^{i n w t}.
    dof : int, (n_dof,), or LinearMode
        Observed: a dof, a row w . x of displacements, or a linear mode's coordinate phi^T M x (of unit modal mass).
    reference : LinearMode
        Scales the unknowns.
    prefix : str
        Of the PETSc options.
    rest : Rest, optional
        The static state that the motion is about (`fretwave.static_preload`), its own whatever other problems of the
        model are about; without it that of the model (`Model.settle`), and no static load.
    """

    core: _core.ForcedResponse

    @of_their_kinds
    def __init__(
        self,
        model: Model,
        harmonics: Harmonics,
        force: Mapping[int, npt.NDArray[Any]],
        level: float,
        dof: Observed,
        reference: LinearMode,
        prefix: str = "forced_",
        rest: Rest | None = None,
    ) -> None:
        check_mode(model, "reference", reference)
        self.dof, self.level, self.reference = dof, level, reference
        P = self._blocks(model, harmonics, force)
        largest = max((float(abs(np.asarray(one)).max()) for one in force.values()), default=0.0)
        with_a_square(
            "the excitation", float(numbers("level", level)) * largest, "choose another level or other units", "level"
        )
        with model.vectors(reference.shape) as (shape,):
            row = row_of(model, dof)
            core = _core.ForcedResponse(model.core, harmonics.core, row, P, level, reference.omega, shape)
        P.destroy()
        super().__init__(model, harmonics, prefix, core, rest)
        self.meaning = ForcedState(level, reference.omega, core.reference_amplitude)

    @staticmethod
    def _blocks(model: Model, harmonics: Harmonics, force: Mapping[int, npt.NDArray[Any]]) -> PETSc.Vec:
        if not isinstance(force, Mapping) or None in map(whole, force):
            measured, fix = shortened(repr(force)), "write {1: P}, P one number a dof"
            raise InputError("the force has no harmonics", "force", measured, "a dict by whole orders", fix)
        blocks = np.zeros((model.n_dof, harmonics.block_size))
        for given, P in force.items():
            order = whole(given)
            if order not in harmonics.orders:
                raise InputError(
                    "the force has a harmonic that is not retained",
                    None,
                    order,
                    str(harmonics.orders),
                    'retain it: retain = "all"',
                )
            values = np.asarray(P, dtype=complex)
            if values.shape != (model.n_dof,) or not np.isfinite(values).all():
                where, fix = f"force, order {order}", "give one number a dof, 0 where no force acts"
                raise InputError(
                    "the force does not fit the model", where, values.shape, f"({model.n_dof},), finite", fix
                )
            column = harmonics.labels.index(f"{order}c" if order else "0")
            blocks[:, column] = values.real
            if order:
                blocks[:, column + 1] = -values.imag
        local = model.distribute(blocks).ravel().copy()
        return PETSc.Vec().createWithArray(local, comm=model.comm)

    def amplitude_scale(self, y: PETSc.Vec) -> float:
        return self.core.reference_amplitude

    def _what(self) -> str:
        return f"level {self.level:g}, {named(self.dof)}, "

    def initial(self, omega: float) -> PETSc.Vec:
        """Zero motion at this angular frequency: Newton's first step is the linear response. Collective."""
        return self.core.initial(omega)
