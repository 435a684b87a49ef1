"""Constants of ``[material]`` that no solid has in the units of the case: a slip that would be a stress."""

from __future__ import annotations

from collections.abc import Iterator

from ..errors import InputError
from ..model.structure import Structure
from .schema import MaterialSection
from .toml.source import Source

#: Of solids: strength over Young's modulus; of steel about 1e-3, of polymers up to 0.1.
STRENGTH = (1e-5, 0.2)


def odd_material(material: MaterialSection, source: Source, structure: Structure) -> Iterator[InputError]:
    """The modulus as a number of the case's units, or else the strengths beside it."""
    modulus, units = material.youngs_modulus, structure.unit_system
    if modulus is None:
        return
    from ..importers.units import MODULUS

    pascal = units.metres / units.kilograms
    names, low, high = ["youngs_modulus"], MODULUS[0] * pascal, MODULUS[1] * pascal
    if low < modulus < high:
        names, low, high = ["endurance_limit", "ultimate_strength"], STRENGTH[0] * modulus, STRENGTH[1] * modulus
    for name in names:
        given, unit = getattr(material, name), units("pressure")
        if given is not None and not low < given < high:
            what, where = f"{name} is that of no solid in the units of the case", source.where(("material", name))
            measured, expected = f"{name} = {given:g} {unit}", f"{low:.3g} to {high:.3g} {unit}"
            fix = f"give it in {unit}, in which steel has a modulus of {210e9 * pascal:g}"
            yield InputError(what, where, measured, expected, fix)
