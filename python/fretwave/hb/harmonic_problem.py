"""Harmonic balance as a problem that continuation follows: what nonlinear modes and forced responses share."""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from .. import _core
from ..arrays import Array, Indices
from ..errors import InputError
from ..kinds import of_their_kinds
from ..model.model import Model
from ..model.modes import LinearMode
from ..model.rest import Rest
from ..mpi.destroyable import Destroyable, Destroyed
from ..mpi.gather import on_rank_0
from ..post.contact_history import MOTION
from ..post.motion import complex_amplitudes
from .harmonics import Harmonics
from .observed import Observed
from .omitted import omitted_residual
from .states import Estimate, State


def check_mode(model: Model, name: str, mode: LinearMode) -> None:
    """It is one of this model."""
    if not isinstance(mode, LinearMode) or mode.shape.shape != (model.n_dof,):
        measured = f"{len(mode.shape)} dofs" if isinstance(mode, LinearMode) else type(mode).__name__
        expected, fix = f"a LinearMode of {model.n_dof} dofs", "take one of fw.linear_modes(model)"
        raise InputError("this is no linear mode of the model", name, measured, expected, fix)


class HarmonicProblem(Destroyable):
    """N equations in N + 1 unknowns y: scaled harmonic coefficients, then scalars, the continuation parameter last."""

    #: What its scalar unknowns mean; None where no table says.
    meaning: State | None = None
    #: What its amplitude is of.
    dof: Observed = 0
    core: _core.HarmonicProblem

    def __init__(
        self, model: Model, harmonics: Harmonics, prefix: str, core: _core.HarmonicProblem, rest: Rest | None = None
    ) -> None:
        model.check_unchanged()
        self.model, self.harmonics, self.prefix, self.core, self.rest = model, harmonics, prefix, core, rest
        self._error: _core.DiscretisationError | None = None
        #: What `errors` has taken [s].
        self.errors_wall_s = 0.0
        if rest is not None:
            self.preload(rest.displacement, rest.load)
            model.settle(rest)
            self.core.stand(model.local_sliders(rest.sliders or model.sliders()))

    def initial(self, parameter: float) -> PETSc.Vec:
        """A first guess at this amplitude or angular frequency. Collective."""
        raise NotImplementedError

    def preload(self, displacement: Array, load: Array) -> None:
        """Dynamics about a static state (n_dof,) under the static load it balances, in place of any before. Collective.

        Harmonic 0 must be retained.
        """
        with self.model.vectors(displacement, load) as vectors:
            self.core.preload(*vectors)

    def on(self, harmonics: Harmonics) -> HarmonicProblem:
        """The same problem, with its loads and what stands at rest, on another set of harmonics. Collective."""
        other = copy.copy(self)
        other.core, other.harmonics, other._error = self.core.on(self.model.core, harmonics.core), harmonics, None
        return other

    def embedded(self, other: HarmonicProblem, v: PETSc.Vec) -> PETSc.Vec:
        """Unknowns, tangent or equations of this problem as those of `other`, the same one `on` another set.

        What is new is zero. A Vec of the caller's. Collective.
        """
        return self.core.embedded(other.core, v)

    def amplitude_scale(self, y: PETSc.Vec) -> float:
        """a of Q = a q [length]. Collective."""
        raise NotImplementedError

    def inertia_damping(self, y: PETSc.Vec) -> float:
        """g of M (s^2 - g s) [1/s]. Collective."""
        return 0.0

    def residual(self, y: PETSc.Vec, r: PETSc.Vec | None = None) -> PETSc.Vec:
        """r(y), dimensionless, N entries, in `r` where one is given. Collective."""
        r = self.core.equations() if r is None else r
        self.core.residual(y, r)
        return r

    def jacobian(self, y: PETSc.Vec, J: PETSc.Mat | None = None) -> PETSc.Mat:
        """dr/dy assembled, N x (N + 1) AIJ, in the `J` of an earlier call where one is given. Collective."""
        if J is None:
            return self.core.jacobian(y)
        self.core.fill_jacobian(y, J)
        return J

    def jacobian_product(self, y: PETSc.Vec, dy: PETSc.Vec, dr: PETSc.Vec | None = None) -> PETSc.Vec:
        """dr/dy dy, matrix-free, in `dr` where one is given. Collective."""
        r = self.core.equations() if dr is None else dr
        self.core.product(y, dy, r)
        return r

    def transposed_product(self, y: PETSc.Vec, dr: PETSc.Vec, dy: PETSc.Vec | None = None) -> PETSc.Vec:
        """(dr/dy)^T dr, matrix-free and exact, in `dy` where one is given. Collective."""
        out = self.core.unknowns() if dy is None else dy
        self.core.transposed_product(y, dr, out)
        return out

    def scalars(self, y: PETSc.Vec) -> Array:
        """Scalar unknowns, then the scaled fundamental (c, s) of `dof` and the unfolding, linear in y. Collective."""
        return np.array(self.core.scalars(y))

    def last_entry(self, y: PETSc.Vec) -> float:
        """The parameter's entry of unknowns or a tangent, on every rank. Collective."""
        local = y.getArray(readonly=True)
        return float(self.model.comm.bcast(local[-1] if len(local) else 0.0, root=self.model.comm.size - 1))

    def parameter(self, y: PETSc.Vec) -> float:
        """The continuation parameter of unknowns: amplitude [length], or omega [rad/s]. Collective."""
        return float(self.core.parameter_value(self.last_entry(y)))

    def coefficients(self, y: PETSc.Vec) -> Array | None:
        """Harmonic coefficients Q (n_dof, m) in physical units, columns `harmonics.labels`, on rank 0. Collective."""
        return on_rank_0(self.model.comm, self.local_coefficients(y))

    @of_their_kinds
    def local_coefficients(self, y: PETSc.Vec) -> Array:
        """This rank's rows of `coefficients`. Collective."""
        Q = self.core.coefficients(y)
        local = Q.getArray(readonly=True).reshape(-1, self.harmonics.block_size).copy()
        Q.destroy()
        return np.asarray(local)

    def coefficients_at(self, y: PETSc.Vec, dofs: Sequence[int] | Indices) -> Array:
        """Rows of `coefficients` of some dofs (len(dofs), m), on every rank. Collective."""
        local, first, places = self.local_coefficients(y), self.model.ownership[0], np.asarray(dofs)
        mine = (first <= places) & (places < first + len(local))
        rows = np.zeros((len(places), local.shape[1]))
        rows[mine] = local[places[mine] - first]
        self.model.comm.Allreduce(MPI.IN_PLACE, rows)
        return rows

    def diagnostics(self, y: PETSc.Vec) -> dict[str, float]:
        """Contact of this motion. Collective.

        Returns
        -------
        dict
            stick, slip, open : shares of the period, mean of all pairs; force_outside : share (2-norm) of the varying
            contact force outside the retained harmonics, no error; aliasing : relative change of the retained force
            coefficients of sampled laws on doubled samples;
            work : energy dissipated by contact in a period; unclosed : largest distance [length] of a slider from where
            it began its period, rounding unless its closure failed; slip_path : longest slip path of a pair [length].
        """
        return dict(self.core.summary(y))

    def errors(self, y: PETSc.Vec, tangent: PETSc.Vec | None) -> dict[str, float]:
        """Estimated errors at a converged point, in the units of what they are errors of. Collective.

        One Newton step on the harmonics up to 7 H / 4, 17 at the least (large models: 2 H + 1 below 4), on four times
        the samples, with what lies above those harmonics as the contact force falls there, and with the component modes
        that a reduction has left out (`OmittedModes`), read at the same amplitude or frequency: see
        `src/hb/discretisation_error.h`. Without the branch's tangent none is estimated, all are nan.

        Returns
        -------
        dict
            Modes: omega_error [rad/s], zeta_error, and lambda_error_harmonics, _samples, _solver, _reduction [1/s],
            the changes of lambda = -beta + i omega by each source. Responses: amplitude_error and the same by source
            [length]. nan where nothing is known of a source (the reduction of a wheel), and where the refined system is
            singular or does not fit the memory (`errors_left_out`); empty for a problem that has no table.
        """
        if self.meaning is None:
            return {}
        found = None if tangent is None else self.estimate(y, tangent)
        return (found or Estimate.none(self.meaning)).columns

    def estimate(self, y: PETSc.Vec, tangent: PETSc.Vec) -> Estimate | None:
        """What `errors` are made of; None where nothing is known. Collective."""
        assert self.meaning is not None
        began = time.perf_counter()
        if self._error is None:
            self._error = _core.DiscretisationError(self.core, f"{self.prefix}error_")
        left_out = omitted_residual(self, y)
        changes = self._error.at(y, tangent, left_out)
        found = None
        if changes is not None:
            z, along = self.scalars(y), self.scalars(tangent)
            found = Estimate(self.meaning, z, along, [np.array(change) for change in changes])
            if self.model.omitted is not None and not self.model.omitted.known:
                found.changes[-1].fill(np.nan)
        if left_out is not None:
            left_out.destroy()
        self.errors_wall_s += time.perf_counter() - began
        return found

    @property
    def errors_left_out(self) -> str:
        """Why `errors` estimates nothing: its factors would not fit the memory; empty if they do."""
        return "" if self._error is None else self._error.left_out

    def forget_errors(self) -> None:
        """Free what estimates them. Collective."""
        self._error = None

    def energy(self, y: PETSc.Vec) -> dict[str, float]:
        """Where the energy of a period goes [energy]. Collective.

        Of each force p the work pi sum_n n Im(q_n^H p_n) on the periodic motion, so that the harmonic equations balance
        it exactly (q_n^H times their n-th row). With s_n = n (-beta + i w) (CNM) the inertia releases
        2 pi beta w sum_n n^3 q_n^H M q_n, with s_n = i n w0 and C - 2 zeta w0 M (EPMC)
        2 pi zeta w0^2 sum_n n^2 q_n^H M q_n; C takes pi w sum_n n^2 q_n^H C q_n.

        Returns
        -------
        dict
            contact, damping : dissipated by contact and by C; modal : released by the decay; error : contact + damping
            - modal relative to modal (to stored energy where that is below 1e-12 of it).
        """
        found = dict(self.core.energy(y))
        size = max(abs(found["modal"]), 1e-12 * abs(found["stored"])) or 1.0
        return {**found, "error": (found["contact"] + found["damping"] - found["modal"]) / size}

    def contact_period(self, y: PETSc.Vec) -> list[dict[str, Array | None]]:
        """Relative displacement u, velocity v and force f of each contact over one period, on rank 0. Collective.

        Each is (n_samples, components, n_pairs).
        """
        return [{name: told[name] for name in "uvf"} for told in self.contact_history(y)]

    def contact_history(self, y: PETSc.Vec) -> list[dict[str, Array | None]]:
        """`contact_period` with what the law says of each pair and sample, on rank 0. Collective.

        (n_samples, n_pairs): status (stick 0, slip 1, open 2) and gap [length] (nan without a normal direction). Of the
        whole period, however many samples: work (n_pairs) [energy] and shares (3, n_pairs) of stick, slip and open.
        """
        return [
            {name: self.model.gather_pairs(k, samples) for name, samples in zip(MOTION, period)}
            for k, period in enumerate(self.core.contact_periods(y))
        ]

    def dof_period(self, y: PETSc.Vec, n: int = 256) -> dict[str, Array] | None:
        """Displacement x and velocity v (n, n_dof) over one period, on rank 0. Collective."""
        Q, s = self.coefficients(y), self.core.exponents(y)
        if Q is None:
            return None
        tau = 2 * np.pi * np.arange(n) / n
        x, v = np.zeros((n, len(Q))), np.zeros((n, len(Q)))
        amplitudes = complex_amplitudes(self.harmonics.labels, Q)
        for order, exponent in zip(self.harmonics.orders, s):
            wave = np.exp(1j * order * tau)[:, None] * amplitudes[order]
            x += wave.real
            v += (exponent * wave).real
        return {"x": x, "v": v}

    def state(self, y: PETSc.Vec) -> dict[str, float]:
        """What a table of the branch says of this point. Collective."""
        return {} if self.meaning is None else self.meaning(self.core.scalars(y))

    def _what(self) -> str:
        return ""

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._what()}{self.harmonics}, {self.model})"

    def destroy(self) -> None:
        """Free the solver's vectors. Collective."""
        self._error = None
        self.core = Destroyed("the problem")  # type: ignore[assignment]
