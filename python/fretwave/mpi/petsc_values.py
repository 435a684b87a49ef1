"""Texts of PETSc options, read and held to what is right before PETSc sees them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

from ..errors import InputError
from ..texts import shortened
from .petsc_share import AT_START, TUNED

#: Where options come from that PETSc has read itself.
ENVIRONMENT = "PETSC_OPTIONS, or a .petscrc"

#: Options whose value PETSc takes as it comes: what their name ends with, what is right, and in words.
RULES: tuple[tuple[str, Callable[[float], bool], str], ...] = (
    ("_rtol", lambda value: 0 <= value < 1, "a number from 0 to below 1"),
    ("_atol", lambda value: 0 <= value < math.inf, "a finite number from 0 up"),
    ("_stol", lambda value: 0 <= value < math.inf, "a finite number from 0 up"),
    ("_max_it", lambda value: value >= 0 and value == int(value), "a whole number from 0 up"),
    ("_max_steps", lambda value: value >= 0 and value == int(value), "a whole number from 0 up"),
    ("ts_dt", lambda value: 0 < value < math.inf, "a finite number above 0"),
)


def complaint(name: str, value: str | None) -> str | None:
    """What was expected of an option's value; None when it may be right."""
    if name.endswith("_type") and value is None:
        return "the name of a type"
    rules = (
        ((name, lambda value: 0 < value < math.inf, "a finite number above 0"),) if name.startswith(TUNED) else RULES
    )
    for ending, right, expected in rules:
        if name.endswith(ending):
            try:
                return None if value is not None and right(float(value)) else expected
            except (ValueError, OverflowError):
                return expected
    return None


def parse(text: str) -> list[tuple[str, str | None]]:
    """``-name value -flag`` as pairs; a negative number is a value."""
    pairs: list[tuple[str, str | None]] = []
    for word in text.split():
        if re.match(r"-[A-Za-z_]", word):
            pairs.append((word.lstrip("-"), None))
        elif pairs and pairs[-1][1] is None:
            pairs[-1] = (pairs[-1][0], word)
        else:
            raise InputError(
                "these are no PETSc options",
                "--petsc",
                shortened(text),
                "'-name value' pairs",
                'for example --petsc "-snes_rtol 1e-9"',
            )
    for name, value in pairs:
        if AT_START.match(name):
            raise _too_late(name, value)
        check_value(name, value, "--petsc, or petsc = ... of an analysis")
    return pairs


def names_of(unused: Sequence[str]) -> list[str]:
    """Of options as PETSc lists them, with their values."""
    return [re.split(r"[ =]", text.lstrip("-"))[0] for text in unused]


def check_value(name: str, value: str | None, where: str) -> None:
    expected = complaint(name, value)
    if expected is not None:
        raise InputError(
            f"the PETSc option -{name} has a wrong value",
            where,
            typed(name, value),
            expected,
            "correct the value, or remove the option",
        )


def typed(name: str, value: str | None) -> str:
    return f"-{name} {shortened(value or '')}".strip()


def _too_late(name: str, value: str | None) -> InputError:
    return InputError(
        f"PETSc reads the option -{name} as it starts, before it knows of a case",
        "--petsc, or petsc = ... of an analysis",
        typed(name, value),
        "options of solvers, and -log_view",
        f"set it in the environment: `PETSC_OPTIONS='{typed(name, value)}' fretwave run ...`",
    )
