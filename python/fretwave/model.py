"""The mechanical model: linear terms and contacts, distributed over the ranks of a communicator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from . import _core, parallel
from .contact_laws import PythonLaw, laws
from .errors import InputError

Array = npt.NDArray[np.float64]

if MPI.COMM_WORLD.size > 1:
    parallel.install()  # in scripts too: one rank's exception ends all ranks, with one message


@dataclass
class Contact:
    """Contact pairs of one law.

    Parameters
    ----------
    law : str or PythonLaw
        Name of a compiled law (see `fretwave.laws`), or a law written in Python.
    B : (n_pairs * components, n_dof) sparse or dense
        Relative displacement u = B x, rows pair by pair (normal, tangent, tangent for three components).
    parameters : dict
        The law's parameters, a number or one per pair.
    """

    law: str | PythonLaw
    B: Any
    parameters: Mapping[str, Any] = field(default_factory=dict)
    name: str = "contact"

    @property
    def components(self) -> int:
        """Relative displacements per pair."""
        if isinstance(self.law, PythonLaw):
            return self.law.components
        if self.law not in laws():
            raise InputError(
                "unknown contact law", f"contact '{self.name}'", self.law, ", ".join(laws()), "choose a known law"
            )
        return laws()[self.law].components

    def core_law(self, pairs: npt.NDArray[np.intp], n_pairs: int) -> Any:
        """The compiled law with the parameters of these pairs."""
        if isinstance(self.law, PythonLaw):
            local = copy(self.law)
            local.pairs = pairs
            return _core.python_law(local, len(pairs))
        return _core.make_law(self.law, {k: v[pairs].tolist() for k, v in self._values(n_pairs).items()})

    def _values(self, n_pairs: int) -> dict[str, Array]:
        known = {p.name: p.default for p in laws()[str(self.law)].parameters}
        for name in self.parameters:
            if name not in known:
                raise InputError(
                    "unknown law parameter", f"contact '{self.name}'", name, ", ".join(known), "remove or rename it"
                )
        values = {}
        for name, default in known.items():
            value = self.parameters.get(name, default)
            if value is None or np.size(value) not in (1, n_pairs):
                raise InputError(
                    f"law parameter '{name}' is missing or of the wrong length",
                    f"contact '{self.name}'",
                    "nothing" if value is None else f"{np.size(value)} values",
                    f"1 or {n_pairs} values",
                    "give one number, or one per pair",
                )
            values[name] = np.broadcast_to(np.asarray(value, dtype=float).ravel(), (n_pairs,))
        return values


class Model:
    """M x'' + C x' + K x + sum B^T f(B x, B x') = 0. Collective.

    Parameters
    ----------
    M, K, C : (n_dof, n_dof)
        SciPy sparse or dense matrices, the same on every rank, or distributed petsc4py matrices of one row layout.
        Any consistent set of units.
    contacts : sequence of Contact
    comm : mpi4py communicator, optional
        Default: of the petsc4py matrices, or COMM_WORLD.
    """

    def __init__(self, M: Any, K: Any, C: Any = None, contacts: Sequence[Contact] = (), comm: Any = None) -> None:
        if comm is None:
            comm = K.getComm().tompi4py() if isinstance(K, PETSc.Mat) else MPI.COMM_WORLD
        self.comm = comm
        terms = [(matrix, order) for order, matrix in enumerate((K, C, M)) if matrix is not None]
        self._matrices = [self._matrix(matrix) for matrix, _ in terms]
        self.contacts = list(contacts)
        self.n_dof: int = self._matrices[0].getSize()[1]
        self._pairs: list[npt.NDArray[np.intp]] = []
        groups = [self._group(contact) for contact in self.contacts]
        self.core = _core.Model([(A, order, 0) for A, (_, order) in zip(self._matrices, terms)], groups, 0.0)

    def _matrix(self, A: Any) -> PETSc.Mat:
        if isinstance(A, PETSc.Mat):
            return A
        rows = sp.csr_matrix(A, dtype=float)
        if rows.shape[0] != rows.shape[1]:
            raise InputError(
                "a matrix of the model is not square", None, f"{rows.shape}", "n x n", "give a square matrix"
            )
        begin, end = self._rows(rows.shape[0])
        local = rows[begin:end]
        size = (end - begin, rows.shape[0])
        mat = PETSc.Mat().createAIJ((size, size), csr=(local.indptr, local.indices, local.data), comm=self.comm)
        mat.assemble()
        return mat

    def _rows(self, n: int) -> tuple[int, int]:
        """PETSc's own split of n rows."""
        size, rank = self.comm.size, self.comm.rank
        local = [n // size + (r < n % size) for r in range(size)]
        return sum(local[:rank]), sum(local[: rank + 1])

    def _group(self, contact: Contact) -> tuple[str, PETSc.Mat, Any]:
        """The contact's pairs on the rank that owns the pair's first dof."""
        B, d = sp.csr_matrix(contact.B, dtype=float), contact.components
        if B.shape[1] != self.n_dof or B.shape[0] % d:
            raise InputError(
                "B does not fit the model",
                f"contact '{contact.name}'",
                f"{B.shape}",
                f"(n_pairs * {d}, {self.n_dof})",
                "give B as u = B x",
            )
        begin, end = self._matrices[0].getOwnershipRange()
        n_pairs = B.shape[0] // d
        first = np.array(
            [B.indices[B.indptr[d * i]] if B.indptr[d * (i + 1)] > B.indptr[d * i] else 0 for i in range(n_pairs)]
        )
        pairs = np.nonzero((first >= begin) & (first < end))[0]
        self._pairs.append(pairs)
        local = B[(pairs[:, None] * d + np.arange(d)).ravel()] if len(pairs) else B[:0]
        size = ((local.shape[0], PETSc.DETERMINE), (end - begin, self.n_dof))
        mat = PETSc.Mat().createAIJ(size, csr=(local.indptr, local.indices, local.data), comm=self.comm)
        mat.assemble()
        return contact.name, mat, contact.core_law(pairs, n_pairs)

    @property
    def odd(self) -> bool:
        """All laws are odd: without preload, even harmonics may be left out. Collective."""
        return bool(self.core.odd)

    def distribute(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """This rank's rows of an array given whole on every rank."""
        begin, end = self._matrices[0].getOwnershipRange()
        return values[begin:end]

    def vector(self, values: Array) -> PETSc.Vec:
        """A distributed vector from an array (n_dof,) given whole on every rank. Collective."""
        return PETSc.Vec().createWithArray(np.array(self.distribute(np.asarray(values, dtype=float))), comm=self.comm)

    def gather_pairs(self, which: int, local: Array) -> Array | None:
        """Samples (.., n_pairs) of one contact in the order of B, on rank 0. Collective."""
        parts = self.comm.gather((self._pairs[which], local))
        if parts is None:
            return None
        whole = np.zeros((*local.shape[:-1], sum(len(pairs) for pairs, _ in parts)))
        for pairs, values in parts:
            whole[..., pairs] = values
        return whole

    def destroy(self) -> None:
        """Free the matrices. Collective."""
        self.core = None
        for mat in self._matrices:
            mat.destroy()

    def __enter__(self) -> Model:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()
