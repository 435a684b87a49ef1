"""Amplitude at which the first contact pair slips, from the forces of a motion in which all pairs stick.

Sticking contacts are springs, so that the motion is linear: at s times the amplitude the force of a pair is
f0 + s (f - f0), f0 its mean over the period. A slider gives way where |f_t| = R (constant limit), or where
|f_t| = mu N; the smallest such s > 0 over pairs and samples is the threshold. Samples miss the extremes of a
harmonic by at most (pi / N_t)^2 / 2 of its amplitude.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..model.law_info import Limit, Role, kept_laws

#: Of two tangents, in which slip that lasts is looked for.
DIRECTIONS = 64


def slip_factor(
    forces: Array, limit: float | Array | None = None, friction: float | Array | None = None, each: bool = False
) -> float:
    """Factor on a sticking motion at which the first pair slips; inf when no amplitude makes it slip.

    Parameters are those of `slip_factors`.
    """
    return float(min(slip_factors(forces, limit, friction, each), default=np.inf))


def slip_factors(
    forces: Array, limit: float | Array | None = None, friction: float | Array | None = None, each: bool = False
) -> Array:
    """Factor (n_pairs,) on a sticking motion at which each pair slips; inf where no amplitude makes it slip.

    Parameters
    ----------
    forces : (n_samples, components, n_pairs)
        Over a period; with three components the first is normal, > 0 in contact [force].
    limit : float or (n_pairs,)
        Friction limit of sliders with one component [force].
    friction : float or (n_pairs,)
        Coefficient of friction of pairs with three components.
    each : bool
        Each of two tangents is limited by itself, rather than both in a circle.
    """
    if each and forces.shape[1] == 3:
        first, second = (slip_factors(forces[:, [0, row]], friction=friction) for row in (1, 2))
        return np.minimum(first, second)
    mean = forces.mean(axis=0)
    swing = forces - mean
    if forces.shape[1] == 1:
        assert limit is not None
        tangent, rest, moves, holds = swing, mean, 0.0, np.broadcast_to(limit, mean.shape[1:])
    else:
        assert friction is not None
        tangent, rest = swing[:, 1:], mean[1:]
        moves, holds = friction * swing[:, 0], friction * mean[0]
    # |rest + s tangent|^2 = (holds + s moves)^2
    a = np.sum(tangent**2, axis=1) - moves**2
    b = np.sum(rest * tangent, axis=1) - holds * moves
    c = np.sum(rest**2, axis=0) - holds**2
    return _roots(a, b, c * np.ones_like(a))


def _roots(a: Array, b: Array, c: Array) -> Array:
    """Smallest positive s of all samples with a s^2 + 2 b s + c = 0 (c < 0: it sticks at rest), inf without one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        # of the two forms of the roots, the one that neither cancels nor divides by a = 0
        discriminant = np.sqrt(b**2 - a * c)
        s = -c / (b + discriminant)
    return np.asarray(np.where(np.isfinite(s) & (s > 0), s, np.inf).min(axis=0))


def lasting_factors(
    forces: Array, limit: float | Array | None = None, friction: float | Array | None = None, each: bool = False
) -> Array:
    """Factor (n_pairs,) on a sticking motion from which each pair slips in every period, inf where none does.

    Below it a pair that slipped once sticks with its slider elsewhere, its mean tangential force c another: it lasts
    when no c has |c + s t| <= mu (N0 + s n) all over the period (shakedown, Melan). Along a direction that leaves
    s (max(t - mu n) + max(-t - mu n)) <= 2 mu N0. Of two tangents in a circle the least over `DIRECTIONS` is taken,
    which is exact where they move along one line. What the settled slider's force does through the structure, to the
    normal force and to other pairs, is left out.

    Parameters
    ----------
    forces, limit, friction, each : as for `slip_factors`
    """
    mean = forces.mean(axis=0)
    swing = forces - mean
    if forces.shape[1] == 1:
        assert limit is not None
        tangents, moves, holds = [swing[:, 0]], 0.0, np.broadcast_to(limit, mean.shape[1:])
    else:
        assert friction is not None
        moves, holds = friction * swing[:, 0], friction * mean[0]
        tangents = list(np.moveaxis(swing[:, 1:], 1, 0))
    if len(tangents) == 2 and not each:
        angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        tangents = [np.cos(angle) * tangents[0] + np.sin(angle) * tangents[1] for angle in angles]
    spans = [np.max(t - moves, axis=0) + np.max(-t - moves, axis=0) for t in tangents]
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(holds > 0, 2 * holds / np.max(spans, axis=0), 0.0))


def slip_threshold(amplitude: float, forces: Mapping[str, Array], attributes: Mapping[str, Any]) -> float:
    """Threshold [length] from a point at which all pairs stick; nan where a law has none, inf when none is enough.

    Parameters
    ----------
    amplitude : of the point
    forces : {name of the contact: (n_samples, components, n_pairs)}
    attributes : of the analysis' group in the results, with the parameters of the contacts
    """
    case, laws = json.loads(attributes["case"]), kept_laws(json.loads(attributes.get("laws", "{}")))
    factors = []
    for name, values in forces.items():
        law = laws.get(name)
        if law is None or law.limit == Limit.NONE:
            return float("nan")
        role = Role.FRICTION_LIMIT if law.normal is None else Role.FRICTION_COEFFICIENT
        given = law.value(name, role, case)
        if given is None:
            return float("nan")
        values, bound = values.astype(float), np.asarray(given)
        factors.append(slip_factor(values, limit=bound, friction=bound, each=law.limit == Limit.EACH))
    return amplitude * min(factors, default=np.nan)
