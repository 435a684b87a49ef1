"""Linear modes: the asymptotes of every backbone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import SupportsIndex

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from .. import _core
from ..arrays import Array
from ..errors import InputError, NothingMoves, PetscError
from ..files.memory import machine_memory, size
from ..given import positive, whole
from ..kinds import of_their_kinds
from ..mpi.gather import on_all_ranks
from ..mpi.guard import all_ranks_failed
from .checks import DENSE_LIMIT, check_mass
from .model import Model

#: Entries of a row from which a model counts as solid elements, and how many times their factors have as many (twelve
#: of L and of U each: from above, a wheel of 36 x 20,646 dofs counts 22 GB and is solved on two ranks of 24).
SOLID, FILLED = 60, 24

#: The core's words where stuck contact holds every degree of freedom.
NOTHING_LEFT = "the stuck contact leaves no degree of freedom"


@dataclass(frozen=True)
class LinearMode:
    """A linear mode, lambda = -beta + i omega.

    Attributes
    ----------
    omega, beta : float [1/s]
    shape : (n_dof,) real part of the mode shape, on every rank (unit modal mass when undamped)
    imaginary : (n_dof,)
        x(t) = Re (shape + i imaginary) e^{lambda t}. Of a travelling wave on one sector, the largest entry is real.
    """

    omega: float
    beta: float
    shape: Array
    imaginary: Array

    def __repr__(self) -> str:
        return f"LinearMode({self.frequency_hz:.6g} Hz, zeta {self.zeta:.6g}, {len(self.shape)} dofs)"

    @property
    def zeta(self) -> float:
        """Modal damping ratio beta / |lambda|."""
        return self.beta / float(np.hypot(self.beta, self.omega)) if self.omega else 0.0

    @property
    def frequency_hz(self) -> float:
        """omega / 2 pi [Hz]."""
        return self.omega / (2 * np.pi)


@of_their_kinds
def linear_modes(
    model: Model, count: int = 6, contact: str = "stuck", near: float | None = None, stable: bool = False
) -> list[LinearMode]:
    """Lowest linear modes, or those nearest to a frequency, in ascending order, by SLEPc. Collective.

    Parameters
    ----------
    contact : {"stuck", "free", "linearised"}
        Closed contact without slip; no contact force; the laws' tangents at rest (damped, with C).
    near : float [rad/s], optional
        By shift-invert there.
    stable : bool
        Refuse a structure whose stiffness is negative for some motion: that has no frequency, omega = 0 if it is found
        at all. Of a symmetric K; not looked at beside `near`.

    Raises
    ------
    FretwaveError
        Fewer converge than there are: how many, and the option that helps; or the model's factor is larger than the
        memory.
    NothingMoves
        Stuck contact leaves no degree of freedom. It is an InputError.
    InputError
        `near`, or stuck contact that is rigid, where K is not symmetric; a structure that is not `stable`.

    Notes
    -----
    Stuck and free modes below the last (nearer than the farthest) are counted by the negative pivots of K - omega^2 M
    (Sylvester), so that no copy of a double mode and no member of a family is left out.

    A stiffness that is not symmetric (circulatory forces) has modes without damping that may flutter, beta != 0.

    Of one sector: the waves of the model's nodal diameter (`fretwave.cyclic.sector` says which way they run).
    """
    if contact not in ("stuck", "free", "linearised"):
        raise InputError("unknown state of contact", None, contact, "stuck, free or linearised", 'use contact="stuck"')
    near = None if near is None else positive("near", near)
    if near is not None and contact == "linearised":
        given, expected = f"near={near}, contact={contact}", "stuck or free contact"
        raise InputError("modes near a frequency are those without damping", None, given, expected, "leave near out")
    count = _number(count)
    model.check_unchanged()
    _check_factor(model)
    try:
        found = _core.linear_modes(model.core, count, getattr(_core.ContactState, contact), near, bool(stable))
    except InputError as error:  # on all ranks
        raise (NothingMoves(*error.args) if error.what == NOTHING_LEFT else error) from None
    except PetscError as error:
        if model.comm.size > 1 and not all_ranks_failed(model.comm):
            raise  # of some ranks alone: the others wait in the solver
        raise _wrong_terms(model) or _loose_parts(error) or error from None
    shapes = [on_all_ranks(model.comm, re) + 1j * on_all_ranks(model.comm, im) for _, _, re, im in found]
    for _, _, *parts in found:
        for part in parts:
            part.destroy()
    if model.core.travelling:
        shapes = [_aligned(phi) for phi in shapes]
    elif contact != "linearised":
        shapes = [_of_unit_mass(model, _aligned(phi)) if np.any(phi.imag) else phi for phi in shapes]
    return [LinearMode(mode[0], mode[1], phi.real.copy(), phi.imag.copy()) for mode, phi in zip(found, shapes)]


#: More than the core counts.
MOST_MODES = 2**31 - 1


def _number(count: SupportsIndex) -> int:
    number = whole(count)
    if number is None or not 1 <= number <= MOST_MODES:
        expected = f"1 to {MOST_MODES}"
        raise InputError("modes are asked for by their number", "count", repr(count), expected, "give a number")
    return number


def _loose_parts(error: PetscError) -> InputError | None:
    """MUMPS' -10: beside one part's stiffness the shift below zero, in the scale of all, is rounding."""
    if "INFOG(1)=-10" not in str(error):
        return None
    return InputError(
        "the modes of loose parts cannot be told: the stiffness of one hides the mass of another",
        measured="K less a share of M is singular to 16 digits",
        expected="parts that are held, or alike in mass and stiffness",
        fix="hold each part that moves freely, and each dof without mass, by a soft spring, or leave it out",
    )


def _wrong_terms(model: Model) -> InputError | None:
    """What is wrong with mass or stiffness of which PETSc could make nothing; None if that is not seen. Collective."""
    if not model.has_stiffness:
        return InputError("the stiffness matrix is zero", "K", None, "a stiffness", "give the structure's stiffness")
    if model.n_dof > DENSE_LIMIT:
        return None
    M = sp.csr_matrix(np.column_stack([model.inertia(unit) for unit in np.eye(model.n_dof)]))
    return check_mass(M, "M", list(map(str, range(model.n_dof))))


def factor_fits(model: Model) -> bool:
    """Whether the ranks can hold a factor of the model, as linear modes take one; the same on each. Collective."""
    needed, available = _factor_memory(model)
    return needed <= available


def _factor_memory(model: Model) -> tuple[float, float]:
    """What a factor of solid elements takes, nothing of others, and what the ranks can have [bytes]. Collective."""
    entries, available = model.entries, model.comm.allreduce(machine_memory(), MPI.MIN)
    solid = entries > SOLID * model.n_dof
    return 8 * min(FILLED * entries, 2.0 * model.n_dof**2) if solid else 0.0, available


def _check_factor(model: Model) -> None:
    """Refuse a factor of solid elements that the ranks cannot hold, before it is begun. Collective."""
    needed, available = _factor_memory(model)
    if needed > available:
        raise InputError(
            "linear modes would take a factor larger than the memory",
            measured=f"about {size(needed)} for {model.n_dof:,} dofs",
            expected=f"at most {size(available)}",
            fix="take one sector, a coarser mesh or a reduction",
        )


def _of_unit_mass(model: Model, phi: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    """phi^H M phi = 1. Collective."""
    mass = sum(part @ model.inertia(part) for part in (phi.real, phi.imag))
    return np.asarray(phi / np.sqrt(mass))


def _aligned(phi: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    """The same shape with its largest entry real and positive."""
    largest = phi[np.argmax(np.abs(phi) > (1 - 1e-6) * np.abs(phi).max())]
    return np.asarray(phi * (abs(largest) / largest))
