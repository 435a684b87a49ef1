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
from ..model.laws import Limit, Role, kept_laws


def slip_factor(
    forces: Array, limit: float | Array | None = None, friction: float | Array | None = None, each: bool = False
) -> float:
    """Factor on a sticking motion at which the first pair slips; inf when no amplitude makes it slip.

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
        return min(slip_factor(forces[:, [0, row]], friction=friction) for row in (1, 2))
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
    return float(min(_root(a, b, c * np.ones_like(a)), default=np.inf))


def _root(a: Array, b: Array, c: Array) -> list[float]:
    """Smallest positive s with a s^2 + 2 b s + c = 0 (c < 0: it sticks at rest), as a list without or with it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        # of the two forms of the roots, the one that neither cancels nor divides by a = 0
        discriminant = np.sqrt(b**2 - a * c)
        s = -c / (b + discriminant)
    good = s[np.isfinite(s) & (s > 0)]
    return [float(good.min())] if good.size else []


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
