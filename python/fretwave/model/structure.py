"""The structure: matrices, names of dofs, contact pairs, loads and places, of a component, a sector or a whole wheel.

A builder returns it, a model file holds it, a case takes it up, a script makes it from matrices. Its methods leave it
as it is and return another: a sector `tied` to its neighbours, the wheel `around`, that on a reduction's coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Optional

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array, Indices
from ..errors import InputError
from ..given import numbers, place, whole
from ..units import SI, UnitSystem, unit_system
from .consistency import complaint_of, no_such_dof
from .omitted import UNKNOWN, OmittedModes
from .pairs import Pairs
from .sectors import Parts, Sparse, Term, by_sector, check_balanced, check_number, combine, is_by_sector, real_csr, ties
from .wheel_matrix import Matrix, WheelMatrix, as_matrix, entries_of

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..cyclic.reduction import SectorReduction
    from .contact import Contact
    from .model import Model
    from .reduction import Reduction


#: The part of K that a mistuning varies unless it names another: all that the sector's own elements put into it.
WHOLE = "sector"
#: The part K2 of K + Omega^2 K2, the stiffness of a turning structure [mass].
SPIN = "spin"


@dataclass
class Structure:
    """M, K and C with names, contact pairs and loads; what the function ``build(**options)`` of a builder returns.

    Attributes
    ----------
    M, K, C : (n_dof, n_dof) sparse or dense [mass], [force/length], [force s/length]
        Without contact; C may be None. Of a sector tied to its neighbours {k: (n_dof, n_dof)}, on the dofs of the
        sector k places ahead; of a whole wheel `WheelMatrix`, of which each rank makes its own rows (`own` makes all).
    dofs : dict
        Dof numbers by the names that the case file may use (observation dofs); kept by a reduction.
    pairs : dict
        Contact pairs by the names that ``[[contact]]`` takes up.
    loads : dict
        Static loads (n_dof,) [force] by the names that ``[preload]`` takes up.
    coordinates : (n_nodes, 3), optional
        Nodes [length], for pictures and resultants.
    displacements : (n_nodes, 3), optional
        Dof of each node along x, y and z, -1 where it is held; without it 3 * node + axis.
    expansion : (n_unreduced, n_dof), optional
        Of a model that the builder has reduced: dofs of the nodes from the model's own, with which a picture begins.
        `displacements` then number its rows, and the faces of a sector correspond as they are.
    hexahedra : (n_cells, 8, 20 or 27), optional
        Nodes of the cells in VTK's order, for pictures.
    cells : dict
        Further cells of other kinds, by their names (`fretwave.model.cells`), in VTK's order.
    sectors : int
        The model is one sector of a wheel of this many, or with `whole` all of them, one after the other; 0: no wheel.
    low, high : (n_face,), optional
        Matching dofs of a sector's two faces (`fretwave.match_faces` finds nodes that match).
    axis : {"x", "y", "z"}, optional
        Dofs of the faces are triples of Cartesian components, and the wheel lies about this axis.
    parts : dict
        Shares of K (n_dof, n_dof) by the names that a mistuning may vary: a sector's K grows by its deviation times
        the share. A blade's own stiffness is what the elements of the blade put into K. Of a tied sector they are on
        the dofs of the uncut one, and "sector" is all of its K.
    names : sequence of str, optional
        Of all dofs, in the order of the matrices, numbers without it; those of `dofs` go before them.
    stiffness_damping, mass_damping : float
        Shares of K [s] and M [1/s] that are added to C.
    resultants : dict, optional
        Sum (3,) along x, y, z of the loads [force], where they are no longer on the dofs of nodes.
    labels : (n_dof, 2), optional
        Node number and direction (1 to 6) of each dof in the mesh's own numbers.
    node_numbers : (n_nodes,), optional
        Of `coordinates`.
    ties : {k: (n_full, n_dof)}
        Of a tied sector: dofs with both faces, x_full = sum_k ties[k] x_{j+k}.
    cut : Structure, optional
        Of a tied sector: what it was before, both faces free.
    whole : bool
        All sectors of a wheel.
    deviations : (sectors,), optional
        Relative stiffness deviations of a whole wheel's sectors; None for a tuned one.
    units : str, optional
        Name of the system of units that all numbers are in (`fretwave.units`); without it SI.
    omitted : OmittedModes, optional
        Of a reduced structure: what the reduction has left out.
    """

    M: Term
    K: Term
    C: Optional[Term] = None
    dofs: Mapping[str, int] = field(default_factory=dict)
    pairs: Mapping[str, Pairs] = field(default_factory=dict)
    loads: Mapping[str, Array] = field(default_factory=dict)
    coordinates: Optional[Array] = None
    displacements: Optional[Indices] = None
    expansion: Optional[Sparse] = None
    hexahedra: Optional[Indices] = None
    cells: Mapping[str, Indices] = field(default_factory=dict)
    sectors: int = 0
    low: Optional[Indices] = None
    high: Optional[Indices] = None
    axis: Optional[str] = None
    parts: Mapping[str, Sparse] = field(default_factory=dict)
    names: Optional[Sequence[str]] = None
    stiffness_damping: float = 0.0
    mass_damping: float = 0.0
    resultants: Optional[Mapping[str, Array]] = None
    labels: Optional[npt.NDArray[np.int64]] = None
    node_numbers: Optional[npt.NDArray[np.int64]] = None
    ties: Parts = field(default_factory=dict)
    cut: Optional[Structure] = None
    whole: bool = False
    deviations: Optional[Array] = None
    units: Optional[str] = None
    omitted: Optional[OmittedModes] = None

    def __post_init__(self) -> None:
        number = whole(self.sectors)  # NumPy's short ones would overflow in numbers of the wheel's dofs
        self.sectors = self.sectors if number is None else number

    def __repr__(self) -> str:
        kind = "all" if self.whole else "one"
        wheel = f", {kind} of {self.sectors} sectors" if self.sectors else ""
        return f"Structure({self.n_dof} dofs, pairs {list(self.pairs)}{wheel})"

    @property
    def n_dof(self) -> int:
        """Number of dofs; where a case's mass matrix could not be read, of their names."""
        return len(self.names or ()) if self.M is None else int(np.shape(by_sector(self.M)[0])[0])

    @property
    def unit(self) -> int:
        """Dofs of a sector, where this is a whole wheel."""
        return self.n_dof // self.sectors if self.whole else self.n_dof

    @property
    def unit_system(self) -> UnitSystem:
        """The system that all numbers are in."""
        return unit_system(self.units or SI.name)

    @property
    def dof_names(self) -> list[str]:
        """Names of all dofs."""
        names = list(map(str, range(self.n_dof))) if self.names is None else list(self.names)
        for name, number in self.dofs.items():
            names[number] = name
        return names

    def dof(self, name: str, sector: int = 0) -> int:
        """Number of a dof; on a whole wheel that of a sector's.

        Raises
        ------
        InputError
            There is none of this name.
        """
        wanted, known = f"{name}@{sector}" if self.whole else name, self.dof_names
        if wanted in self.dofs:  # one of several names of a dof
            return self.dofs[wanted]
        if wanted not in known:
            raise no_such_dof(wanted, known)
        return known.index(wanted)

    def places(self, name: str) -> list[int]:
        """Numbers of a dof in all sectors of a whole wheel; of a structure or of one sector that of `dof` alone."""
        first = self.dof(name)
        return [first + j * self.unit for j in range(self.sectors)] if self.whole else [first]

    @property
    def kept(self) -> Indices:
        """Dofs that a reduction keeps: those with a name in `dofs`, and those of the pairs."""
        touched = [pairs.touched for pairs in self.pairs.values()]
        return np.asarray(np.unique(np.concatenate([list(self.dofs.values()), *touched])), dtype=np.intp)

    def own(self, letter: str) -> Sparse | None:
        """M, K or C on the own sector's dofs; None for a C that there is not."""
        given = self.matrix(letter)
        return None if given is None else entries_of(given)

    def matrix(self, letter: str) -> Matrix | None:
        """`own`, of a whole wheel without making its entries."""
        given = getattr(self, letter)
        return None if given is None else as_matrix(by_sector(given)[0])

    def by_sector(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Values (N unit, ...) of all dofs of a whole wheel as (N, unit, ...)."""
        return values.reshape(self.sectors, self.unit, *values.shape[1:])

    def resultant(self, names: Sequence[str]) -> Array | None:
        """Sum (3,) of loads along x, y, z [force]; None where it is not known which dof moves along which."""
        known = self._totals()
        return np.sum([known[name] for name in names], axis=0) if names and set(names) <= set(known) else None

    def _totals(self) -> Mapping[str, Array]:
        """Sum (3,) of each load along x, y, z [force]."""
        if self.resultants is not None:
            return self.resultants
        if self.expansion is not None or self.whole or (self.displacements is None and self.n_dof % 3):
            return {}
        places = self.dofs_of_nodes
        return {name: np.append(load, 0.0)[places].sum(axis=0) for name, load in self.loads.items()}

    @property
    def dofs_of_nodes(self) -> Indices:
        """(n_nodes, 3) dof of each node along x, y, z as `displacements` numbers them, -1 where it is held."""
        if self.displacements is not None:
            return np.asarray(self.displacements)
        return np.arange(self.n_dof if self.coordinates is None else 3 * len(self.coordinates)).reshape(-1, 3)

    def sparse(self) -> Structure:
        """The same with all matrices in CSR form of float."""
        matrices: dict[str, Any] = {letter: _sparse(getattr(self, letter)) for letter in ("M", "K", "C")}
        parts = {name: real_csr(part, f"part '{name}'") for name, part in self.parts.items()}
        pairs = {name: replace(one, B=_sparse(one.B)) for name, one in self.pairs.items()}
        return replace(self, **matrices, parts=parts, pairs=pairs)

    def damped(self, dampers: Sequence[tuple[int, float]] = ()) -> Structure:
        """The same with the shares of K and M, and viscous dampers (dof, c [force s/length]) to ground, in C."""
        terms = {letter: by_sector(getattr(self, letter)) for letter in ("C", "K", "M")}
        shares = {"C": 1.0, "K": self.stiffness_damping, "M": self.mass_damping}
        total: dict[int, Matrix] = {}
        for letter in (letter for letter, share in shares.items() if share):
            for k, A in terms[letter].items():
                part = shares[letter] * as_matrix(A)
                total[k] = total[k] + part if k in total else part
        if dampers:
            places = [place("dof", dof, self.n_dof) for dof, _ in dampers]
            values = [float(numbers("damper constant", c)) for _, c in dampers]
            added = sp.csr_matrix((values, (places, places)), shape=(self.n_dof, self.n_dof))
            total[0] = total[0] + added if 0 in total else added
        omitted = None if self.omitted is None else self.omitted.damped(self.stiffness_damping, self.mass_damping)
        C = _plain(total) if total else None
        return replace(self, C=C, stiffness_damping=0.0, mass_damping=0.0, omitted=omitted)

    def tied(self) -> Structure:
        """A sector with its high face tied to the low face of the next one, and left out.

        Raises
        ------
        InputError
            It is no sector, its faces do not match, or there is no wheel of so many sectors.
        """
        if not self.sectors or self.low is None or self.high is None:
            raise InputError("a sector of a wheel has no faces", None, None, "sectors, low and high", "give all three")
        n = self.n_dof
        T = ties(self.low, self.high, n, self.sectors, None if self.expansion is not None else self.axis)
        matrices: dict[str, Any] = {letter: tie(getattr(self, letter), T) for letter in ("M", "K", "C")}
        check_number(self.sectors)
        for letter in ("K", "M", "C"):
            check_balanced(matrices[letter], letter)
        kept = np.setdiff1d(np.arange(n), self.high)
        place, names = {int(old): new for new, old in enumerate(kept)}, self.dof_names
        return replace(
            self,
            **matrices,
            dofs={name: place[number] for name, number in self.dofs.items() if number in place},
            pairs={name: pairs.tied(T) for name, pairs in self.pairs.items()},
            loads={name: np.asarray(sum(part.T @ load for part in T.values())) for name, load in self.loads.items()},
            parts={**self.parts, WHOLE: self.own("K")},
            names=[names[k] for k in kept],
            resultants=self._totals(),
            **_NO_NODES,
            low=None,
            high=None,
            ties=T,
            cut=self,
            omitted=None if self.omitted is None else self.omitted.tied(T),
        )

    def around(
        self,
        deviations: Array | None = None,
        of: str = WHOLE,
        added: Mapping[str, Sparse] | None = None,
    ) -> Structure:
        """The whole wheel of a tied sector, sector after sector; its dofs are named ``tip@0``, ``tip@1``, ...

        Parameters
        ----------
        deviations : (sectors,), optional
            Relative deviations of a part of each sector's K: a mistuned wheel.
        of : str
            The part, a name in `parts`.
        added : {"K": (N n_dof, N n_dof), ...}, optional
            Added to the wheel's matrices.
        """
        n = self._sectors()
        matrices = {letter: WheelMatrix(A, n) for letter in ("M", "K", "C") if (A := getattr(self, letter)) is not None}
        if deviations is not None:
            matrices["K"] = matrices["K"] + self.stiffness_change(deviations, of)
        for letter, A in (added or {}).items():
            matrices[letter] = matrices[letter] + A if letter in matrices else A
        return Structure(
            matrices["M"],
            matrices["K"],
            matrices.get("C"),
            pairs={name: pairs.around(n) for name, pairs in self.pairs.items()},
            loads={name: np.tile(load, n) for name, load in self.loads.items()},
            sectors=n,
            names=[f"{name}@{j}" for j in range(n) for name in self.dof_names],
            stiffness_damping=self.stiffness_damping,
            mass_damping=self.mass_damping,
            whole=True,
            omitted=None if self.omitted is None else UNKNOWN,
            deviations=deviations,
            units=self.units,
        )

    def stiffness_change(self, deviations: Array, of: str = WHOLE) -> WheelMatrix:
        """What deviations delta_j of a part of K add to the wheel's: sum_j delta_j T_j^T K_part T_j.

        T_j = sum_k T_k gives the dofs of sector j, both faces among them, from those of the sectors k places ahead: a
        part that reaches a face is shared with the next sector, in whose rows T_k^T K_part T_l has the factor
        delta_{j-k}.
        """
        n, ties, part = self._sectors(), self.onto_parts, {0: self._part(of)}
        rows = [WheelMatrix(combine({k: T}, part, ties, -1), n, np.roll(deviations, k)) for k, T in ties.items()]
        return sum(rows[1:], rows[0])

    def stiffened(self, of: str, factor: float) -> Structure:
        """The same with K grown by a factor times a part of it, in every sector alike."""
        added = tie(factor * self._part(of), self.onto_parts) or {}
        K = dict(by_sector(self.K))
        for k, A in added.items():
            K[k] = sp.csr_matrix(K[k] + A if k in K else A)
        return replace(self, K=_plain(K))

    @property
    def onto_parts(self) -> Parts:
        """The dofs of `parts` from those that ties leave; the identity without any."""
        return self.ties or {0: sp.csr_matrix(sp.identity(self.n_dof))}

    def _part(self, of: str) -> Sparse:
        if of not in self.parts:
            raise InputError("there is no such part of the stiffness", None, of, ", ".join(self.parts), "name a part")
        return real_csr(self.parts[of])

    def reduced(self, reduction: Reduction | SectorReduction) -> Structure:
        """On the coordinates of a reduction of it, whose faces (of a sector) are free again. Collective.

        Raises
        ------
        InputError
            The reduction did not keep a dof of the pairs.
        """
        unit = reduction.expand(np.eye(reduction.size)) if self.parts else None
        parts = {} if unit is None else {n: sp.csr_matrix(reduction.project(A @ unit)) for n, A in self.parts.items()}
        M, K, C = (None if A is None else sp.csr_matrix(A) for A in (reduction.M, reduction.K, reduction.C))
        return replace(
            self,
            M=M,
            K=K,
            C=C,
            dofs={name: reduction.places[dof] for name, dof in self.dofs.items() if dof in reduction.places},
            pairs={name: pairs.mapped(reduction.rows) for name, pairs in self.pairs.items()},
            loads={name: reduction.project(load) for name, load in self.loads.items()},
            resultants=self._totals(),
            parts=parts,
            names=reduction.names(self.dof_names),
            omitted=reduction.omitted,
            **_NO_NODES,
            **reduction.faces(),
            axis=None,  # reduced faces correspond as they are
        )

    def model(self, contacts: Sequence[Contact] = (), comm: MPI.Comm | None = None, nodal_diameter: int = 0) -> Model:
        """The equations, with contacts on the structure's dofs; of a tied sector in a wave. Collective.

        Parameters
        ----------
        contacts : sequence of Contact
            Such as ``fw.Contact("coulomb_3d", structure.pairs["root"], {"friction_coefficient": 0.3})``.
        nodal_diameter : int
            Of the wave, as `fretwave.Sector.model` takes it.

        Raises
        ------
        InputError
            A sector with free faces.
        """
        from .model import Model

        if self.low is not None and not self.whole:
            fix = "take the model of `structure.tied()`, or of `structure.tied().around()`"
            raise InputError("the sector is not tied to its neighbours", repr(self), None, "a tied sector", fix)
        damped = self.damped()
        given, units, omitted = (self.M, self.K, damped.C, contacts, comm), self.unit_system, damped.omitted
        if self.whole or not self.sectors:
            return Model(*given, unit=self.unit if self.whole else 1, units=units, omitted=omitted)
        return Model(*given, self.sectors, nodal_diameter, units=units, omitted=omitted)

    def complaint(self) -> str | None:
        """What is inconsistent in a structure as a builder gives it, None when nothing is."""
        return complaint_of(self)

    def _sectors(self) -> int:
        if not self.sectors or self.whole:
            raise InputError("the structure is no sector of a wheel", repr(self), None, "a tied sector", "give sectors")
        return self.sectors


#: What belongs to nodes, and is left behind where dofs are no longer theirs.
_NO_NODES: dict[str, Any] = dict.fromkeys(
    ("coordinates", "displacements", "expansion", "hexahedra", "labels", "node_numbers")
) | {"cells": {}}


def tie(A: Term | None, T: Parts) -> dict[int, Sparse] | None:
    """A matrix of a sector on the dofs that its ties leave."""
    return None if A is None else combine(T, {0: real_csr(A)}, T, -1)


def _sparse(given: Term | None) -> Term | None:
    """In CSR form of float, by sector where it was."""
    if given is None:
        return None
    return {k: real_csr(A) for k, A in given.items()} if is_by_sector(given) else as_matrix(given)


def _plain(terms: Mapping[int, Matrix]) -> Term:
    """A matrix alone where no other sector is reached."""
    return terms[0] if list(terms) == [0] else terms
