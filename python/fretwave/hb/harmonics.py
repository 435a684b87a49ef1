"""Retained harmonics of a period: the set, and which of them a model needs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import SupportsIndex

from .. import _core
from ..errors import InputError
from ..given import whole
from ..kinds import of_their_kinds
from ..model.model import Model
from .states import default_samples


class Harmonics:
    """The retained harmonics and the number of time samples of a period.

    Parameters
    ----------
    orders : ascending, with 1 among them (0 is the mean)
    samples : even, at least 2 max(orders) + 2. What a period is shown by; of the forces cubic springs and laws in
        Python alone are sampled, all others are integrated in continuous time.
    """

    def __init__(self, orders: Sequence[int], samples: int) -> None:
        if not isinstance(orders, Iterable) or isinstance(orders, (str, bytes)) or not getattr(orders, "ndim", 1):
            fix = "give for example [0, 1, 2, 3]"
            raise InputError("the retained harmonics are no list", "orders", repr(orders), "whole numbers", fix)
        orders, samples = [_whole("orders", n) for n in orders], _whole("samples", samples)
        if samples > MOST_SAMPLES or max(map(abs, orders), default=0) > MOST_HARMONICS:
            measured, expected = f"{orders}, {samples} samples", f"up to {MOST_HARMONICS}, {MOST_SAMPLES} samples"
            raise InputError("harmonics are beyond all memory", None, measured, expected, "give fewer")
        self.core = _core.Harmonics(orders, samples)
        self.orders: tuple[int, ...] = tuple(self.core.orders)
        self.samples: int = samples
        self.block_size: int = self.core.block_size
        self.labels = [label for n in self.orders for label in (["0"] if n == 0 else [f"{n}c", f"{n}s"])]
        self.left_out: list[str] = []

    def up_to(self, highest: int, samples: int) -> Harmonics:
        """A set of the same kind (odd, with the mean) up to another order; samples double until they suffice."""
        step = 2 if all(n % 2 for n in self.orders) else 1
        highest += step == 2 and highest % 2 == 0
        while samples < 2 * highest + 2:
            samples *= 2
        other = Harmonics(range(self.orders[0], highest + 1, step), samples)
        other.left_out = list(self.left_out)
        return other

    def __repr__(self) -> str:
        step = self.orders[1] - self.orders[0] if len(self.orders) > 1 else 1
        regular = self.orders == tuple(range(self.orders[0], self.orders[-1] + 1, step))
        last = f"{self.orders[1]}, ..., {self.orders[-1]}" if len(self.orders) > 3 else ""
        orders = f"{self.orders[0]}, {last}" if last and regular else ", ".join(map(str, self.orders))
        return f"Harmonics({orders}; {self.samples} samples)"


#: More than any model has samples for, and more samples than the core counts.
MOST_HARMONICS, MOST_SAMPLES = 1_000_000, 2**31 - 1


@of_their_kinds
def choose_harmonics(model: Model, highest: int, samples: int | None = None, retain: str = "auto") -> Harmonics:
    """Retained set up to `highest`: only what the model needs, unless told otherwise.

    Parameters
    ----------
    samples : default: `default_samples`.
    retain : {"auto", "odd", "all"}
        auto keeps odd harmonics only when every law is odd and nothing preloads the contact.
    """
    highest, samples = _whole("highest", highest), None if samples is None else _whole("samples", samples)
    if highest < 1:
        raise InputError("the highest harmonic is below 1", None, highest, ">= 1", "give H = 1 or more")
    if highest > MOST_HARMONICS:
        most = f"at most {MOST_HARMONICS}"
        raise InputError("the highest harmonic is beyond all memory", None, highest, most, "give a lower one")
    if retain not in ("auto", "odd", "all"):
        raise InputError("unknown choice of harmonics", None, retain, "auto, odd or all", 'use retain="auto"')
    odd = retain == "odd" or (retain == "auto" and model.odd)
    harmonics = Harmonics([n for n in range(highest + 1) if n % 2 or not odd], samples or default_samples(highest))
    if odd:
        harmonics.left_out.append("even harmonics and the mean (the contact laws are odd, there is no preload)")
    return harmonics


def _whole(name: str, value: SupportsIndex) -> int:
    number = whole(value)
    if number is None:
        fix = "give one number, as in choose_harmonics(model, 7, samples=128)"
        raise InputError("harmonics and samples are whole numbers", name, repr(value), "an int", fix)
    return number
