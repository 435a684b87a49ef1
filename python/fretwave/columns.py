"""Columns of the result tables: unit, long name and kind, said once.

Units are those of quantities (:mod:`fretwave.units`); who writes or shows a table says in which system it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Union

import numpy as np

from .errors import InputError
from .units import SI, UnitSystem, quantity

Value = Union[float, int, str]

#: Units of a pure number and of a text.
PURE = ("", "1", "-")
#: Longest event text kept in results.h5.
EVENT_LENGTH = 48
#: Column of a sweep's table: the number of the value.
NUMBER = "value"


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    unit : str
        Of the quantity, as "force/length".
    kind : str
        ``f`` number, ``i`` integer, ``s`` text.
    units : UnitSystem
        The system that its numbers are in.
    """

    name: str
    unit: str
    long_name: str
    kind: str = "f"
    units: UnitSystem = SI

    def __repr__(self) -> str:
        return f"Column('{self.name}', '{self.symbol}': {self.long_name})"

    @property
    def dtype(self) -> str:
        """Type of the column in results.h5."""
        return {"f": "f8", "i": "i8", "s": f"S{EVENT_LENGTH}"}[self.kind]

    @property
    def attributes(self) -> dict[str, str]:
        """Of the column in results.h5."""
        return {"units": self.symbol, "long_name": self.long_name}

    def in_units(self, units: UnitSystem) -> Column:
        """The same of numbers in a system."""
        return replace(self, units=units)

    def as_amplitude(self, unit: str) -> Column:
        """The same in a table whose lengths are all amplitudes of this unit."""
        return replace(self, unit=unit) if quantity(self.unit) == "length" else self

    @property
    def symbol(self) -> str:
        """Its unit in the symbols of the system."""
        return self.units(self.unit)

    @property
    def heading(self) -> str:
        """As the first line of a CSV has it: the name alone in SI, in another system with the unit."""
        return self.name if self.units == SI or self.unit in PURE else f"{self.name} [{self.symbol}]"

    def text(self, value: Value) -> str:
        """The value as the CSV has it: shortest text that gives the same number back."""
        if self.kind == "i":
            return str(int(value))
        return str(value) if self.kind == "s" else repr(float(value))

    def stored(self, value: Value) -> Any:
        """The value as results.h5 has it."""
        return np.array(str(value).encode()[:EVENT_LENGTH] if self.kind == "s" else value, self.dtype)

    def loaded(self, value: np.generic) -> Value:
        """The inverse of `stored`."""
        plain = value.item()
        loaded: Value = plain.decode() if self.kind == "s" else plain
        return loaded


_WHY = {
    "harmonics": "the harmonics that are not retained",
    "samples": "the number of samples",
    "solver": "what the solver left",
    "reduction": "component modes that the reduction has left out",
}
#: Of a point's error.
SOURCES = tuple(_WHY)

_ALL = (
    Column("point", "1", "number of the point on its branch", "i"),
    Column("nodal_diameter", "1", "nodal diameters of the wave, negative for a backward one", "i"),
    Column("level", "1", "factor on the excitation force"),
    Column("start", "1", "number of the start", "i"),
    Column("cycle", "1", "number of the cycle", "i"),
    Column("time", "s", "time in the middle of the cycle"),
    Column("amplitude", "length", "fundamental amplitude of the observed dof"),
    Column(
        "omega", "rad/s", "angular frequency, Im lambda; 0 where the motion does not oscillate (EPMC, zeta above 1)"
    ),
    Column("omega0", "rad/s", "modulus of lambda"),
    Column("omega_mode", "rad/s", "angular frequency of the mode at this amplitude"),
    Column("frequency_hz", "Hz", "frequency, omega / 2 pi"),
    Column("speed_rpm", "rev/min", "speed at which the engine order excites this frequency"),
    Column(
        "largest_amplitude", "length", "fundamental amplitude of the observed dof in the sector where it is largest"
    ),
    Column("largest_sector", "1", "sector that moves most", "i"),
    Column("phase", "rad", "phase of the fundamental against the force"),
    Column("beta", "1/s", "decay rate, - Re lambda"),
    Column("zeta", "1", "modal damping ratio"),
    Column("zeta_mode", "1", "damping ratio of the mode at this amplitude"),
    Column("line", "1", "number of the amplitude", "i"),
    Column("cycles", "1", "normalised wear cycles"),
    Column("vibrations", "1", "vibration cycles"),
    Column("step", "1", "length of the step in normalised wear cycles"),
    Column("work", "energy", "energy that contact dissipates in a period"),
    Column("energy_error", "1", "imbalance of the period's energy, relative to that released by the decay"),
    Column(
        "step_error",
        "1",
        "estimated error of the step's depths, relative to own depth and the one that takes the mean load away",
    ),
    Column("stick", "1", "share of the period that contact pairs stick"),
    Column("slip", "1", "share of the period that contact pairs slip"),
    Column("open", "1", "share of the period that contact pairs are open"),
    Column("omega_error", "rad/s", "estimated error of omega: modulus of that of lambda"),
    Column("zeta_error", "1", "estimated error of zeta: that of lambda over omega0 (EPMC above 1: by beta and omega0)"),
    Column("amplitude_error", "length", "estimated error of the complex amplitude, modulus"),
    *(
        Column(f"{what}_error_{source}", unit, f"estimated error of {name} by {why}")
        for what, unit, name in (("lambda", "1/s", "lambda"), ("amplitude", "length", "the complex amplitude"))
        for source, why in _WHY.items()
    ),
    Column("harmonics", "1", "highest harmonic retained", "i"),
    Column("samples", "1", "time samples of a period", "i"),
    Column("force_outside", "1", "share of the varying contact force outside the retained harmonics; no error"),
    Column("residual", "1", "norm of the scaled residual"),
    Column("newton", "1", "Newton iterations", "i"),
    Column("linear", "1", "linear iterations", "i"),
    Column("wall_s", "s", "wall time of the point"),
    Column("rounding", "1", "what rounding leaves in the scaled residual, expected"),
    Column("accepted", "1", "1: residual below the tolerance; 0: at rounding, without effect on the result", "i"),
    Column("unclosed", "length", "largest distance of a slider from where it began its period"),
    Column("event", "", "what was met at the point", "s"),
)
COLUMNS = {column.name: column for column in _ALL}

_SHARED = (
    "stick",
    "slip",
    "open",
    "force_outside",
    "residual",
    "newton",
    "linear",
    "wall_s",
    "rounding",
    "accepted",
    "unclosed",
    "event",
)
MODE = (
    *("point", "amplitude", "omega", "omega0", "frequency_hz", "beta", "zeta", "omega_error", "zeta_error"),
    *(f"lambda_error_{source}" for source in SOURCES),
    *_SHARED,
)
#: Of a mode and its error.
MODAL = MODE[MODE.index("omega") : MODE.index("stick")]
FLUTTER = ("point", "nodal_diameter", *MODE[1:])
FORCED = (
    *("point", "level", "omega", "frequency_hz", "amplitude", "phase", "amplitude_error"),
    *(f"amplitude_error_{source}" for source in SOURCES),
    *_SHARED,
)


#: Of a linear mode's coordinate phi^T M x with phi^T M phi of one unit of mass.
MODAL_UNIT = "sqrt(mass) length"


#: Of what is observed beside the amplitude.
ENERGY = Column("energy", "energy", "mechanical energy of the vibration, mean over a period")


def over(columns: Sequence[Column], unit: str, what: str = "") -> list[Column]:
    """The same columns, their amplitude in a unit of its own, and of something that is no dof."""

    def own(column: Column) -> Column:
        if column.name == "amplitude" and what:
            return replace(column, unit=unit, long_name=f"fundamental amplitude of {what}")
        if column.name == "amplitude" or column.name.startswith("amplitude_error"):
            return replace(column, unit=unit)
        return column

    return [own(column) for column in columns]


def table_order(names: Iterable[str]) -> list[str]:
    """Names of columns as tables have them; an analysis' own come last."""
    given = list(names)
    return [name for name in COLUMNS if name in given] + [name for name in given if name not in COLUMNS]


def with_discretisation(names: Sequence[Any]) -> list[Any]:
    """Columns of a branch whose harmonics and samples change along it."""
    return [*names[:-1], "harmonics", "samples", names[-1]]


def columns_named(names: Sequence[str | Column], units: UnitSystem = SI) -> list[Column]:
    """Columns by name; an analysis may bring columns of its own."""
    return [(name if isinstance(name, Column) else COLUMNS[name]).in_units(units) for name in names]


def check_names(columns: Sequence[Column], where: str) -> None:
    """Columns of a table can stand beside each other, and beside the numbers of a sweep's values.

    Raises
    ------
    InputError
    """
    names = [column.name for column in columns]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError("two columns of a table have one name", where, twice, "each name once", "rename one of them")
    wrong = next((name for name in names if name == NUMBER or not re.fullmatch(r"\w+", name)), None)
    if wrong is not None:
        expected = f"letters, digits and _, and not '{NUMBER}', which numbers the values of a sweep"
        raise InputError("a column of a table cannot have this name", where, repr(wrong), expected, "rename the column")


#: Of tables beside those of the analyses.
_FURTHER = (
    *(Column(f"{name}amplitude", "length", "") for name in ("at_", "last_", "sector_", "tuned_", "quadrature_")),
    Column("amplitude_hb", "length", "amplitude by harmonic balance"),
    *(Column(f"{name}frequency_hz", "Hz", "") for name in ("tuned_", "quadrature_")),
)


def headings(names: Iterable[str], units: UnitSystem, lengths: str = "length") -> dict[str, str]:
    """Headings of a further table's columns, whose lengths are amplitudes of this unit; unknown ones have no unit."""
    known = {**COLUMNS, **{column.name: column for column in _FURTHER}}
    return {name: known[name].as_amplitude(lengths).in_units(units).heading for name in names if name in known}


def name_of(heading: str) -> str:
    """The inverse of `Column.heading`."""
    return heading.partition(" [")[0]
