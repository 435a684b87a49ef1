"""Small models, contact laws in Python and vector helpers that the core's tests share."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

import fretwave as fw
from fretwave.hb.harmonic_problem import HarmonicProblem

STAGES = itertools.count()


class LinearLaw(fw.PythonLaw):
    """f = k u + c v on one component."""

    odd = True

    def __init__(self, k: float, c: float) -> None:
        self.k, self.c = k, c

    def force(self, u, v):
        return self.k * u + self.c * v

    def tangent(self, u, v):
        return np.full_like(u, self.k)[:, None], np.full_like(v, self.c)[:, None]


class CubicLaw(fw.PythonLaw):
    """f = g u^3."""

    odd = True

    def __init__(self, g: float = 1.0) -> None:
        self.g = g

    def force(self, u, v):
        return self.g * u**3

    def tangent(self, u, v):
        return (3 * self.g * u**2)[:, None], np.zeros_like(v)[:, None]


class UnilateralLaw(fw.PythonLaw):
    """f = k max(u, 0): zero gap, no tension."""

    def __init__(self, k: float) -> None:
        self.k = k

    def force(self, u, v):
        return self.k * np.maximum(u, 0)

    def tangent(self, u, v):
        return (self.k * (u > 0))[:, None], np.zeros_like(v)[:, None]


class TanhLaw(fw.PythonLaw):
    """R tanh(v / eps), written again in Python; `odd` false forces whole periods."""

    odd = True

    def __init__(self, limit: float, velocity: float) -> None:
        self.limit, self.velocity = limit, velocity

    def force(self, u, v):
        return self.limit * np.tanh(v / self.velocity)

    def tangent(self, u, v):
        slope = self.limit / self.velocity * (1 - np.tanh(v / self.velocity) ** 2)
        return np.zeros_like(u)[:, None], slope[:, None]


class CoupledLaw(fw.PythonLaw):
    """f = G u + c (1 + |u|^2) v with a full, unsymmetric G: couples all three components and both arguments."""

    components = 3
    G = np.array([[3.0, 0.4, -0.7], [0.1, 2.0, 0.5], [0.9, -0.3, 1.0]])
    c = 0.2

    def force(self, u, v):
        return np.einsum("ij,tjp->tip", self.G, u) + self.c * (1 + self._square(u)) * v

    def tangent(self, u, v):
        identity = np.eye(3)[None, :, :, None]
        by_u = self.G[None, :, :, None] + 2 * self.c * v[:, :, None] * u[:, None]
        return by_u, self.c * (1 + self._square(u))[:, None] * identity

    @staticmethod
    def _square(u):
        return (u**2).sum(axis=1, keepdims=True)


@contextmanager
def options(**values):
    """PETSc's options, for a `with` block."""
    table = PETSc.Options()
    for name, value in values.items():
        table[name] = value
    try:
        yield
    finally:
        for name in values:
            table.delValue(name)


@contextmanager
def counting(event: str) -> Iterator[Callable[[], int]]:
    """How often an event of PETSc's took place, inside and so far.

    In a stage of its own: an event that an error left open is counted no more where it was opened.
    """
    PETSc.Log.begin()
    stage = PETSc.Log.Stage(f"counting_{next(STAGES)}")
    stage.push()
    try:
        yield lambda: PETSc.Log.Event(event).getPerfInfo()["count"]
    finally:
        stage.pop()


def friction(B, limit: Any = 5.0, velocity: Any = 0.05, name: str = "damper") -> fw.Contact:
    """Regularised Coulomb contact."""
    return fw.Contact("regularised_coulomb", B, {"friction_limit": limit, "regularisation_velocity": velocity}, name)


def single_dof(comm, m=1.0, k=1.0, c=None, law=None) -> fw.Model:
    """One mass on a spring to ground, with a contact law on it or without."""
    contacts = [] if law is None else [law if isinstance(law, fw.Contact) else fw.Contact(law, [[1.0]])]
    return fw.Model([[m]], [[k]], None if c is None else [[c]], contacts, comm)


def oscillator(two_dof, comm, C=None, law=None, **changes) -> fw.Model:
    """The paper's two-dof oscillator with its friction damper, or another law in its place."""
    contact = fw.Contact(law or two_dof.law, two_dof.B, {} if law else {**two_dof.parameters, **changes})
    return fw.Model(two_dof.M, two_dof.K, C, [contact], comm)


def chain(n: int, k: float = 1.0, ground: float = 0.0) -> np.ndarray:
    """Stiffness of n masses in a row between two walls."""
    return (2 * k + ground) * np.eye(n) - k * np.eye(n, k=1) - k * np.eye(n, k=-1)


def distributed(A: np.ndarray, comm, kind: str = "aij") -> PETSc.Mat:
    """The same matrix built from petsc4py in one of its types, each rank its own rows."""
    mat = PETSc.Mat().create(comm)
    mat.setSizes(A.shape)
    mat.setType(kind)
    mat.setUp()
    for row in range(*mat.getOwnershipRange()):
        for column in np.nonzero(A[row])[0]:
            mat.setValue(row, column, A[row, column])
    mat.assemble()
    return mat


def derivative(function, y: np.ndarray, dy: np.ndarray, step: float = 3e-5, order: int = 4) -> np.ndarray:
    """Of a function along dy: central differences of two lengths, extrapolated.

    `order` is 4 where the function is smooth, and 2 where its second derivative jumps at y.
    """
    one, two = ((function(y + h * dy) - function(y - h * dy)) / (2 * h) for h in (step, 2 * step))
    ratio = 2 ** (order / 2)
    return (ratio * one - two) / (ratio - 1)


def whole(vec: PETSc.Vec) -> np.ndarray:
    """All entries of a distributed vector, on every rank. Collective."""
    return np.concatenate(vec.getComm().tompi4py().allgather(vec.getArray(readonly=True).copy()))


def filled(vec: PETSc.Vec, values: np.ndarray) -> PETSc.Vec:
    """`vec` with the entries of an array that every rank has whole."""
    vec.setArray(values[slice(*vec.getOwnershipRange())])
    return vec


def unknowns(problem: HarmonicProblem, values: np.ndarray) -> PETSc.Vec:
    """y of a problem from an array that every rank has whole. Collective."""
    return filled(problem.core.unknowns(), values)


def dense(A: PETSc.Mat) -> np.ndarray:
    """A distributed matrix as an array, on every rank. Collective."""
    begin, end = A.getOwnershipRange()
    local = np.zeros((end - begin, A.getSize()[1]))
    for row in range(begin, end):
        columns, values = A.getRow(row)
        local[row - begin, columns] = values
    return np.concatenate(A.getComm().tompi4py().allgather(local))


def everywhere(problem: HarmonicProblem, value: Any) -> Any:
    """What a problem gives on rank 0 only, on every rank. Collective."""
    return problem.model.comm.bcast(value)


def mode_problem(model, orders, samples, method="CNM", dof=0, start="free", number=0, prefix="mode_"):
    """A nonlinear mode started from a linear one."""
    linear = fw.linear_modes(model, number + 1, start)[number]
    return fw.NonlinearMode(model, fw.Harmonics(orders, samples), method, dof, linear, prefix)


def solve_at(problem, amplitude: float) -> PETSc.Vec:
    """The point of a branch at this parameter, from the problem's own first guess. Collective."""
    branch = fw.Continuation(problem, problem.initial(amplitude), (0.5 * amplitude, 2 * amplitude))
    point = next(iter(branch), None)
    assert point is not None, branch.reason
    return point.y


def states(problem, start: float, stop, report_at, **steps) -> list[dict[str, float]]:
    """States at the reported parameters of a branch. Collective."""
    branch = fw.Continuation(problem, problem.initial(start), stop, fw.StepControl(**steps), report_at)
    found = [problem.state(p.y) for p in branch if p.event == "report"]
    assert branch.converged, branch.reason
    return found


def block_on_pads(stiffness, loads=(1.0,), friction=0.5):
    """Two masses in three dimensions, the second one pressed onto pads that share this stiffness."""
    near = np.array([[2.0, 0.5, 0.2], [0.5, 1.5, 0.3], [0.2, 0.3, 1.2]])
    own = np.array([[3.0, 0.6, 0.3], [0.6, 2.0, 0.4], [0.3, 0.4, 1.0]])
    each = stiffness / len(loads)
    given = {"normal_stiffness": each, "tangential_stiffness": 0.8 * each}
    given |= {"friction_coefficient": friction, "normal_load": np.array(loads)}
    pads = fw.Contact("coulomb_3d", np.vstack([np.eye(6)[3:]] * len(loads)), given)
    return fw.Model(np.eye(6), np.block([[own + near, -near], [-near, near]]), None, [pads], MPI.COMM_SELF)
