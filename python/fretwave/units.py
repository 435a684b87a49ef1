"""Consistent systems of units: all numbers of a model are in one, SI unless it says otherwise; fretwave converts none.

Columns, keys, parameters of laws and docstrings name quantities: ``length``, ``mass``, ``force``, ``energy``,
``pressure``, and what is made of them ("force/length", "sqrt(mass) length"). A `UnitSystem` is called with such a text
where a label is written, and only there. Time is in seconds in every system: keys and columns are in Hz, rad/s, s.

A further system is one more entry of `SYSTEMS`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .errors import InputError

#: Attribute of results, model files and branches that names the system.
ATTRIBUTE = "unit_system"
#: SI's symbols stand for their quantities too, in a plug-in's columns and parameters.
_OF_SI = {"m": "length", "kg": "mass", "N": "force", "J": "energy", "Pa": "pressure"}
_WORD = re.compile("[A-Za-z]+")
#: Numbers of this size are shown without a prefix.
READABLE = (0.2, 1000.0)
#: With one they are this at least, and less than 1000 times as much.
SMALLEST = 0.3
_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_POWERS = {prefix: power for power, prefix in _PREFIXES.items()}
#: A unit that takes SI's prefixes, or that over seconds.
_PREFIXED = re.compile("([nµmkMG]?)(" + "|".join([*(sorted(set(_OF_SI) - {"kg"})), "s"]) + ")(/s)?")


@dataclass(frozen=True)
class UnitSystem:
    """Symbols of a consistent system with time in seconds.

    Attributes
    ----------
    length, mass, force, energy, pressure : str
        Symbols; those of force, energy and pressure have names of their own, or are written in the others.
    metres, kilograms : float
        What a unit of length and of mass is, to tell which system numbers are in.
    finer : tuple of (float, str)
        Factor and symbol of the lengths that pictures show: of places on a face, and of depths.

    Examples
    --------
    >>> [MM_T_S(quantity) for quantity in ("force/length", "energy", "sqrt(mass) length", "rad/s")]
    ['N/mm', 'mJ', 'sqrt(t) mm', 'rad/s']
    >>> MM_T_S.of_faces, SI.of_depths
    ((1.0, 'mm'), (1000000.0, 'µm'))
    """

    name: str
    length: str
    mass: str
    force: str
    energy: str
    pressure: str
    metres: float
    kilograms: float
    finer: tuple[tuple[float, str], tuple[float, str]]

    def __repr__(self) -> str:
        return f"UnitSystem({self.described()})"

    def __call__(self, unit: str) -> str:
        """The unit of quantities in these symbols; what names none of them stays: "1", "rad/s", "Hz"."""
        return _WORD.sub(lambda found: self._symbol(found.group()), quantity(unit))

    def _symbol(self, word: str) -> str:
        return str(getattr(self, word)) if word in _OF_SI.values() else word

    def described(self) -> str:
        """Its name and symbols, in a line."""
        quantities = ("length", "mass", "force", "energy", "pressure")
        return f"{self.name} (" + ", ".join(f"{name} {getattr(self, name)}" for name in quantities) + ", time s)"

    @property
    def of_faces(self) -> tuple[float, str]:
        """Factor and symbol of places on a face."""
        return self.finer[0]

    @property
    def of_depths(self) -> tuple[float, str]:
        """Factor and symbol of worn depths and slip."""
        return self.finer[1]

    @property
    def of_volumes(self) -> tuple[float, str]:
        """Factor and symbol of worn volumes."""
        factor, symbol = self.of_faces
        return factor**3, f"{symbol}^3"

    def shown(self, symbol: str, size: float) -> tuple[float, str]:
        """Factor and symbol in which a picture shows numbers that are given in `symbol` and typically of this size.

        Those of SI take its prefixes by the size alone, so that the same model in two systems has the same pictures;
        inches have their finer ones, and a unit of several stays.

        Examples
        --------
        >>> SI.shown("m", 2e-5), SI.shown("N", 4200.0), MM_T_S.shown("mm", 0.03), MM_T_S.shown("mm/s", 2e4)
        ((1000000.0, 'µm'), (0.001, 'kN'), (1000.0, 'µm'), (0.001, 'm/s'))
        >>> IN_LBF_S.shown("in", 0.004), IN_LBF_S.shown("lbf", 4200.0), SI.shown("m", 0.3)
        ((1000.0, 'mil'), (1.0, 'lbf'), (1.0, 'm'))
        """
        if not 0.0 < size < math.inf:
            return 1.0, symbol
        found = _PREFIXED.fullmatch(symbol)
        if found is None:
            finer = self.lengths if symbol == self.length and size < READABLE[0] else [(1.0, symbol)]
            return next((one for one in finer if one[0] * size >= 1.0), finer[-1])
        prefix, unit, rest = found.groups(default="")
        plain = size * 10.0 ** _POWERS[prefix]
        wanted = 0 if READABLE[0] <= plain < READABLE[1] else 3 * math.floor(math.log10(plain / SMALLEST) / 3 + 1e-9)
        power = min(max(wanted, min(_PREFIXES)), max(_PREFIXES))
        return 10.0 ** (_POWERS[prefix] - power), f"{_PREFIXES[power]}{unit}{rest}"

    @property
    def cubic_millimetres(self) -> float:
        """In a unit of volume."""
        return (1e3 * self.metres) ** 3

    @property
    def lengths(self) -> list[tuple[float, str]]:
        """Factors and symbols from its own length to the finest."""
        return list(dict.fromkeys([(1.0, self.length), *self.finer]))


_MILLIMETRES = ((1.0, "mm"), (1e3, "µm"))
SI = UnitSystem("m-kg-s", "m", "kg", "N", "J", "Pa", 1.0, 1.0, ((1e3, "mm"), (1e6, "µm")))
MM_T_S = UnitSystem("mm-t-s", "mm", "t", "N", "mJ", "MPa", 1e-3, 1e3, _MILLIMETRES)
MM_KG_S = UnitSystem("mm-kg-s", "mm", "kg", "mN", "µJ", "kPa", 1e-3, 1.0, _MILLIMETRES)
_INCHES = ((1.0, "in"), (1e3, "mil"))
IN_LBF_S = UnitSystem("in-lbf-s", "in", "lbf s^2/in", "lbf", "in lbf", "psi", 0.0254, 175.12683524647636, _INCHES)
SYSTEMS: Mapping[str, UnitSystem] = {system.name: system for system in (SI, MM_T_S, MM_KG_S, IN_LBF_S)}


def quantity(unit: str) -> str:
    """A unit in quantities, where it is given in SI's symbols: "force/length" of "N/m"."""
    return _WORD.sub(lambda found: _OF_SI.get(found.group(), found.group()), unit)


def unit_system(name: str) -> UnitSystem:
    """The system of this name.

    Raises
    ------
    InputError
        There is none.
    """
    if name not in list(SYSTEMS):
        raise unknown(name)
    return SYSTEMS[name]


def unknown(name: str, where: str | None = None) -> InputError:
    """That there is no system of this name, and which there are."""
    known = f"one of {', '.join(SYSTEMS)}: consistent, with time in seconds"
    return InputError("unknown unit system", where, f'"{name}"', known, f'write for example "{MM_T_S.name}"')


def units_of(attributes: Mapping[str, Any]) -> UnitSystem:
    """The system that results are in; SI where they tell none, as those of earlier versions."""
    return unit_system(str(attributes.get(ATTRIBUTE, SI.name)))
