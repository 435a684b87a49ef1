"""What is observed of a motion beside its amplitude: rows of displacements, coordinates of linear modes, energy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Union

import numpy as np
from petsc4py import PETSc

from ..columns import COLUMNS, ENERGY, Column
from ..errors import InputError
from ..post.motion import complex_amplitudes
from .harmonic_problem import HarmonicProblem
from .observed import Observed, row_of, unit_of


class Observer:
    """Extra columns of a branch. Collective, as all methods.

    Parameters
    ----------
    observe : dict
        Name of the column -> dof, row (n_dof,), linear mode, or "energy".

    Raises
    ------
    InputError
        A name is taken, or a row does not fit.
    """

    def __init__(self, problem: HarmonicProblem, observe: Mapping[str, Union[Observed, str]]) -> None:
        if not isinstance(observe, Mapping):
            fix = 'give for example observe={"tip": 3}'
            raise InputError(
                "columns have no names", "observe", repr(observe), "a dict of what is observed by name", fix
            )
        self.columns = [_column(name, what) for name, what in observe.items()]
        self.rows = {name: row_of(problem.model, what) for name, what in observe.items() if not isinstance(what, str)}
        self.energies = [name for name, what in observe.items() if isinstance(what, str)]
        self.first, self.end = problem.model.ownership

    def __call__(self, y: PETSc.Vec, problem: HarmonicProblem) -> dict[str, float]:
        """By column: amplitude of the fundamental of each row [length], energy [energy]."""
        q = complex_amplitudes(problem.harmonics.labels, problem.local_coefficients(y))[1]
        sums = np.array(
            [
                sum((w * q[dof - self.first] for dof, w in row if self.first <= dof < self.end), 0j)
                for row in self.rows.values()
            ]
        )
        sums = np.asarray(problem.model.comm.allreduce(sums))
        energy = mechanical_energy(problem, y) if self.energies else 0.0
        return {**dict(zip(self.rows, np.abs(sums).tolist())), **dict.fromkeys(self.energies, energy)}


def mechanical_energy(problem: HarmonicProblem, y: PETSc.Vec) -> float:
    """Energy of the vibration [energy], mean over a period: of M moving and K strained. Collective.

    sum_n>0 (|s_n|^2 q_n^H M q_n + q_n^H K q_n) / 4 on the periodic motion. What contact stores and the mean
    displacement are left out. Of one sector where the model is one.
    """
    return float(problem.core.mechanical_energy(y))


def _column(name: str, what: Union[Observed, str]) -> Column:
    if name in COLUMNS:
        raise InputError("a column of this name is there already", "observe", name, None, "choose another name")
    if not isinstance(what, str):
        return Column(name, unit_of(what), "fundamental amplitude of what is observed")
    if what != ENERGY.name:
        raise InputError(
            "this cannot be observed", f"observe '{name}'", what, f'a dof, row, mode or "{ENERGY.name}"', ENERGY.name
        )
    return replace(ENERGY, name=name)
