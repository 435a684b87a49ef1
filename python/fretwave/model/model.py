"""The mechanical model: linear terms and contacts, distributed over the ranks of a communicator."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from .. import _core
from ..arrays import Array
from ..errors import InputError
from ..given import array_of, one_a_dof, whole
from ..kinds import of_their_kinds
from ..mpi import guard as parallel
from ..mpi.destroyable import Destroyable, Owned, destroyed
from ..mpi.gather import on_all_ranks
from ..texts import shortened
from ..units import SI, UnitSystem, unit_system
from .checks import check_inertia, checked_csr
from .contact import Contact, contact_list
from .omitted import OmittedModes
from .pair_owners import Maps, first_dofs, maps_of, pairs_in_equal_shares, pairs_with_dofs
from .rest import Rest
from .sectors import Given, Term, by_sector, check_wave, real_csr
from .unchanged import Taken
from .wheel_matrix import WheelMatrix

if MPI.COMM_WORLD.size > 1:
    parallel.install()  # in scripts too: one rank's exception ends all ranks, with one message


def _tangents(contact: Contact) -> int:
    """Components beside the normal one."""
    return contact.components - (contact.info.normal is not None)


class Model(Destroyable):
    """M x'' + C x' + K x + sum B^T f(B x, B x') = 0. Collective.

    Parameters
    ----------
    M, K, C : (n_dof, n_dof) or dict
        SciPy sparse or dense matrices, the same on every rank, or distributed petsc4py matrices of one row layout.
        In one consistent system of units. Of one sector of a wheel {0: K_0, 1: K_1, -1: K_1.T}: K_k acts on the dofs of
        the sector k places ahead; `fretwave.Sector` makes them.
    contacts : sequence of Contact
    comm : mpi4py communicator, optional
        Default: of the petsc4py matrices, or COMM_WORLD.
    sectors : int
        Number of sectors of the wheel that matrices given as dict belong to.
    nodal_diameter : int
        Of the wave, in the convention of `fretwave.cyclic.sector`: x_{j+1}(t) = x_j(t - theta / omega) with
        theta = 2 pi nodal_diameter / sectors.
    unit : int
        Ranks take whole groups of this many dofs of matrices given whole: a wheel is cut between its sectors.
    units : str or UnitSystem
        The system that all numbers are in, which labels follow (`fretwave.units`).
    omitted : OmittedModes, optional
        Of matrices that a reduction has made (`Reduction.omitted`): what it has left out, for estimates of errors.
    """

    @of_their_kinds
    def __init__(
        self,
        M: Term,
        K: Term,
        C: Term | None = None,
        contacts: Sequence[Contact] = (),
        comm: MPI.Comm | None = None,
        sectors: int = 1,
        nodal_diameter: int = 0,
        unit: int = 1,
        units: str | UnitSystem = SI,
        omitted: OmittedModes | None = None,
    ) -> None:
        sectors, nodal_diameter = check_wave(sectors, nodal_diameter)
        self.units = unit_system(units) if isinstance(units, str) else units
        self.omitted = omitted
        terms = [(A, order, k) for order, given in enumerate((K, C, M)) for k, A in by_sector(given).items()]
        first = terms[0][0]
        if comm is None:
            comm = first.getComm().tompi4py() if isinstance(first, PETSc.Mat) else MPI.COMM_WORLD
        self.comm, self.sectors, self.nodal_diameter, self._unit = comm, sectors, nodal_diameter, _unit_of(unit)
        self._own: list[PETSc.Mat] = [self._matrix(A, "KCM"[order], k) for A, order, k in terms]
        self._places = [(order, k) for _, order, k in terms]
        given = contact_list(contacts)
        self.n_dof: int = self._matrices[0].getSize()[1]
        self._pairs: list[npt.NDArray[np.intp]] = []
        self._laws: list[Any] = []
        #: The static state that the laws have taken as theirs last.
        self.at_rest: Rest | None = None
        maps = [maps_of(contact, self.n_dof) for contact in given]
        groups = [self._group(*one) for one in zip(given, maps, self._own_pairs(given, maps))]
        self._taken = [Taken(contact) for contact in given]
        theta = 2 * np.pi * nodal_diameter / sectors
        self._core: _core.Model | None = _core.Model(
            [(A, *term[1:]) for A, term in zip(self._matrices, terms)], groups, theta, unit if unit > 1 else 0
        )

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """As they were given; others take another model."""
        return tuple(taken.contact for taken in self._taken)

    def check_unchanged(self) -> None:
        """Its contacts are what they were when it was made.

        Raises
        ------
        InputError
            A parameter, a law or B is another now, which the model does not follow.
        """
        for taken in self._taken:
            taken.check()

    @property
    def core(self) -> _core.Model:
        """The compiled model."""
        if self._core is None:
            raise destroyed("the model")
        return self._core

    @property
    def _matrices(self) -> list[PETSc.Mat]:
        if not self._own:  # PETSc would end the process
            raise destroyed("the model")
        return self._own

    @property
    def _terms(self) -> list[tuple[PETSc.Mat, int, int]]:
        return [(A, order, k) for A, (order, k) in zip(self._matrices, self._places)]

    def _matrix(self, A: Given, letter: str, ahead: int = 0) -> PETSc.Mat:
        if isinstance(A, PETSc.Mat):
            return A
        A = A if isinstance(A, WheelMatrix) else checked_csr(A, letter)
        n, columns = A.shape
        if n != columns:
            raise InputError(
                "a matrix of the model is not square", None, f"({n}, {columns})", "n x n", "give a square matrix"
            )
        if letter == "M" and not ahead and not isinstance(A, WheelMatrix):
            check_inertia(A)
        begin, end = self._rows(n)
        local = A.rows(begin, end) if isinstance(A, WheelMatrix) else A[begin:end]
        size = (end - begin, n)
        mat = PETSc.Mat().createAIJ((size, size), csr=(local.indptr, local.indices, local.data), comm=self.comm)
        mat.assemble()
        return mat

    def _rows(self, n: int) -> tuple[int, int]:
        """PETSc's own split of n rows, in whole units."""
        size, rank, units = self.comm.size, self.comm.rank, n // self._unit
        local = [self._unit * (units // size + (r < units % size)) for r in range(size)]
        return sum(local[:rank]), sum(local[: rank + 1])

    def _own_pairs(self, given: Sequence[Contact], maps: Sequence[Maps]) -> list[npt.NDArray[np.intp]]:
        first = [first_dofs(of_one, contact.components) for contact, of_one in zip(given, maps)]
        if self._unit > 1:
            return pairs_with_dofs(first, *self.ownership)
        return pairs_in_equal_shares(first, self.comm.rank, self.comm.size) if given else []

    def _group(
        self, contact: Contact, maps: Maps, pairs: npt.NDArray[np.intp]
    ) -> tuple[str, list[tuple[PETSc.Mat, int]], Any, list[int]]:
        d = contact.components
        self._pairs.append(pairs)
        rows = (pairs[:, None] * d + np.arange(d)).ravel()
        parts = [(self._rows_of(B, rows), k) for k, B in maps.items()]
        self._laws.append(contact.core_law(pairs, maps[0].shape[0] // d))
        return contact.name, parts, self._laws[-1], pairs.tolist()

    def _rows_of(self, B: sp.csr_matrix, rows: npt.NDArray[np.intp]) -> PETSc.Mat:
        begin, end = self._matrices[0].getOwnershipRange()
        local = B[rows] if len(rows) else B[:0]
        size = ((local.shape[0], PETSc.DETERMINE), (end - begin, self.n_dof))
        mat = PETSc.Mat().createAIJ(size, csr=(local.indptr, local.indices, local.data), comm=self.comm)
        mat.assemble()
        return mat

    @property
    def entries(self) -> float:
        """Entries of the fullest matrix. Collective."""
        return max(float(A.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]) for A in self._matrices)

    @property
    def has_stiffness(self) -> bool:
        """The own stiffness has an entry other than 0. Collective."""
        return any(A.norm(PETSc.NormType.INFINITY) > 0 for A, order, _ in self._terms if order == 0)

    @property
    def odd(self) -> bool:
        """All laws are odd: without preload, even harmonics may be left out. Collective."""
        return bool(self.core.odd)

    def distribute(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """This rank's rows of an array given whole on every rank."""
        begin, end = self._matrices[0].getOwnershipRange()
        return values[begin:end]

    def vector(self, values: npt.ArrayLike) -> PETSc.Vec:
        """A distributed vector from an array (n_dof,) given whole on every rank. Collective.

        Raises
        ------
        InputError
            They are no real numbers, or not one a dof.
        """
        return PETSc.Vec().createWithArray(np.array(self.distribute(self.numbers(values))), comm=self.comm)

    def inertia(self, x: npt.ArrayLike) -> Array:
        """M x (n_dof,) of a displacement given whole, on every rank. Collective.

        Raises
        ------
        InputError
            As of `vector`.
        """
        whole: Array = on_all_ranks(self.comm, self._product(self._mass, self.distribute(self.numbers(x))))
        return whole

    def numbers(self, values: npt.ArrayLike) -> Array:
        """An array (n_dof,) as finite real numbers.

        Raises
        ------
        InputError
            They are none, or not one a dof.
        """
        return one_a_dof(values, self.n_dof)

    def local_inertia(self, q: npt.NDArray[Any]) -> npt.NDArray[np.complex128]:
        """This rank's part of M q, from its part of q. Collective."""
        return self._product(self._mass, q.real) + 1j * self._product(self._mass, q.imag)

    @property
    def _mass(self) -> PETSc.Mat:
        return next(A for A, order, k in self._terms if (order, k) == (2, 0))

    def _product(self, A: PETSc.Mat, local: Array) -> Array:
        """This rank's part of A x, from its part of x. Collective."""
        x = PETSc.Vec().createWithArray(np.ascontiguousarray(local, dtype=float), comm=self.comm)
        y = x.duplicate()
        A.mult(x, y)
        product: Array = y.getArray(readonly=True).copy()
        x.destroy()
        y.destroy()
        return product

    @property
    def ownership(self) -> tuple[int, int]:
        """First of this rank's dofs, and the first of the next one's."""
        begin, end = self._matrices[0].getOwnershipRange()
        return int(begin), int(end)

    @contextmanager
    def vectors(self, *values: Array) -> Iterator[list[PETSc.Vec]]:
        """`vector` of each array, for a `with` block that they do not outlive. Collective."""
        with Owned() as own:
            yield [own(self.vector(one)) for one in values]

    def gather_pairs(self, which: int, local: Array) -> Array | None:
        """Samples (.., n_pairs) of one contact in the order of B, on rank 0. Collective."""
        parts = self.comm.gather((self._pairs[which], local))
        if parts is None:
            return None
        whole = np.zeros((*local.shape[:-1], sum(len(pairs) for pairs, _ in parts)), local.dtype)
        for pairs, values in parts:
            whole[..., pairs] = values
        return whole

    def pairs_of(self, which: int) -> npt.NDArray[np.intp]:
        """Pairs of one contact on this rank, as numbers in the order of B."""
        return self._pairs[which]

    def share_pairs(self, which: int, local: Array) -> Array:
        """`gather_pairs`, on every rank. Collective."""
        whole: Array = self.comm.bcast(self.gather_pairs(which, local))
        return whole

    def take_no_numbers(self) -> list[str]:
        """Of each contact where its law, one in Python, gave no number on this rank since this was asked last."""
        return [law.in_python.take_no_number() if law.in_python is not None else "" for law in self._laws]

    def without_numbers(self) -> dict[str, str]:
        """The same of all ranks, of contacts whose law did. Collective."""
        of_ranks = zip(*self.comm.allgather(self.take_no_numbers()))
        found = {contact.name: next(filter(None, told), "") for contact, told in zip(self.contacts, of_ranks)}
        return {name: told for name, told in found.items() if told}

    def settle(self, rest: Rest) -> None:
        """The laws take a static state as theirs: which pairs are closed, and where the sliders stand. Collective.

        As every static state that is solved does by itself. Linear modes are those about it, and problems that are
        made without a state of their own move about it.

        Raises
        ------
        InputError
            The sliders are not those of this model's contacts.
        """
        for k, (contact, law) in enumerate(zip(self.contacts, self._laws)):
            u = np.sum([real_csr(B) @ rest.displacement for B in by_sector(contact.B).values()], axis=0)
            mine = u.reshape(-1, contact.components)[self._pairs[k]]
            law.rest(mine.T.ravel().tolist())
            if rest.sliders is not None and contact.info.memory:  # also where this rank has no pair of it
                law.place(self.local_sliders(rest.sliders)[k])
        self.at_rest = rest

    def closed_at_rest(self) -> list[npt.NDArray[np.bool_]]:
        """Of each contact which pairs are closed at rest, (n_pairs,) bool. Collective.

        All of a law without a normal direction.
        """
        found = []
        for k, (contact, law, pairs) in enumerate(zip(self.contacts, self._laws, self._pairs)):
            normal = contact.info.normal
            closed = [normal is None or law.stuck_stiffness(normal, pair) > 0 for pair in range(len(pairs))]
            found.append(self.share_pairs(k, np.array(closed, dtype=float)) > 0)
        return found

    def sliders(self) -> dict[str, Array]:
        """Where the sliders of each contact with a memory stand at rest [length], (n_pairs, n_tangents). Collective."""
        found = {}
        for k, (contact, law) in enumerate(zip(self.contacts, self._laws)):
            if contact.info.memory:
                local = np.array(law.sliders).reshape(_tangents(contact), len(self._pairs[k]))
                found[contact.name] = self.share_pairs(k, local).T.copy()
        return found

    def local_sliders(self, sliders: Mapping[str, Array]) -> list[list[float]]:
        """Those of this rank's pairs, contact by contact, as the core takes them."""
        named = {contact.name: contact for contact in self.contacts if contact.info.memory}
        if not isinstance(sliders, Mapping) or set(sliders) != set(named):
            fix = "give (n_pairs, n_tangents) of each"
            raise InputError("sliders at rest are of other contacts", None, repr(sliders), list(named), fix)
        out: list[list[float]] = []
        for k, contact in enumerate(self.contacts):
            if contact.name not in named:
                out.append([])
                continue
            pairs = np.shape(by_sector(contact.B)[0])[0] // contact.components
            given, wanted = array_of(sliders[contact.name]), (pairs, _tangents(contact))
            if given.shape != wanted or given.dtype.kind not in "biuf" or not np.isfinite(given).all():
                where = f"contact '{contact.name}'"
                raise InputError(
                    "sliders at rest do not fit", where, given.shape, f"{wanted}, finite", "one row a pair"
                )
            out.append(given[self._pairs[k]].T.astype(float).ravel().tolist())
        return out

    def __repr__(self) -> str:
        wave = f", wave of {self.nodal_diameter} nodal diameters on {self.sectors} sectors" if self.sectors > 1 else ""
        ranks = f", {self.comm.size} ranks" if self.comm.size > 1 else ""
        return f"Model({self.n_dof} dofs, contacts {[contact.name for contact in self.contacts]}{wave}{ranks})"

    def __reduce__(self) -> tuple[Any, ...]:
        """Of one rank, with its state at rest: what is made of it, in another process too, is a model on one rank."""
        if self.comm.size > 1:
            what, fix = "a model on several ranks cannot be pickled", "make it again in its place, or on MPI.COMM_SELF"
            raise InputError(what, repr(self), f"{self.comm.size} ranks", "1", fix)
        self.check_unchanged()
        K, C, M = ({k: _csr(A) for A, own, k in self._terms if own == order} for order in range(3))
        wave = {"sectors": self.sectors, "nodal_diameter": self.nodal_diameter, "unit": self._unit}
        own = {"contacts": self.contacts, "units": self.units, "omitted": self.omitted}
        return _model_again, ({"M": M, "K": K, "C": C or None, **wave, **own}, self.at_rest)

    def destroy(self) -> None:
        """Free the matrices. Collective."""
        self._core = None
        for mat in self._own:
            mat.destroy()
        self._own = []


def _unit_of(given: object) -> int:
    """Dofs that stay together on a rank."""
    unit = whole(given)
    if unit is None or not 1 <= unit < 2**31:
        what, fix = "ranks take no such groups of dofs", "give the number of dofs of a sector, or leave it out"
        raise InputError(what, "Model(unit=...)", shortened(repr(given), 60), "a whole number from 1 up", fix)
    return unit


def _csr(A: PETSc.Mat) -> sp.csr_matrix:
    """Of one rank."""
    rows, columns, values = A.getValuesCSR()
    return sp.csr_matrix((values, columns, rows), shape=A.getSize())


def _model_again(given: dict[str, Any], at_rest: Rest | None) -> Model:
    """What was pickled."""
    model = Model(**given, comm=MPI.COMM_SELF)
    if at_rest is not None:
        model.settle(at_rest)
    return model
