"""The nonlinear mode as a problem: frequency and damping over the modal amplitude."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from .. import _core
from ..arrays import Array
from ..errors import InputError
from ..kinds import of_their_kinds
from ..model.model import Model
from ..model.modes import LinearMode
from ..model.rest import Rest
from .harmonic_problem import HarmonicProblem, check_mode
from .harmonics import Harmonics
from .observed import Observed, named, row_of
from .states import ModalState


class NonlinearMode(HarmonicProblem):
    """A nonlinear mode, frequency and damping over the modal amplitude. Collective.

    Parameters
    ----------
    method : {"CNM", "EPMC"}
        Complex nonlinear mode (Laxalde et al. 2008), or extended periodic motion concept (Krack 2015).
    dof : int, (n_dof,), or LinearMode
        The fundamental coefficient of this dof is (a, 0); or that of a row w . x of displacements, or of a linear
        mode's coordinate phi^T M x (of unit modal mass).
    start : LinearMode
        Where the branch begins; scales the unknowns.
    prefix : str
        Of the PETSc options.
    avoid : (n_dof,) complex, optional
        On a tuned wheel, where modes come in pairs and the equations lose rank at small amplitude: the other mode of
        the pair, for a travelling wave the conjugate of the start's shape. The fundamental's component on it is kept
        at zero by a force that comes out as zero (`unfolding`).
    rest : Rest, optional
        The static state that the motion is about (`fretwave.static_preload`), its own whatever other problems of the
        model are about; without it that of the model (`Model.settle`), and no static load.
    """

    core: _core.NonlinearMode

    @of_their_kinds
    def __init__(
        self,
        model: Model,
        harmonics: Harmonics,
        method: str = "CNM",
        dof: Observed = 0,
        start: LinearMode | None = None,
        prefix: str = "mode_",
        avoid: npt.NDArray[np.complex128] | None = None,
        rest: Rest | None = None,
    ) -> None:
        if method not in ("CNM", "EPMC"):
            raise InputError("unknown method", None, method, "CNM or EPMC", 'use method="CNM"')
        if start is None:
            from ..model.modes import linear_modes

            start = linear_modes(model, 1)[0]
        check_mode(model, "start", start)
        self.method, self.dof, self.start = method, dof, start
        self.row = row_of(model, dof)
        known = model.core, harmonics.core, getattr(_core.Method, method), self.row, start.omega
        with model.vectors(start.shape, start.imaginary) as shape:
            core = _core.NonlinearMode(*known, *shape)
        if avoid is not None:
            with model.vectors(np.real(avoid), np.imag(avoid)) as other:
                core.unfold(*other)
        super().__init__(model, harmonics, prefix, core, rest)
        self.meaning = ModalState(method, start.omega)

    def amplitude_scale(self, y: PETSc.Vec) -> float:
        return self.state(y)["amplitude"]

    def inertia_damping(self, y: PETSc.Vec) -> float:
        return 2 * self.state(y)["beta"] if self.method == "EPMC" else 0.0  # C - 2 zeta w0 M

    def _what(self) -> str:
        return f"{self.method} from {self.start.frequency_hz:.6g} Hz, amplitude of {named(self.dof)}, "

    def initial(self, amplitude: float) -> PETSc.Vec:
        """The linear mode at this amplitude. Collective."""
        return self.core.initial(amplitude)

    def unfolding(self, y: PETSc.Vec) -> Array:
        """The force along the avoided mode (2,), dimensionless; empty without `avoid`. Collective."""
        return np.asarray(self.core.unfolding(y))
