"""A mode at fixed amplitude as a function of worn depths (Laxalde et al. 2008, eq. 14 at one slow time)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from .. import _core
from ..arrays import Array
from ..errors import InputError
from ..given import not_negative, numbers
from ..hb.nonlinear_mode import NonlinearMode
from ..kinds import of_their_kinds
from ..model.law_info import Role
from ..model.laws import no_wear
from ..mpi.destroyable import Destroyable, Owned
from .continuation import Continuation
from .point import points_of
from .steppers import StageFailed
from .steps import StepControl

#: Changes of log amplitude from which a solution on another sheet is looked for, and points to reach it by.
DETOURS, DETOUR_POINTS = (1e-3, -1e-3, 1e-2, -1e-2, 3e-2, -3e-2), 40
#: Of `normal_cycle`s that a march may have: of more the lengths of steps are no numbers.
LONGEST = 1e200
#: The corrector's tolerance over that of the branch: depths add up its errors.
SHARPER = 1e-2


@dataclass
class WornState:
    """The mode at some worn depths. `y` is the owner's to destroy.

    Attributes
    ----------
    depth, load : (n_pairs,)
        Worn depth [length] and mean normal force [force] of the pairs of all wearing contacts, one after the other.
    rate : (n_pairs,)
        Growth of the depth in a cycle [length], k_w / I times the integral of |P_N| |d slider| (eq. 13).
    slip, open : (n_pairs,)
        Shares of the period.
    """

    y: PETSc.Vec
    depth: Array
    rate: Array
    load: Array
    slip: Array
    open: Array
    newton: int = 0
    linear: int = 0
    residual: float = 0.0


class WornMode(Destroyable):
    """A mode at fixed amplitude as a function of worn depths. Collective, as all methods.

    Parameters
    ----------
    problem : NonlinearMode
        With contacts that have a normal direction, whose depths it takes over.
    coefficient : float
        k_w [1/pressure].
    areas : dict
        Contact name -> nodal areas I (n_pairs,) [length^2]; contacts without an entry do not wear.

    Raises
    ------
    InputError
        There is no such contact, or it cannot wear; the coefficient is below zero, or an area no number above; the
        harmonics have no mean, which worn depth changes.
    """

    @of_their_kinds
    def __init__(self, problem: NonlinearMode, coefficient: float, areas: Mapping[str, Array]) -> None:
        self.problem, self.model, self.coefficient = problem, problem.model, not_negative("coefficient", coefficient)
        names = [contact.name for contact in self.model.contacts]
        if not isinstance(areas, Mapping):
            fix = f"give {{{names[0] if names else 'contact'!r}: [...]}}"
            raise InputError("areas are not given by contact", "areas", repr(areas), "a dict of them by name", fix)
        for name in areas:
            self._check(name, names)
        self.contacts = [k for k, name in enumerate(names) if name in areas]
        if not self.contacts:
            raise InputError("no contact wears", "areas", "none", f"areas of {', '.join(names)}", "name one that wears")
        if (lowest := problem.harmonics.orders[0]) != 0:
            what, measured = "worn depth moves the mean, which is not retained", f"lowest harmonic {lowest}"
            raise InputError(what, None, measured, "harmonic 0 retained", 'retain all harmonics (retain = "all")')
        sizes = [self.model.contacts[k].n_pairs for k in self.contacts]
        each = [numbers(f"areas['{names[k]}']", areas[names[k]], (n,), above=0.0) for k, n in zip(self.contacts, sizes)]
        self.areas = np.concatenate(each)
        self.slices = [slice(end - size, end) for size, end in zip(sizes, np.cumsum(sizes))]
        self.stiffness = self._values(Role.NORMAL_STIFFNESS)  # makes worn depth a loss of normal load
        self._newton = _core.Newton(problem.core, problem.prefix, past_kinks=False)
        rtol, atol, stol, most = self._newton.snes.getTolerances()
        self._newton.snes.setTolerances(rtol, SHARPER * atol, stol, most)
        #: Why `errors` estimates nothing, once asked.
        self.errors_left_out = ""
        self._row = problem.core.unknowns()
        self._row.set(0.0)
        self._set_last(self._row, 1.0)

    def __repr__(self) -> str:
        unit = self.problem.model.units("1/pressure")
        return f"WornMode({len(self.areas)} pairs, k_w = {self.coefficient:g} {unit}, of {self.problem})"

    def _check(self, name: str, names: list[str]) -> None:
        if name not in names:
            raise InputError("there is no such contact", None, name, ", ".join(names), "name one of these")
        contact = self.model.contacts[names.index(name)]
        if not contact.info.wears:
            raise no_wear("a contact cannot wear", f"contact '{name}'", str(contact.law))

    def _set_last(self, v: PETSc.Vec, value: float) -> None:
        local = v.getArray()
        if self.model.comm.rank == self.model.comm.size - 1:
            local[-1] = value

    def _local(self, values: Array) -> list[list[float]]:
        """Of all pairs, those on this rank, contact by contact."""
        out: list[list[float]] = [[] for _ in self.model.contacts]
        for k, part in zip(self.contacts, self.slices):
            out[k] = values[part][self.model.pairs_of(k)].tolist()
        return out

    def wear(self, depth: Array) -> None:
        """The contacts have these depths (n_pairs,) from now on."""
        self.problem.core.wear(self._local(numbers("depth", depth, self.areas.shape)))

    def measure(self, y: PETSc.Vec, depth: Array, outcome: tuple[int, int, float] = (0, 0, 0.0)) -> WornState:
        """Rates and loads of a converged motion at these depths."""
        found = self.problem.core.wearing(y)
        archard, load, slip, opened = (
            np.concatenate([self.model.share_pairs(k, np.asarray(found[k][which])) for k in self.contacts])
            for which in range(4)
        )
        return WornState(y, depth, self.coefficient / self.areas * archard, load, slip, opened, *outcome)

    def normal_cycle(self, load: Array) -> float:
        """Vibration cycles in which sliding four stick limits mu N0/kt a cycle leaves 1/e of a normal load.

        N' = -kn k_w/I N s with s = 4 mu N0/kt, in means over the loaded pairs; 1 where nothing can wear.

        Parameters
        ----------
        load : (n_pairs,) [force]
            Of the new surfaces.
        """
        loaded = load > 0
        if not loaded.any():
            return 1.0
        friction, stiffness = (
            self._values(role)[loaded] for role in (Role.FRICTION_COEFFICIENT, Role.TANGENTIAL_STIFFNESS)
        )
        slip = 4 * np.mean(friction * load[loaded] / stiffness)
        with np.errstate(over="ignore"):
            rate = self.coefficient * np.mean(self.stiffness[loaded] / self.areas[loaded]) * slip
            return float(1 / rate) if rate > 0 else 1.0

    def cycle_unit(self, load: Array, cycles: float, given: float | None = None, where: str | None = None) -> float:
        """Vibration cycles in a normalised one: as given, else `normal_cycle` of these loads.

        Raises
        ------
        InputError
            That many `cycles` of it are no number of vibrations, or too many to be marched over.
        """
        own = self.normal_cycle(load)
        unit = given or own
        vibrations = unit * cycles
        if 0 < vibrations < np.inf and (not self.coefficient or vibrations / LONGEST < own):
            return unit
        unit_of = self.problem.model.units("1/pressure")
        measured = f"k_w = {self.coefficient:g} {unit_of}, {cycles:g} cycles of {unit:g} vibrations"
        expected = f"a number of vibrations, in which the load can fall to 1/e less than {LONGEST:g} times"
        fix = "correct the wear coefficient, the cycles or cycle_unit"
        raise InputError("the wear cycles cannot be marched over", where, measured, expected, fix)

    def _values(self, role: Role) -> Array:
        """Of all wearing pairs."""
        parts = [
            np.broadcast_to(np.asarray(self.model.contacts[k].value(role), float), (part.stop - part.start,))
            for k, part in zip(self.contacts, self.slices)
        ]
        return np.concatenate(parts)

    def solve(self, depth: Array, guess: PETSc.Vec) -> WornState:
        """The mode at these depths and the amplitude of the guess, which is kept.

        Raises
        ------
        StageFailed
            Newton does not converge.
        """
        self.wear(depth)
        y = guess.copy()
        return self.measure(y, depth, self._correct(y))

    def _correct(self, y: PETSc.Vec) -> tuple[int, int, float]:
        """Newton at the amplitude of y, in place."""
        self._newton.system.close(self._row, self.log_amplitude(y))
        converged, newton, linear, residual, reason = self._newton.solve(y)
        if not converged:
            y.destroy()
            raise StageFailed(reason)
        return newton, linear, residual

    def elsewhere(self, depth: Array, guess: PETSc.Vec) -> WornState:
        """The mode at these depths on whatever sheet is near: by arclength from an amplitude above or below.

        At a fixed amplitude a sheet may end while depths grow, as a branch that folds does in amplitude.

        Raises
        ------
        StageFailed
            None of the detours comes back to the amplitude.
        """
        self.wear(depth)
        target = self.problem.parameter(guess)
        for change in DETOURS:
            y = guess.copy()
            self._set_last(y, self.log_amplitude(guess) + change)
            try:
                self._correct(y)
            except StageFailed:
                continue
            found = self._come_back(y, target, change)
            y.destroy()
            if found is not None:
                return self.measure(found, depth, self._correct(found))
        raise StageFailed("the mode ends here, and no other sheet of it was found at this amplitude")

    def _come_back(self, y: PETSc.Vec, target: float, change: float) -> PETSc.Vec | None:
        """The first point of the branch from y that lies on the target amplitude."""
        length = abs(change)
        ends = (target * float(np.exp(-2 * length)), target * float(np.exp(2 * length)))
        steps = StepControl(initial=length / 8, minimum=1e-4 * length, maximum=length, max_points=DETOUR_POINTS)
        found = None
        with Owned() as own:
            branch = own(Continuation(self.problem, y, ends, steps, [target], upwards=change < 0))
            for point in points_of(branch):
                if point.event == "report":
                    own(point.tangent)
                    found = point.y
                    break
        return found

    def log_amplitude(self, y: PETSc.Vec) -> float:
        """The parameter's entry, on every rank."""
        return self.problem.last_entry(y)

    def gap_product(self, y: PETSc.Vec, change: Array) -> PETSc.Vec:
        """dr/dw times a change of the depths (n_pairs,) at the present depths: worn depth is gap."""
        return self.problem.core.gap_product(y, self._local(change))

    def tangent(self, state: WornState, change: Array) -> PETSc.Vec:
        """dy for a change of the depths at fixed amplitude: one solve with the bordered Jacobian, zero if it fails."""
        self.wear(state.depth)
        r = self.gap_product(state.y, change)
        b, t = self.problem.core.unknowns(), self.problem.core.unknowns()
        local = b.getArray()
        local[:] = 0.0
        local[: r.getLocalSize()] = -r.getArray(readonly=True)
        r.destroy()
        self._newton.system.close(self._row, 0.0)
        t.set(0.0)
        if not self._newton.linear(state.y, b, t):
            t.set(0.0)
        b.destroy()
        return t

    def along(self, state: WornState) -> PETSc.Vec | None:
        """Unit tangent of the branch over amplitude at the state's depths; None where it has none to be found."""
        self.wear(state.depth)
        beside = _core.Newton(self.problem.core, self.problem.prefix, past_kinks=False)
        t, weighted = self.problem.core.unknowns(), self.problem.core.unknowns()
        t.set(0.0)
        beside.system.close(self._row, 0.0)
        found = beside.linear(state.y, self._row, t)
        self.problem.core.metric(state.y, weighted)
        weighted.pointwiseMult(weighted, t)
        length = float(np.sqrt(weighted.dot(t))) if found else np.nan
        weighted.destroy()
        if not 0 < length < np.inf:
            t.destroy()
            return None
        t.scale(1 / length)
        return t

    def errors(self, state: WornState, estimated: bool = True) -> dict[str, float]:
        """`HarmonicProblem.errors` of the mode at the state's depths, which count as exact; nan unless `estimated`.

        All solvers for it are new: the march is the same with it and without, and it is the same when resumed.
        """
        t = self.along(state) if estimated else None
        found = self.problem.errors(state.y, t)
        if t is not None:
            self.errors_left_out = self.problem.errors_left_out
            self.problem.forget_errors()
            t.destroy()
        return found

    def destroy(self) -> None:
        """Free the solver; the contacts are as new again."""
        self.wear(np.zeros(len(self.areas)))
        self._newton = None  # type: ignore[assignment]
        self._row.destroy()
