"""Numbers as scripts give them, refused in one sentence where they are none. Those of case files have types of keys."""

from __future__ import annotations

import numbers as numbers_abc
import operator
from collections.abc import Iterable, Mapping

import numpy as np

from .arrays import Array
from .errors import InputError

#: Of a number whose square is taken; norms sum squares.
LARGEST = 1e150


def whole(value: object) -> int | None:
    """The whole number that it is, NumPy's too; None of any other thing."""
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return None


def real(value: object, in_array: bool = False) -> float | None:
    """The finite number that it is, NumPy's too; None of any other thing.

    Parameters
    ----------
    in_array : also one that stands alone in an array
    """
    found = array_of(value)
    alone = found.shape == () or (in_array and isinstance(value, np.ndarray) and found.size == 1)
    number = float(found.item()) if alone and found.dtype.kind in "biuf" else np.nan
    return number if np.isfinite(number) else None


def place(name: str, value: object, count: int) -> int:
    """One of 0 .. count - 1.

    Raises
    ------
    InputError
    """
    found = whole(value)
    if found is None or not 0 <= found < count:
        raise InputError(f"there is no such {name}", None, repr(value), f"0 to {count - 1}", "choose one of these")
    return found


def with_a_square(what: str, value: float, fix: str, where: str | None = None) -> None:
    """Its square is a number, and not zero unless it is zero itself.

    Raises
    ------
    InputError
    """
    size = abs(value)
    if size > LARGEST or 0 < size < 1 / LARGEST:
        how, bound = ("large", f"at most {LARGEST:g}") if size > 1 else ("small", f"at least {1 / LARGEST:g}")
        raise InputError(f"{what} is too {how}", where, f"{value:g}", f"{bound}, whose square is a number", fix)


def positive(name: str, value: object) -> float:
    """A finite number above zero.

    Raises
    ------
    InputError
    """
    return float(numbers(name, value, above=0.0))


def relative_tolerance(name: str, value: object) -> float:
    """Above zero and below one, from which on nothing is resolved.

    Raises
    ------
    InputError
    """
    found = positive(name, value)
    if found >= 1:
        raise InputError("a relative tolerance allows anything", name, repr(value), "> 0 and < 1", "give a smaller one")
    return found


def not_negative(name: str, value: object) -> float:
    """A finite number, zero or more.

    Raises
    ------
    InputError
    """
    return float(numbers(name, value, least=0.0))


def positive_or_infinite(name: str, value: object) -> float:
    """A number above zero, or infinity where there is no bound.

    Raises
    ------
    InputError
    """
    found = array_of(value)
    endless = found.shape == () and found.dtype.kind == "f" and found == np.inf
    return np.inf if endless else positive(name, value)


def numbers(
    name: str, values: object, shape: tuple[int, ...] = (), above: float = -np.inf, least: float = -np.inf
) -> Array:
    """Finite numbers of a shape, above a bound or from a least one on.

    Raises
    ------
    InputError
    """
    found = array_of(values)
    fit = found.dtype.kind in "biuf" and found.shape == shape and bool(np.isfinite(found).all())
    if not fit or not ((found > above) & (found >= least)).all():
        bound = f", > {above:g}" if above > -np.inf else f", >= {least:g}" if least > -np.inf else ""
        wanted = f"{shape} finite numbers{bound}" if shape else f"a finite number{bound}"
        shown = repr(values) if found.size <= 4 else str(found.shape)
        fix = "give such numbers" if shape else "give such a number"
        raise InputError("a number cannot be used", name, shown, wanted, fix)
    return found.astype(float)


def masked(values: object) -> bool:
    """Whether an entry of an array is masked: anything may stand behind it."""
    return isinstance(values, np.ma.MaskedArray) and bool(np.any(values.mask))


def listed(values: object) -> Array:
    """Those of any collection, also of what can be gone through once; as no numbers what is a dict, a text or none."""
    plain = isinstance(values, Iterable) and not isinstance(values, (Mapping, str, bytes, np.ndarray))
    return array_of(list(values) if plain else values)  # type: ignore[call-overload]


def array_of(values: object) -> Array:
    """Also of rows of different lengths and of what is masked, as no numbers, and of Python's fractions."""
    try:
        found = np.asarray(None if masked(values) else values)
        fractions = found.dtype == object and all(isinstance(value, numbers_abc.Real) for value in found.flat)
        return found.astype(float) if fractions else found
    except (ValueError, OverflowError):
        return np.array(None)


def one_a_dof(values: object, n_dof: int) -> Array:
    """An array (n_dof,) as finite real numbers.

    Raises
    ------
    InputError
        They are none, or not one a dof.
    """
    given = array_of(values)
    measured = "masked entries" if masked(values) else f"{given.shape} of {given.dtype}"
    expected = f"({n_dof},) finite real numbers"
    if given.shape == (n_dof,) and given.dtype.kind in "biuf":
        if (abs(given) <= LARGEST).all():
            return given.astype(float, copy=False)
        endless = np.count_nonzero(~np.isfinite(given))
        measured = f"{endless} entries that are not finite"
        if not endless:
            with_a_square("an entry of an array", float(abs(given).max()), "choose other units")
    raise InputError("an array does not fit the model", None, measured, expected, "give one real number a dof")
