"""Lagrange polynomials on the unit interval, and their products on the unit square and cube."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..arrays import Array


def lagrange(order: int, points: Array) -> tuple[Array, Array]:
    """Values and derivatives (n_points, order + 1) of the polynomials through equidistant nodes on [0, 1]."""
    powers = np.arange(order + 1)
    coefficients = np.linalg.inv(np.linspace(0.0, 1.0, order + 1)[:, None] ** powers)
    points = np.asarray(points, dtype=float)
    slopes = powers[1:] * points[:, None] ** powers[:-1]
    return points[:, None] ** powers @ coefficients, slopes @ coefficients[1:]


def gauss(order: int) -> tuple[Array, Array]:
    """Points and weights on [0, 1]; exact for the Jacobian of an element of this order on each axis."""
    points, weights = np.polynomial.legendre.leggauss(order + 1)  # type: ignore[no-untyped-call]
    return (points + 1.0) / 2.0, weights / 2.0


@cache
def tensor_gauss(order: int, dimension: int) -> tuple[Array, Array, Array]:
    """Shape functions at the Gauss points of the unit square or cube.

    Returns
    -------
    values : (n_points, n_nodes)
    gradients : (n_points, n_nodes, dimension)
    weights : (n_points,)
    """
    points, weights = gauss(order)
    values, gradients = tensor(order, [points] * dimension)
    product = weights
    for _ in range(dimension - 1):
        product = np.multiply.outer(product, weights)
    return values, gradients, product.ravel()


def tensor(order: int, points: list[Array]) -> tuple[Array, Array]:
    """Shape functions and gradients at a grid of points, given per axis; nodes and points in C order."""
    axes = [lagrange(order, p) for p in points]
    values = _product([value for value, _ in axes])
    gradients = [_product([d if b == a else v for b, (v, d) in enumerate(axes)]) for a in range(len(axes))]
    return values, np.stack(gradients, axis=-1)


def _product(factors: list[Array]) -> Array:
    whole = factors[0]
    for factor in factors[1:]:
        whole = np.kron(whole, factor)
    return whole
