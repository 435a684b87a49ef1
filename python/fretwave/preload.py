"""The static state under load: where the sliders start and what the dynamics move about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from . import _core
from .continuation import Continuation, StepControl
from .errors import NotConverged
from .model import Model
from .modes import LinearMode
from .problems import HarmonicProblem, Harmonics

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Preload:
    """A solved static state; the model's laws have it as their rest state.

    Attributes
    ----------
    displacement : (n_dof,) on every rank
    load : (n_dof,) the static load it balances, contact included
    stick, slip, open : shares of the pairs
    """

    displacement: Array
    load: Array
    stick: float
    slip: float
    open: float


class StaticPreload(HarmonicProblem):
    """K x + B^T f(B x) = p P over the load factor p; the contact starts untouched. Collective.

    Parameters
    ----------
    load : (n_dof,) P
    reference : LinearMode
        Scales the unknowns.
    """

    def __init__(
        self, model: Model, load: Array, reference: LinearMode, constant: Array | None = None, prefix: str = "static_"
    ) -> None:
        stiffness = reference.omega**2 / float(np.sum(reference.shape**2))
        size = (float(np.linalg.norm(load)) or stiffness) / stiffness
        self.force_scale = stiffness * size
        core = _core.StaticPreload(model.core, model.vector(load), size, stiffness)
        if constant is not None:
            core.preload(model.vector(np.zeros(model.n_dof)), model.vector(constant))
        super().__init__(model, Harmonics([0], 2), prefix, core)

    def state(self, y: PETSc.Vec) -> dict[str, float]:
        return {}


def balanced(model: Model, reference: LinearMode) -> Preload:
    """Normal loads given pair by pair are in balance as they are: no displacement, the load is B^T f(0). Collective."""
    problem = StaticPreload(model, np.zeros(model.n_dof), reference)
    y = problem.core.initial()
    problem.core.settle(y)  # sliders of a state solved before must not act on this one
    return _settled(problem, y, np.zeros(model.n_dof))


def static_preload(model: Model, load: Array, reference: LinearMode, steps: StepControl | None = None) -> Preload:
    """Static equilibrium under `load` and the normal loads given pair by pair. Collective.

    By continuation in the load factor.

    Raises
    ------
    NotConverged
        With the load factor that was reached.
    """
    rest = balanced(model, reference)
    problem = StaticPreload(model, np.asarray(load, dtype=float), reference, rest.load)
    branch = Continuation(
        problem, problem.core.initial(), (-1.0, 1.0), steps or StepControl(initial=0.1, maximum=0.5), upwards=True
    )
    reached = 0.0
    for point in branch:
        y, reached = point.y, point.parameter
    if not branch.converged:
        raise NotConverged(
            "no static equilibrium under the full load",
            None,
            f"load factor {reached:.4g}: {branch.reason}",
            "1",
            "hold the structure where contact alone cannot (an axial stop), or lower the load",
        )
    return _settled(problem, y, rest.load + np.asarray(load, dtype=float))


def _settled(problem: StaticPreload, y: PETSc.Vec, load: Array) -> Preload:
    """The laws take the state at y as theirs; the load is what the state balances, Newton's rest included.

    That rest, small beside the load, would be large beside the forces of a small motion.
    """
    load = load + _whole(problem.model, problem.residual(y)) * problem.force_scale
    contact = problem.diagnostics(y)
    problem.core.settle(y)
    blocks = _whole(problem.model, problem.core.coefficients(y))
    return Preload(blocks, load, contact["stick"], contact["slip"], contact["open"])


def _whole(model: Model, v: PETSc.Vec) -> Array:
    return np.concatenate(model.comm.allgather(v.getArray(readonly=True)[: model.core.local_dofs].copy()))
