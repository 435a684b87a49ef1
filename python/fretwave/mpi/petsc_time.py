"""Names of options of a time integration, tried on one that integrates nothing, before anything is solved."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .petsc_values import names_of

#: What the options of PETSc's TS begin with.
BEGIN = "ts_"
#: Of those read later than where a TS takes its options, or which open files and windows there.
LATER = tuple(BEGIN + word for word in ("view", "monitor", "save_", "trajectory", "convergence_estimate", "event"))
#: The methods that integrate here, explicit and implicit, where no option chooses another.
METHODS = ("rk", "rosw")
PREFIX = "names_of_"


def unread_in_time(given: Mapping[str, str | None]) -> list[str]:
    """Of options ``ts_...`` and their values those that no time integration reads; none where PETSc refuses a value."""
    from petsc4py import PETSc

    from .._core import unused_options

    mine = {name: value for name, value in given.items() if name.startswith(BEGIN) and not name.startswith(LATER)}
    database: Any = PETSc.Options()
    for name, value in mine.items():
        database.setValue(PREFIX + name, value)
    try:
        for method in METHODS if mine else ():
            _make(method)
        left = set(names_of(unused_options()))
    except PETSc.Error:
        return []  # told where it integrates
    finally:
        for name in mine:
            database.delValue(PREFIX + name)
    return [name for name in mine if PREFIX + name in left]


def _make(method: str) -> None:
    from petsc4py import PETSc

    integrator = PETSc.TS().create(PETSc.COMM_SELF)
    try:
        integrator.setOptionsPrefix(PREFIX)
        integrator.setType(method)
        integrator.setFromOptions()
    finally:
        integrator.destroy()
