"""Whether the stress of a run is that of the model's stiffness: K has its own materials and elements.

Strain energy of the stress in all cells stands against u^T K u / 2 of the same motion, without contact. Elements that
bend in another way than their strain (of reduced integration, or with modes that the matrices do not have) differ in
it, and so do constants other than those of K, which `constants` tells at the surface whatever the elements are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array
from ..case.at_speed import omega_squared
from ..case.gauge_places import node_numbers, solids_of
from ..case.load import Case
from ..errors import InputError
from ..fe.internal_forces import StressPoints
from ..fe.strain import cells_around
from ..model.structure import SPIN, Structure
from ..texts import counted, display
from .constants import Constants, at_nodes, constants_of

WARNING = "warning: "
#: Share of the energy that is told: a stress off by half as much, in the mean. Elements of full integration and of the
#: points at which strain is best differ from one of both by 1e-10; selective integration (B-bar) by 0.02 to 0.14 in
#: coarse bending at a Poisson's ratio of 0.3, reduced one (C3D8R) by 0.3 and more.
ENERGY = 0.02
#: Constants and energy off by this factor are of no rough mesh: no row of the table has a true stress.
BEYOND = 3.0
#: Wrong constants at fewer nodes than this share, in cells of less than this share of the energy, are a detail.
DETAIL = 0.01
#: Energy below this share of what its terms are is rounding: of a body that moves rigidly.
ROUNDING = 1e-9
#: Entries that tell how many digits of K were printed.
LOOKED_AT = 10_000


def rounding(K: sp.csr_matrix) -> float:
    """`ROUNDING`, or a hundred units of the last digit of a matrix that was printed with fewer."""
    some = K.data[K.data != 0][:LOOKED_AT]
    for digits in range(6, 11):
        scale = 10.0 ** (digits - 1 - np.floor(np.log10(abs(some))))
        if len(some) and np.all(abs(np.rint(some * scale) / scale - some) <= 1e-14 * abs(some)):
            return max(ROUNDING, 100 * 10.0**-digits)
    return ROUNDING


@dataclass(frozen=True)
class Own:
    """The model's own stiffness, and what ``[material]`` makes of the same cells.

    Attributes
    ----------
    structure : the model
    K : (n_dof, n_dof) without contact, both faces of a sector free, and without what a speed adds
    points, full : the stress, at the points where strain is best and at those of full integration
    constants : of K; None where no node tells
    lonely : number of nodes that move and are of no solid cell
    where : the case file
    """

    structure: Structure
    K: sp.csr_matrix
    points: StressPoints
    full: StressPoints
    constants: Constants | None
    lonely: int
    where: str

    @classmethod
    def of(cls, case: Case, structure: Structure, elastic: tuple[float, float]) -> Own:
        """Of a model with solid cells and the inner nodes of these."""
        K = structure.own("K")
        assert K is not None
        if case.structure.cut is None and SPIN in structure.parts:  # a sector's K before it is tied has no such share
            K = K - omega_squared(case.speed_rpm) * structure.parts[SPIN]
        nodes, K = np.asarray(structure.coordinates), sp.csr_matrix(K)
        points, full = (StressPoints.of(nodes, solids_of(structure), elastic, full) for full in (False, True))
        constants = constants_of(structure, K, points)
        lonely = (cells_around(len(nodes), solids_of(structure)) == 0) & (structure.dofs_of_nodes >= 0).any(axis=1)
        return cls(structure, K, points, full, constants, int(lonely.sum()), display(case.path))

    def compare(self, labels: Sequence[str], motion: Array, displacement: Array, worst: int) -> Iterator[str]:
        """What to say of one motion.

        Parameters
        ----------
        motion : (n_dof, 1 + m) on the model's dofs: at rest, then the coefficients of each label [length]
        displacement : (n_nodes, 3, 1 + m) the same of the nodes
        worst : number of the node of which a stress is told

        Raises
        ------
        InputError
            Constants or energy are off by a factor that leaves no doubt.
        """
        chosen = _columns(labels, motion)
        motion, displacement = motion[:, chosen], displacement[..., chosen]
        own = np.einsum("nc,nc->", motion, self.K @ motion) / 2
        if own > rounding(self.K) * np.einsum("nc,nc->", abs(motion), abs(self.K) @ abs(motion)):
            yield self._of_energy(own, motion, displacement, worst)
        if self.lonely:
            yield f"note: {counted(self.lonely, 'node')} that K moves are of no solid cell: no stress is told there"

    def _of_energy(self, own: float, motion: Array, displacement: Array, worst: int) -> str:
        """It is not known how the model's elements are integrated: fully, unless the other one agrees."""
        full, few = (float(one.energies(displacement).sum() / own) for one in (self.full, self.points))
        nearer = abs(few - 1) < min(abs(full - 1), ENERGY)
        ratio, points = (few, self.points) if nearer else (full, self.full)
        self._refuse(ratio)
        told = f"strain energy of the stress: {ratio:.4f} of the model's own"
        reasons = "; ".join(self._of_constants(displacement, worst))
        if reasons or abs(ratio - 1) <= ENERGY:
            return f"{WARNING}{told}: {reasons}" if reasons else told
        reason = MORE if ratio > 1 else LESS
        if self.constants is None:
            return f"{WARNING}{told}: [material] is not that of K, or {reason}"
        kind = "note: " if ratio < 1 else WARNING  # the cells are K's, and it has something else beside them
        most = self._most(points, motion, displacement)
        return f"{kind}{told}: {reason}; most at node {most}"

    def _most(self, points: StressPoints, motion: Array, displacement: Array) -> int:
        """Number of the node at which the forces of K and of the stress differ most."""
        table = self.structure.dofs_of_nodes
        off = at_nodes(self.K @ motion, table) - points.forces(displacement)
        off[table < 0] = 0.0  # what is held is held by forces that K does not have
        return int(node_numbers(self.structure)[np.argmax(np.linalg.norm(off, axis=(1, 2)))])

    def _of_constants(self, displacement: Array, worst: int) -> Iterator[str]:
        """Where K has others, if it matters."""
        known = self.constants
        if known is None or not len(known.wrong):
            return
        numbers, count = known.numbers[known.wrong], len(known.numbers)
        energies = self.points.energies(displacement).sum(axis=1)
        share = float(energies[known.others].sum() / (energies.sum() or 1.0))
        if max(share, len(numbers) / count) < DETAIL and worst not in numbers:
            return
        if known.one:
            yield f"K has {self._constants(known.together)}, told by {counted(count, 'node')} of the surface"
            return
        yield (
            f"K has {_range(known.factor[known.wrong])} of the modulus of [material], or another Poisson's ratio, at"
            f" {len(numbers)} of {counted(count, 'node')} of the surface that tell it, farthest at node"
            f" {numbers[np.argmax(known.off[known.wrong])]}{', the worst node too' if worst in numbers else ''}"
        )
        yield f"cells of such nodes alone have {100 * share:.3g} % of the energy, and their stress is not right"

    def _refuse(self, ratio: float) -> None:
        """Where all of K is of other constants, or linear cells bend by a fraction of what their strain says."""
        known = self.constants
        if known is not None and _beyond(float(np.median(known.factor))) and _beyond(ratio):
            what, found = "[material] is not that of the model's stiffness", self._constants(known.together)
            if not known.one:
                found = f"{_range(known.factor)} of it at the nodes of the surface"
            fix = "give the constants of the model's own material, in the units of the case"
            raise InputError(what, self.where, self._constants(self.points.elastic), f"{found}, which K has", fix)
        if ratio > BEYOND:
            what = "the stress of these cells is not that of the model's stiffness"
            measured = f"{ratio:.4g} times the strain energy that K has in the same motion"
            expected = "as much: elements of full integration" + (", constants of K" if known is None else "")
            fix = "mesh with elements that bend (C3D8I, C3D10, C3D20R), or take [material] out: gauges remain"
            if known is None:
                fix = f"give the constants of the model's own material; or {fix}"
            raise InputError(what, self.where, measured, expected, fix)

    def _constants(self, elastic: tuple[float, float]) -> str:
        symbol = self.structure.unit_system("pressure")
        return f"youngs_modulus = {elastic[0]:.6g} [{symbol}] and poisson_ratio = {elastic[1]:.4g}"


#: What explains an energy of the stress that is not that of K, where the constants agree.
MORE = (
    "the model's elements bend more softly than the strain of these cells says (reduced or selective integration,"
    " or modes that the matrices do not have), and have less stress than that told"
)
LESS = "K holds more than these cells: springs, shells, stress stiffness of a speed, or cells that the mesh lacks"


def _columns(labels: Sequence[str], motion: Array) -> npt.NDArray[np.bool_]:
    """(1 + m,) those that vibrate; the mean where none does, and the rest where there is no mean."""
    mean = np.array([False, *(label == "0" for label in labels)])
    vibrates = ~mean
    vibrates[0] = False
    if motion[:, vibrates].any():
        return vibrates
    return mean if mean.any() else np.arange(len(mean)) == 0


def _beyond(ratio: float) -> bool:
    return not 1 / BEYOND <= ratio <= BEYOND


def _range(values: Array) -> str:
    low, high = f"{values.min():.3g}", f"{values.max():.3g}"
    return low if low == high else f"{low} to {high}"
