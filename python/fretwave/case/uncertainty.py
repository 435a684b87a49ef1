"""``[uncertainty]``: values of a case, and factors on them, drawn from distributions with a seed.

Each key has a stream of its own (PCG64, seeded with the seed and the key), so that another key changes none of the
others. What is drawn takes its place in the case before anything is checked: a run of a seed is the run of the case
with these values.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import FretwaveError, InputError
from ..texts import toml
from .reporter import Found
from .schema import DistributionSection, UncertaintySection
from .toml.locate import Path as KeyPath
from .toml.source import Source
from .toml.validation import at, validate

#: Between the place of a distribution and the seed, in the places of errors about a value that was drawn.
SEEDED = ", drawn with seed "
#: Of a lognormal value, standard deviation over mean: with more the half of all values is below 1e-9 of the mean.
WIDEST = 1e9
#: What to do about a draw beyond the bounds of its key.
_WITHIN = {
    "normal": 'take `distribution = "lognormal"`, or a smaller standard_deviation',
    "lognormal": "take a smaller standard_deviation, or another mean",
    "uniform": "take low and high within its bounds",
}


@dataclass(frozen=True)
class Draw:
    """One key's distribution and what was drawn from it, None without a seed.

    Attributes
    ----------
    key : str
        As ``--set`` addresses it.
    factor : bool
        The draw multiplies what the case, its builder or its model file gives.
    unit : str
        Symbol of what is drawn, empty where it has none or is not known yet.
    """

    key: str
    factor: bool
    given: DistributionSection
    value: float | None = None
    unit: str = ""

    @property
    def name(self) -> str:
        """Of its column in a sweep's summary."""
        return f"factors.{self.key}" if self.factor else self.key

    def line(self) -> str:
        """In words."""
        g = self.given
        unit = f" {self.unit}" if self.unit else ""
        even = g.distribution == "uniform"
        numbers = (
            f"{g.low:g} to {g.high:g}{unit}"
            if even
            else f"mean {g.mean:g}{unit}, standard deviation {g.standard_deviation:g}{unit}"
        )
        drawn = "" if self.value is None else f"; drawn: {self.value:.6g}{unit}"
        return f"{'factor on ' if self.factor else ''}{self.key}: {g.distribution}, {numbers}{drawn}"


@dataclass(frozen=True)
class Uncertainty:
    """What of a case is drawn.

    Attributes
    ----------
    wheels : tuple of str
        Analyses whose mistuning takes the seed.
    """

    seed: int | None
    draws: tuple[Draw, ...]
    wheels: tuple[str, ...]

    def lines(self) -> list[str]:
        """In words, for ``fretwave check``."""
        seed = "no seed, nothing is drawn" if self.seed is None else f"seed {self.seed}"
        wheels = [f"{name}.mistuning.seed: that of [uncertainty]" for name in self.wheels]
        return [f"uncertainty ({seed}): {line}" for line in [*(draw.line() for draw in self.draws), *wheels]]

    def in_units(self, units: Mapping[str, str]) -> Uncertainty:
        """With the symbols of the units of keys; a factor has none."""
        draws = (one if one.factor else replace(one, unit=units.get(one.key, "")) for one in self.draws)
        return replace(self, draws=tuple(draws))

    def resolved(self) -> dict[str, Any]:
        """What decides the results, by address; nothing without a seed."""
        if self.seed is None:
            return {}
        tables = {True: "factors", False: "values"}
        given = {
            f"uncertainty.{tables[draw.factor]}.{draw.key}": draw.given.model_dump(exclude_none=True)
            for draw in self.draws
        }
        return {"uncertainty.seed": self.seed, **given, **{f"{DRAWN}{d.name}": d.value for d in self.draws}}


#: Begin of the addresses of what was drawn, in a resolved case.
DRAWN = "uncertainty.drawn."


def draws_of(resolved: Mapping[str, Any]) -> dict[str, float]:
    """What was drawn for a run, by name, from its resolved case."""
    return {key[len(DRAWN) :]: value for key, value in resolved.items() if key.startswith(DRAWN)}


def draw_values(source: Source) -> Uncertainty | None:
    """Draw what ``[uncertainty]`` asks for and put it into the case; what is wrong goes to the source's problems."""
    if not isinstance(source.data.get("uncertainty"), dict):
        return None
    found = source.problems
    section = validate(UncertaintySection, source, ("uncertainty",), found)
    if section is None:
        return None
    taken: dict[KeyPath, KeyPath] = {}
    draws = [_drawn(source, section.seed, taken, *one) for one in _distributions(source, found)]
    wheels = _seeded_wheels(source)
    for name in wheels if section.seed is not None else ():
        source.override(f"{name}.mistuning.seed", section.seed, f"{source.where(('uncertainty', 'seed'))}")
    if not draws and not wheels and not found:
        what, expected = "there is nothing to draw", "values, factors, or mistuning without a seed of its own"
        fix = "add for example `values.contact.damper.KEY = { ... }` to [uncertainty]"
        found.append(InputError(what, source.where(("uncertainty",)), None, expected, fix))
    return Uncertainty(section.seed, tuple(draws), tuple(wheels))


def draw(given: DistributionSection, key: str, seed: int) -> float:
    """The value of a key for a seed.

    A lognormal value has the mean and the standard deviation that are given, not its logarithm.
    """
    words = np.frombuffer(hashlib.sha256(key.encode()).digest(), dtype="<u4").tolist()
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *words])))
    if given.distribution == "uniform":
        low, high = given.low or 0.0, given.high or 0.0
        return float(low + (high - low) * random.random())
    mean, deviation, normal = given.mean or 0.0, given.standard_deviation or 0.0, random.standard_normal()
    if given.distribution == "normal":
        return float(mean + deviation * normal)
    variance = math.log1p((deviation / mean) ** 2)  # of the logarithm
    return float(mean * math.exp(math.sqrt(variance) * normal - variance / 2))


def _distributions(source: Source, found: Found) -> Iterator[tuple[KeyPath, str, bool, DistributionSection]]:
    """Place, key, whether it is a factor, and distribution of each draw."""
    for table in ("values", "factors"):
        given = at(source.data, ("uncertainty", table))
        for inside, value in _leaves(given) if isinstance(given, dict) else ():
            path: KeyPath = ("uncertainty", table, *inside)
            if not isinstance(value, dict):
                what, expected = f"{source.name(path)} is no distribution", "a table with its distribution"
                fix = 'write for example `{ distribution = "lognormal", mean = 0.3, standard_deviation = 0.05 }`'
                found.append(InputError(what, source.where(path), toml(value), expected, fix))
                continue
            distribution = validate(DistributionSection, source, path, found)
            if distribution is not None and _fits(source, path, distribution, table == "factors", found):
                yield path, ".".join(inside), table == "factors", distribution


def _leaves(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Distributions, and what stands in place of one."""
    for name, value in table.items():
        if isinstance(value, dict) and value and not _is_distribution(value):
            yield from _leaves(value, (*path, name))
        else:
            yield (*path, name), value


def _is_distribution(table: Mapping[str, Any]) -> bool:
    """It says what one does; a table by such a name is a key that is drawn (``mistuning.standard_deviation``)."""
    return any(
        name in DistributionSection.model_fields and not isinstance(value, dict) for name, value in table.items()
    )


def _fits(source: Source, path: KeyPath, given: DistributionSection, factor: bool, found: Found) -> bool:
    """It has the numbers of its kind, and they make a distribution."""
    own = ("low", "high") if given.distribution == "uniform" else ("mean", "standard_deviation")
    have = [key for key in ("mean", "standard_deviation", "low", "high") if getattr(given, key) is not None]
    least = 0.0 if given.distribution == "lognormal" or factor else -math.inf
    first = getattr(given, own[0])
    if set(have) != set(own):
        wrong = (f"is {given.distribution} and has {' and '.join(have) or 'no numbers'}", " and ".join(own))
    elif given.low is not None and given.high is not None and not 0.0 < given.high - given.low < math.inf:
        wrong = ("is no range", "low < high, by a finite number")
    elif first <= least:
        wrong = (f"has {own[0]} {first:g}", "a number > 0, of a lognormal value and of a factor")
    elif given.distribution == "lognormal" and (given.standard_deviation or 0.0) > WIDEST * (given.mean or 0.0):
        share = f"{given.standard_deviation:g} at a mean of {given.mean:g}"
        wrong = (f"has standard_deviation {share}", f"at most {WIDEST:g} times the mean")
    else:
        return True
    fix = "write for example `low = 0.2, high = 0.4`" if own[0] == "low" else "write for example `mean = 0.3`"
    what = f"the distribution {source.name(path)} {wrong[0]}"
    found.append(InputError(what, source.where(path), toml(at(source.data, path)), wrong[1], fix))
    return False


def _drawn(
    source: Source,
    seed: int | None,
    taken: dict[KeyPath, KeyPath],
    place: KeyPath,
    key: str,
    factor: bool,
    given: DistributionSection,
) -> Draw:
    """Draw, and put it into the case; `taken` are the places of the distributions of other keys."""
    where = source.where(place) + ("" if seed is None else f"{SEEDED}{seed}")
    path = source.path_of(key.split("."), where)
    if path is not None and taken.setdefault(path, place) != place:
        _drawn_twice(source, key, place, taken[path])
    value = None if seed is None else draw(given, key, seed)
    if path is not None and factor:
        _multiply(source, path, key, 1.0 if value is None else value, where)
    elif path is not None and value is not None:
        _set(source, path, key, value, where)
    return Draw(key, factor, given, value)


def _drawn_twice(source: Source, key: str, place: KeyPath, other: KeyPath) -> None:
    """A value and a factor on it, or a value by two names."""
    what, expected = f"'{key}' is drawn twice", "one distribution of a key"
    fix = "leave one of them out, and let the other be as wide as both"
    source.problems.append(InputError(what, source.where(place), f"also {source.where(other)}", expected, fix))


def _set(source: Source, path: KeyPath, key: str, value: float, where: str) -> None:
    """In place of what the case says, but not of what the command line says."""
    told = source.where(path)
    if told.startswith("--set "):
        what, fix = f"'{key}' is drawn, and given on the command line", "draw a factor on it, or do not give it"
        source.problems.append(InputError(what, where, told, "one of both", fix))
        return
    source.override(key, value, where)


def _multiply(source: Source, path: KeyPath, key: str, factor: float, where: str) -> None:
    """What the case says; of a contact once its parameters are read."""
    if factor <= 0.0:
        source.problems.append(InputError(f"the factor on {key} is not positive", where, f"{factor:g}", "> 0"))
    elif path[0] == "contact":
        source.factors[path] = (factor, where)
    else:
        value = at(source.data, path)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            measured = "no such key in the case" if value is None else toml(value)
            fix = f"draw it as a value (uncertainty.values.{key}), or write the key"
            source.problems.append(InputError(f"a factor is drawn on {key}", where, measured, "a number", fix))
        elif factor != 1.0:
            source.override(key, value * factor, where)


def _seeded_wheels(source: Source) -> list[str]:
    """Analyses whose mistuning is drawn and has no seed of its own."""
    found = []
    for number, entry in enumerate(source.entries("analysis")):
        name, given = source.entry_name("analysis", number), entry.get("mistuning")
        if name and isinstance(given, dict) and "standard_deviation" in given and "seed" not in given:
            found.append(name)
    return found


def advise(problems: list[FretwaveError], uncertainty: Uncertainty | None) -> None:
    """Say of values that were drawn out of their bounds what to do about it."""
    for draw in uncertainty.draws if uncertainty else ():
        table = "factors" if draw.factor else "values"
        for problem in problems:
            out = any(
                word in problem.what
                for word in ("is out of range", "has a wrong value", "is not positive", "is not finite")
            )
            if out and f"(uncertainty.{table}.{draw.key}){SEEDED}" in (problem.where or ""):
                whole = str(problem.expected).startswith("an integer")
                over = f"do not draw it: `fretwave sweep CASE --over {draw.key}=3,5` goes through whole numbers"
                problem.fix = over if whole else _WITHIN[draw.given.distribution]
