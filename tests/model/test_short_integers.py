"""Whole numbers of NumPy's short kinds, which overflow and whose roots are of half precision: the same as Python's."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import fretwave as fw
from fretwave.cyclic.engine_order import folded
from fretwave.model.wheel_matrix import WheelMatrix

pytestmark = [pytest.mark.ranks(1), pytest.mark.filterwarnings("error")]

N, DIAMETERS = 99, 37
M, K = np.diag([1.0, 0.5, 0.0]), np.array([[3.0, -1.0, -1.0], [-1.0, 2.0, 0.0], [-1.0, 0.0, 1.0]])
#: One dof of a sector that moves.
MODE = fw.LinearMode(1.0, 0.0, np.array([1.0]), np.array([0.5]))
KINDS = [np.int8, np.uint8, np.int16, np.uint64]


def ring(k: Any = 1, n: Any = N, **more: Any) -> fw.Sector:
    """A mass on a spring, tied to both neighbours; k is 1."""
    return fw.Sector(np.eye(1), {0: [[3.0]], k: [[-1.0]], -1: [[-1.0]]}, n, **more)


def stiffness(sector: fw.Sector) -> Any:
    return sector.structure.around().own("K")


def numbers(found: Any) -> Iterator[Any]:
    """All arrays in what a function returns."""
    if isinstance(found, fw.LinearMode):
        yield from (found.shape, found.imaginary)
    elif isinstance(found, dict):
        yield from (part for pair in sorted(found.items()) for value in pair for part in numbers(value))
    elif isinstance(found, (tuple, list)):
        yield from (part for value in found for part in numbers(value))
    else:
        yield found.toarray() if hasattr(found, "toarray") else np.asarray(found)


def structure(n: Any = N, dof: Any = 1) -> fw.Structure:
    return fw.Structure(M, K, sectors=n, low=np.array([0]), high=np.array([2]), dofs={"a": dof}).tied()


WORK: dict[str, tuple[Callable[[Any], Any], int]] = {
    "travelling, sectors": (lambda n: fw.travelling_wave(MODE, DIAMETERS, n), N),
    "travelling, diameters": (lambda d: fw.travelling_wave(MODE, d, N), DIAMETERS),
    "standing, sectors": (lambda n: fw.standing_wave(MODE, DIAMETERS, n, 0, 90), N),
    "standing, diameters": (lambda d: fw.standing_wave(MODE, d, N, 0, 90), DIAMETERS),
    "around": (lambda n: ring(n=n).around(MODE, DIAMETERS), N),
    "expand": (lambda d: fw.Sector.of(structure()).expand([1.0, 2.0], d, 7), DIAMETERS),
    "next sector": (lambda k: stiffness(ring(k)), 1),
    "ring": (lambda n: stiffness(ring(n=n)), N),
    "places": (lambda n: structure(n).around().places("a"), N),
    "wheel": (lambda n: structure(n).around(np.linspace(-0.1, 0.1, N)).own("K"), N),
    "matrix of a wheel": (lambda n: WheelMatrix({0: np.eye(3)}, n), N),
    "folded": (lambda k: folded(k, 100), N),
    "folded, sectors": (lambda n: folded(-DIAMETERS, n), N),
    "pairs": (lambda n: fw.Pairs([[0.0, 1.0]], 1).around(n).B, N),
    "flow, places ahead": (lambda k: stiffness(ring(aerodynamics=fw.Aerodynamics({0: 0.3, k: 0.1}, 2.0))), 3),
    "flow, sectors": (lambda n: fw.Aerodynamics({0: 0.3, 3: 0.1j}, 2.0).wave(DIAMETERS, n), N),
    "flow, ratios": (lambda d: fw.Aerodynamics.from_damping({d: 0.1}, N, 2.0).influence, DIAMETERS),
    "damping ratios": (lambda r: fw.modal_damping(np.eye(2), np.diag([1.0, 2.0]), {r: 0.1}), 2),
}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("name", WORK)
def test_a_short_integer_is_the_number_that_it_is(name: str, kind: Callable[[int], Any]) -> None:
    """The wave of int8(99) sectors was wrong by 2e-5, next sectors of uint8(1) were 255 places behind."""
    work, value = WORK[name]
    plain, short = list(numbers(work(value))), list(numbers(work(kind(value))))
    assert len(plain) == len(short) and all(np.array_equal(a, b) for a, b in zip(plain, short))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_waves_of_interface_modes_may_stand_in_an_array(kind: Any) -> None:
    """The truth of an array was asked."""
    M, K = np.diag([1.0, 0.5, 0.7, 0.0]), np.diag([3.0, 2.5, 0.9, 1.0])
    K[[0, 1, 1, 2, 0, 3], [1, 0, 2, 1, 3, 0]] = [-1.0, -1.0, -0.5, -0.5, -1.0, -1.0]

    def reduced(diameters: Any) -> Any:
        found = fw.reduce_sector(M, K, [0], [3], N, keep=[1], modes=1, interface_diameters=diameters, interface_waves=2)
        return list(numbers(list(found.sector().K.values())))

    assert all(map(np.array_equal, reduced([1, DIAMETERS]), reduced(np.array([1, DIAMETERS], kind))))
