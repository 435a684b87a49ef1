"""Quantiles of what a sweep over seeds says of each value, in a table and in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..columns import PURE, Column
from ..post.grid import Plan, value_text
from ..post.mode_curve import without_rounding
from ..post.quantiles import CONFIDENCE, least_count, quantiles

Row = Mapping[str, Any]
#: Of what is numbered, as linear modes are, this many are told on the terminal; where that fills it, the first.
MOST_TOLD, FULL = 6, 40
#: Of a summary, before the number of the amplitude in the order of the branch.
AMPLITUDE_AT = "amplitude_at_"


def is_seed(key: str) -> bool:
    """A key whose values are draws."""
    return key.rpartition(".")[2] == "seed"


def over_seeds(plan: Plan) -> bool:
    """A sweep over draws, alone or among others; one of them has no quantiles."""
    return any(is_seed(key) and len(values) > 1 for key, values in plan.over.items())


def crossed(plan: Plan) -> bool:
    """Every draw of one seed with every one of another: as they share draws, the values are not independent."""
    return sum(is_seed(key) and len(values) > 1 for key, values in plan.over.items()) > 1


def groups_of(plan: Plan) -> list[tuple[dict[str, Any], list[int]]]:
    """Each combination of the keys that are no seeds, and the numbers of the values with it: its draws."""
    found: dict[str, tuple[dict[str, Any], list[int]]] = {}
    for number, values in enumerate(plan.values()):
        others = {key: value for key, value in values.items() if not is_seed(key)}
        found.setdefault(value_text(list(others.values())), (others, []))[1].append(number)
    return list(found.values())


def samples(numbers: Sequence[int], rows: Sequence[Row], name: str) -> dict[int, float]:
    """A quantity by the number of the value, of the values whose branch came to its end and has it."""
    asked = {*numbers}
    mine = {int(row["value"]): row for row in rows if row["value"] in asked and row.get("done", 1) == 1}
    known = {number: float(row.get(name, math.nan)) for number, row in mine.items()}
    return {number: value for number, value in known.items() if math.isfinite(value)}


def parts_in(rows: Sequence[Row], split: str) -> list[Any]:
    """What tells the branches of one value apart; None where there is one."""
    return sorted({row[split] for row in rows if split in row}) or [None]


def quantile_rows(plan: Plan, rows: Sequence[Row], columns: Sequence[Column], split: str) -> list[dict[str, Any]]:
    """The table: other keys, level or nodal diameter, quantity, unit, q, value, low, high, n, what is left out.

    Left out are the values that failed, stopped, or do not have the quantity, by their numbers in the sweep. Of seeds
    that are crossed the intervals, which are those of independent values, are not known.
    """
    found = []
    parts = [{} if part is None else {split: part} for part in parts_in(rows, split)]
    leads = [({**others, **part}, numbers) for others, numbers in groups_of(plan) for part in parts]
    by_lead = _by_lead(plan, rows, [*leads[0][0]])
    for lead, numbers in leads:
        mine = by_lead.get(_text(lead, lead), [])
        for column in columns:
            found += [{**lead, **row} for row in _of_quantity(column, numbers, mine)]
    return [{**row, "low": math.nan, "high": math.nan} for row in found] if crossed(plan) else found


def _by_lead(plan: Plan, rows: Sequence[Row], keys: Sequence[str]) -> dict[str, list[Row]]:
    """Rows of a summary by the values of some keys, of the sweep or of their own."""
    values, found = list(plan.values()), dict[str, list[Row]]()
    for row in rows:
        found.setdefault(_text({**row, **values[int(row["value"])]}, keys), []).append(row)
    return found


def _text(row: Row, keys: Iterable[str]) -> str:
    return value_text([row[key] for key in keys])


def _of_quantity(column: Column, numbers: Sequence[int], rows: Sequence[Row]) -> Iterator[dict[str, Any]]:
    known = samples(numbers, rows, column.name)
    missing = [number for number in numbers if number not in known]
    named = {"quantity": column.name, "unit": column.symbol}
    left_out = {"n": len(known), "left_out": len(missing), "left_out_values": " ".join(map(str, missing))}
    for one in quantiles(np.array(list(known.values()))):
        interval = {"q": one.probability, "value": one.value, "low": one.low, "high": one.high}
        yield {**named, **interval, **left_out}


def quantile_lines(name: str, plan: Plan, rows: Sequence[Row], columns: Sequence[Column], split: str) -> list[str]:
    """The same in words, for the terminal."""
    table, lines = quantile_rows(plan, rows, columns, split), []
    keys = [key for key in (*plan.keys, split) if table and key in table[0]]
    by_lead, heads = _by_lead(plan, rows, keys), dict[str, list[dict[str, Any]]]()
    for row in table:
        heads.setdefault(_text(row, (*keys, "quantity")), []).append(row)
    told, beyond = _of_few(list(heads.values()), MOST_TOLD)
    if len(told) > FULL:
        told, beyond = _of_few(list(heads.values()), 1)
    for mine in told:
        row = mine[0]
        place = "".join(f", {_name(key)} = {row[key]} {plan.units.get(key, '')}".rstrip() for key in keys)
        at = reported_at(row["quantity"], by_lead.get(_text(row, keys), []))
        place += f", at amplitude {at}" if at else ""
        lines.append(f"{name}{place}: {row['quantity']}: {'; '.join(map(_word, mine))} ({_count(row)})")
    if beyond:
        lines.append(f"{name}: {', '.join(beyond)}: see {name}_quantiles.csv")
    if lines:
        lines.append(f"{name}: in brackets the {100 * CONFIDENCE:g} % confidence intervals of the quantiles")
    none = _had_by_none(plan, rows, columns)
    lines += [f"{name}: no value that came to its end has {', '.join(none)}"] if none else []
    bad = _left_out(plan, rows, split)
    if bad:
        shown = "; ".join(bad[:10]) + ("; ..." if bad[10:] else "")
        lines.append(f"{name}: left out, for they failed or stopped early: {len(bad)} of {len(plan)} values: {shown}")
    if lines and crossed(plan):
        seeds = " and ".join(key for key in plan.keys if is_seed(key))
        return [
            *lines,
            f"{name}: intervals are those of independent draws, and {seeds} are crossed: sweep over one seed",
        ]
    short = {row["q"]: row["n"] for row in table if not math.isfinite(row["low"] + row["high"])}
    lines += [
        f"{name}: {n} values are too few for both ends of the interval at q = {q:g}, which take {least_count(q)}"
        for q, n in short.items()
    ]
    return lines


def _name(key: str) -> str:
    return key.rpartition(".")[2].replace("_", " ")


def _of_few(groups: Sequence[list[dict[str, Any]]], most: int) -> tuple[list[list[dict[str, Any]]], list[str]]:
    """Those that are told of many of one kind, by number, and which others there are: a wheel has hundreds of modes."""
    told, beyond = list[list[dict[str, Any]]](), dict[str, set[int]]()
    for mine in groups:
        stem, _, number = str(mine[0]["quantity"]).rpartition("_")
        if number.isdigit() and int(number) > most and not stem.endswith("_at"):
            beyond.setdefault(stem, set()).add(int(number))
        else:
            told.append(mine)
    ends = {stem: sorted({min(numbers), max(numbers)}) for stem, numbers in beyond.items()}
    return told, [f"{stem}_{' to '.join(map(str, both))}" for stem, both in ends.items()]


def _had_by_none(plan: Plan, rows: Sequence[Row], columns: Sequence[Column]) -> list[str]:
    """Quantities that no branch that came to its end has, where some did come to theirs."""
    ended = any(row.get("done", 1) == 1 for row in rows)
    return [one.name for one in columns if ended and not samples(range(len(plan)), rows, one.name)]


def _left_out(plan: Plan, rows: Sequence[Row], split: str) -> list[str]:
    """Values that failed or stopped early, in words; with the levels or nodal diameters where it is some of them."""
    parts, found = parts_in(rows, split), list[str]()
    done = {(row["value"], row.get(split)) for row in rows if row.get("done", 1) == 1}
    for number, label in enumerate(plan.labels()):
        missing = [part for part in parts if (number, part) not in done]
        some = [] if len(missing) == len(parts) else [f"{part:g}" for part in missing]
        which = f" ({split.replace('_', ' ')} {', '.join(some)})" if some else ""
        found += [f"{label}{which}"] if missing else []
    return found


def reported_at(name: str, rows: Sequence[Row]) -> str:
    """The amplitudes that a column ``<quantity>_at_<number>`` is at, mostly one; nothing of another column."""
    number = name.partition("_at_")[2]
    known = [row[AMPLITUDE_AT + number] for row in rows if row.get(AMPLITUDE_AT + number) is not None]
    return range_text(known) if number else ""


def range_text(values: Iterable[float]) -> str:
    """``0.1``, or ``0.1 to 0.3``; nothing where none is known."""
    known = [value for value in values if math.isfinite(value)]
    return " to ".join(dict.fromkeys(f"{end(known):.6g}" for end in (min, max))) if known else ""


def _word(row: Row) -> str:
    told = without_rounding if "zeta" in row["quantity"] else float
    value, low, high = row["value"], row["low"], row["high"]
    ends = ", ".join(f"{told(end):.5g}" if math.isfinite(end) else "unknown" for end in (low, high))
    unit = "" if row["unit"] in PURE else f" {row['unit']}"
    return f"{100 * row['q']:g} % {told(value):.5g} [{ends}]{unit}"


def _count(row: Row) -> str:
    return f"n = {row['n']}" + (f", {row['left_out']} left out" if row["left_out"] else "")
