"""Which unit systems an imported model can be in: told by its materials, and by its mass, stiffness and size.

A system is out of the question where a material would be no solid in it. Bounds are wide, from polymers to tungsten,
and known systems are 1e3 apart at least in density or stiffness: what is refused is a slip, not an odd material. The
matrices are the model: where they tell their units, materials of a deck beside say no more than whether it is theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from ..model.structure import Structure
from ..units import SI, SYSTEMS, UnitSystem
from .internal import internal_dofs
from .nodes import Material

#: Of solids: Young's modulus [Pa] and density [kg/m^3].
MODULUS, DENSITY = (1e8, 2e12), (100.0, 3e4)
#: Of a mesh: speed of sound [m/s] off by its edges' length, density [kg/m^3] of the box around the body.
SPEED, DENSITY_OF_BOX = (500.0, 5e4), (40.0, 2e4)


@dataclass(frozen=True)
class Number:
    """A number that tells units: what it is, in which unit of SI, and between which bounds it is a solid's there.

    At least so much: a value below the bounds excludes nothing.
    """

    name: str
    value: float
    unit: str
    bounds: tuple[float, float]
    at_least: bool = False

    def in_si(self, units: UnitSystem) -> float:
        """As a number of this system."""
        by_unit = {
            "Pa": units.kilograms / units.metres,
            "kg/m^3": units.kilograms / units.metres**3,
            "m/s": units.metres,
        }
        return self.value * by_unit[self.unit]

    def fits(self, units: UnitSystem) -> bool:
        """It is a solid's as a number of this system."""
        return self.bounds[0] < self.in_si(units) < self.bounds[1]

    def excludes(self, units: UnitSystem) -> bool:
        """It is no solid's there, however sparse."""
        return not (self.fits(units) or (self.at_least and self.in_si(units) < self.bounds[1]))


@dataclass(frozen=True)
class Evidence:
    """Numbers that tell units together.

    Attributes
    ----------
    of : what they are numbers of
    where : file and line, or empty
    of_model : they are of the matrices and coordinates, not of a material that is named beside
    """

    numbers: Sequence[Number]
    of: str
    where: str = ""
    of_model: bool = False

    @property
    def text(self) -> str:
        """As they stand."""
        return ", ".join(f"{one.name} {one.value:.3g}" for one in self.numbers) + f" {self.of}"

    @property
    def expected(self) -> str:
        """Of a solid."""
        return "a solid's " + ", ".join(f"{one.bounds[0]:g} to {one.bounds[1]:g} {one.unit}" for one in self.numbers)

    @property
    def fits(self) -> tuple[str, ...]:
        """Names of the systems that they can be in."""
        return tuple(name for name, units in SYSTEMS.items() if all(one.fits(units) for one in self.numbers))

    @property
    def mixed(self) -> str:
        """Units of coordinates, and systems of matrices, in which together they are a solid's; "" for none."""
        found = []
        for own in SYSTEMS.values():
            others = [name for name, units in SYSTEMS.items() if units.metres != own.metres]
            alike = [
                name
                for name in others
                if all(one.fits(replace(SYSTEMS[name], metres=own.metres)) for one in self.numbers)
            ]
            found += [f"in {own.length} beside matrices like {' or '.join(alike)}"] if alike else []
        return ", or ".join(dict.fromkeys(found)) if self.of_model else ""

    def contradicts(self, system: str) -> bool:
        """They can be in a known system, but not in this one."""
        return bool(self.fits) and system not in self.fits

    def decides(self, system: str) -> bool:
        """They are of the model, and in this system or excluded there."""
        excluded = any(one.excludes(SYSTEMS[system]) for one in self.numbers)
        return self.of_model and (system in self.fits or excluded)

    def read_in(self, system: str) -> str:
        """What they are as numbers of a system."""
        values = ", ".join(f"{one.in_si(SYSTEMS[system]):.3g} {one.unit}" for one in self.numbers)
        return f"{self.text}, which in {system} are {values}"


def evidence_of(model: Structure, materials: Sequence[Material] = ()) -> list[Evidence]:
    """What tells the units of a model whose dofs are told by node and direction."""
    return [*map(_of_material, materials), *_of_matrices(model)]


def check_declared(declared: str, evidence: Sequence[Evidence], where: str, fix: Callable[[str], str]) -> None:
    """Declared units that the matrices contradict are refused; where these do not tell, those that nothing speaks for.

    Parameters
    ----------
    fix : how another system is declared, by its name

    Raises
    ------
    InputError
        They are another known system's.
    """
    telling = [one for one in evidence if one.fits]
    deciding = [one for one in telling if one.decides(declared)] or telling
    if not deciding or any(declared in one.fits for one in deciding):
        return
    system = deciding[0].fits[0]
    shown = next(one for one in telling if system in one.fits)
    place = ", ".join(filter(None, (where, shown.where)))
    apart = [one for one in telling if system not in one.fits]
    more = f", or export deck and matrices from one model: {_apart(apart[0])}" if apart else ""
    what, read = "the numbers contradict the declared units", shown.read_in(declared)
    raise InputError(what, place, read, shown.expected, fix(system) + more)


def _apart(material: Evidence) -> str:
    """Of a material that is not in the units of the matrices."""
    return f"{material.text} is like {' or '.join(material.fits)}"


def words(declared: str | None, evidence: Sequence[Evidence]) -> tuple[list[str], list[str]]:
    """Lines of a report and warnings."""
    lines = [f"units: {declared}" if declared else f"units: not declared, read as {SI.name}"]
    warnings = []
    of_model = [name for one in evidence if one.of_model for name in one.fits]
    for one in evidence:
        if one.fits:
            lines.append(f"units: like {' or '.join(one.fits)} for a solid ({one.text})")
        elif one.mixed:
            warnings.append(f"units: the coordinates seem not to be the model's, but {one.mixed} ({one.text})")
        else:
            warnings.append(f"units: no known system in which this is a solid ({one.text}): is M in the units of K?")
        if of_model and not one.of_model and one.fits and not set(one.fits) & set(of_model):
            likely = " or ".join(of_model)
            warnings.append(f"units: {_apart(one)}, the matrices like {likely}: are deck and matrices of one model?")
        elif one.contradicts(declared or SI.name):
            system = declared or f"{SI.name}, for none is declared"
            warnings.append(f"units: read as {system}, but like {' or '.join(one.fits)}: give --units {one.fits[0]}")
    return lines, warnings


def _of_material(material: Material) -> Evidence:
    modulus, density = material.modulus, material.density
    numbers = [] if modulus is None else [Number("Young's modulus", modulus, "Pa", MODULUS)]
    numbers += [] if density is None else [Number("density", density, "kg/m^3", DENSITY)]
    return Evidence(numbers, f"of {material.name}", material.where)


def _of_matrices(model: Structure) -> Iterator[Evidence]:
    """Speed of sound and density as far as the mesh shows them; metals have about 5000 m/s and 2700 to 8900 kg/m^3."""
    if model.coordinates is None or model.labels is None:
        return
    size = np.ptp(model.coordinates, axis=0)
    M, K = sp.csr_matrix(model.M), sp.csr_matrix(model.K)
    direction = model.labels[:, 1]
    moves = (direction[:, None] == (1, 2, 3)).astype(float)
    moves[internal_dofs(model)] = 0.0
    stiff, heavy = (float(A.diagonal() @ moves.sum(axis=1)) for A in (K, M))
    if (size <= 0).any() or not (stiff > 0 and heavy > 0):
        return
    speed = float(np.cbrt(size.prod() / len(model.coordinates)) * np.sqrt(stiff / heavy))
    density = float(np.einsum("ik,ik->k", moves, M @ moves).max() / size.prod())
    numbers = [
        Number("speed of sound about", speed, "m/s", SPEED),
        Number("density at least", density, "kg/m^3", DENSITY_OF_BOX, at_least=True),
    ]
    yield Evidence(numbers, "by mass, stiffness and size", of_model=True)
