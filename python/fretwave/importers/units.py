"""Which unit systems an imported model can be in: told by its materials, and by its mass, stiffness and size.

A system is out of the question where a material would be no solid in it. Bounds are wide, from polymers to tungsten,
and known systems are 1e3 apart at least in density or stiffness: what is refused is a slip, not an odd material.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from ..model.structure import Structure
from ..units import SI, SYSTEMS, UnitSystem
from .nodes import Material

#: Of solids: Young's modulus [Pa] and density [kg/m^3].
MODULUS, DENSITY = (1e8, 2e12), (100.0, 3e4)
#: Of a mesh: speed of sound [m/s] off by its edges' length, density [kg/m^3] of the box around the body.
SPEED, DENSITY_OF_BOX = (500.0, 5e4), (40.0, 2e4)


@dataclass(frozen=True)
class Evidence:
    """Numbers that tell units.

    Attributes
    ----------
    text : what they are, as they stand
    where : file and line, or empty
    expected : what they are of a solid, in SI
    fits : names of the systems that they can be in
    """

    text: str
    where: str
    expected: str
    fits: tuple[str, ...]


def evidence_of(model: Structure, materials: Sequence[Material] = ()) -> list[Evidence]:
    """What tells the units of a model whose dofs are told by node and direction."""
    return [*map(_of_material, materials), *_of_matrices(model)]


def check_declared(declared: str, evidence: Sequence[Evidence], where: str, fix: Callable[[str], str]) -> None:
    """Declared units that nothing speaks for are refused.

    Parameters
    ----------
    fix : how another system is declared, by its name

    Raises
    ------
    InputError
        All evidence contradicts them, and fits another known system.
    """
    telling = [one for one in evidence if one.fits]
    if not telling or any(declared in one.fits for one in telling):
        return
    first = telling[0]
    place = ", ".join(filter(None, (where, first.where)))
    read = f"{first.text}, in {declared}"
    raise InputError("the numbers contradict the declared units", place, read, first.expected, fix(first.fits[0]))


def words(declared: str | None, evidence: Sequence[Evidence]) -> tuple[list[str], list[str]]:
    """Lines of a report and warnings."""
    lines = [f"units: {declared}" if declared else f"units: not declared, read as {SI.name}"]
    warnings = []
    for one in evidence:
        if one.fits:
            lines.append(f"units: like {' or '.join(one.fits)} for a solid ({one.text})")
        else:
            warnings.append(f"units: no known system in which this is a solid ({one.text}): is M in the units of K?")
        if one.fits and (declared or SI.name) not in one.fits:
            system = declared or f"{SI.name}, for none is declared"
            warnings.append(f"units: read as {system}, but like {' or '.join(one.fits)}: give --units {one.fits[0]}")
    return lines, warnings


def _of_material(material: Material) -> Evidence:
    modulus, density = material.modulus, material.density
    given = {"Young's modulus": modulus, "density": density}
    parts = [f"{name} {value:.4g}" for name, value in given.items() if value is not None]
    expected = f"{_range(MODULUS)} Pa, {_range(DENSITY)} kg/m^3"

    def fits(units: UnitSystem) -> bool:
        pascals = units.kilograms / units.metres
        solid = modulus is None or _within(modulus * pascals, MODULUS)
        return solid and (density is None or _within(density * _density(units), DENSITY))

    return Evidence(f"{', '.join(parts)} of {material.name}", material.where, expected, _systems(fits))


def _of_matrices(model: Structure) -> Iterator[Evidence]:
    """Speed of sound and density as far as the mesh shows them; metals have about 5000 m/s and 2700 to 8900 kg/m^3."""
    if model.coordinates is None or model.labels is None:
        return
    size = np.ptp(model.coordinates, axis=0)
    M, K = sp.csr_matrix(model.M), sp.csr_matrix(model.K)
    direction = model.labels[:, 1]
    moves = (direction[:, None] == (1, 2, 3)).astype(float)
    stiff, heavy = (float(A.diagonal() @ moves.sum(axis=1)) for A in (K, M))
    if (size <= 0).any() or not (stiff > 0 and heavy > 0):
        return
    speed = float(np.cbrt(size.prod() / len(model.coordinates)) * np.sqrt(stiff / heavy))
    density = float(np.einsum("ik,ik->k", moves, M @ moves).max() / size.prod())
    text = f"speed of sound about {speed:.1e}, density at least {density:.1e} by mass, stiffness and size"
    expected = f"{_range(SPEED)} m/s, {_range(DENSITY_OF_BOX)} kg/m^3"

    def fits(units: UnitSystem) -> bool:
        return _within(speed * units.metres, SPEED) and _within(density * _density(units), DENSITY_OF_BOX)

    yield Evidence(text, "", expected, _systems(fits))


def _systems(fits: Callable[[UnitSystem], bool]) -> tuple[str, ...]:
    return tuple(name for name, units in SYSTEMS.items() if fits(units))


def _density(units: UnitSystem) -> float:
    """A unit of density [kg/m^3]."""
    return units.kilograms / units.metres**3


def _within(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] < value < bounds[1]


def _range(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:g} to {bounds[1]:g}"
