"""The nonlinear motion of one sector in a travelling wave as that of the whole tuned wheel."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from ..arrays import Array, Complex, Indices
from ..errors import InputError
from ..hb.nonlinear_mode import NonlinearMode
from ..kinds import of_their_kinds
from ..model.sectors import check_wave
from ..post.motion import complex_amplitudes


@of_their_kinds
def around_wheel(wheel: NonlinearMode, sector: NonlinearMode, y: PETSc.Vec, nodal_diameter: int) -> PETSc.Vec:
    """Unknowns of a tuned wheel whose sectors all move as one does, each later than the one before it. Collective.

    They solve the wheel's equations where y solves the sector's, for harmonic n of sector j moves as

        q_n,j = q_n,0 exp(-2 pi i n ND j / N)

    (`Sector.around` of a linear mode): a branch of the wheel begins there without a way of its own.

    Parameters
    ----------
    wheel, sector : NonlinearMode
        On the same harmonics; the sector's in a wave of this many nodal diameters.
    y : Vec
        The sector's unknowns.

    Returns
    -------
    Vec
        The caller's. What the wheel's problem normalises is real and positive in it, whichever sector it is of.

    Raises
    ------
    InputError
        The wheel is not made of such sectors, other harmonics are retained, or what is normalised does not move.
    """
    sectors = _sectors(wheel, sector)
    _, diameters = check_wave(sectors, nodal_diameter)
    q, orders, unit = _motion(sector, y), np.array(wheel.harmonics.orders), sector.model.n_dof

    def later(dofs: Indices) -> Array:
        """Angle by which each dof's sector is behind the first one."""
        return 2 * np.pi * (dofs // unit * diameters % sectors) / sectors

    dofs, weights = np.array(wheel.row).T
    places, fundamental = dofs.astype(int), int(np.flatnonzero(orders == 1)[0])
    normal = complex(weights @ (q[places % unit, fundamental] * np.exp(-1j * later(places))))
    if not normal:
        raise InputError("what is normalised does not move in this wave", None, 0.0, "a motion", "choose another dof")
    here = np.arange(*wheel.model.ownership)
    moved = q[here % unit] * np.exp(-1j * orders * (later(here) + np.angle(normal))[:, None]) / abs(normal)
    return _filled(wheel, sector, y, moved, abs(normal))


def _sectors(wheel: NonlinearMode, sector: NonlinearMode) -> int:
    """How many such sectors the wheel has."""
    for name, ours, theirs in (
        ("harmonics", wheel.harmonics.orders, sector.harmonics.orders),
        ("method", wheel.method, sector.method),
    ):
        if ours != theirs:
            fix = f"make both problems with the same {name}"
            raise InputError(f"wheel and sector have other {name}", None, str(theirs), str(ours), fix)
    count, rest = divmod(wheel.model.n_dof, sector.model.n_dof)
    if rest:
        measured, expected = f"{wheel.model.n_dof} dofs", f"a multiple of the sector's {sector.model.n_dof}"
        raise InputError("the wheel is not made of such sectors", None, measured, expected, "take Sector.wheel()")
    return count


def _motion(sector: NonlinearMode, y: PETSc.Vec) -> Complex:
    """q_n (n_dof, harmonics) of unit amplitude, on every rank. Collective."""
    shape = len(range(*sector.model.ownership)), sector.harmonics.block_size  # none on some ranks
    local = y.getArray(readonly=True)[: shape[0] * shape[1]].reshape(shape)
    labels = sector.harmonics.labels
    whole = np.concatenate(sector.model.comm.allgather(local))
    return np.stack([one for _, one in sorted(complex_amplitudes(labels, whole).items())], axis=1)


def _filled(wheel: NonlinearMode, sector: NonlinearMode, y: PETSc.Vec, q: Complex, normal: float) -> PETSc.Vec:
    """Unknowns of the wheel of this rank's motion (n_local, harmonics), normalised. Collective."""
    rates = sector.scalars(y)[:2] * sector.start.omega / wheel.start.omega
    out = wheel.initial(sector.parameter(y) * normal)
    parts = [[one.real] if n == 0 else [one.real, -one.imag] for n, one in zip(wheel.harmonics.orders, q.T)]
    columns = np.stack([part for both in parts for part in both], axis=1)
    values = out.getArray()
    values[: columns.size] = columns.ravel()
    if len(values) > columns.size:  # the scalars lie behind the last rank's motion
        values[-3:-1] = rates
    return out
