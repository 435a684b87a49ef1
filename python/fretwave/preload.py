"""The static state under load: where the sliders start and what the dynamics move about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import _core
from .continuation import Continuation, StepControl
from .errors import NotConverged
from .model import Model
from .modes import LinearMode
from .problems import Harmonics, HarmonicProblem

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

    def __init__(self, model: Model, load: Array, reference: LinearMode, prefix: str = "static_") -> None:
        stiffness = reference.omega**2 / max(float(np.sum(reference.shape**2)), np.finfo(float).tiny)
        size = max(float(np.linalg.norm(load)) / stiffness, np.finfo(float).tiny)
        core = _core.StaticPreload(model.core, model.vector(load), size, stiffness)
        super().__init__(model, Harmonics([0], 2), prefix, core)

    def state(self, y: object) -> dict[str, float]:
        return {}


def balanced(model: Model) -> Preload:
    """Normal loads given pair by pair are balanced as they are: no displacement, the load is B^T f(0). Collective."""
    return settle(model, np.zeros(model.n_dof))


def static_preload(model: Model, load: Array, reference: LinearMode, steps: StepControl | None = None) -> Preload:
    """Static equilibrium under `load` on top of the balanced normal loads, by continuation in the load factor. Collective.

    Raises
    ------
    NotConverged
        With the load factor that was reached.
    """
    start = balanced(model)
    problem = StaticPreload(model, start.load + np.asarray(load, dtype=float), reference)
    raise NotImplementedError(problem, steps, NotConverged, Continuation)
